"""The clock against its oscillator: the score by hand, its distribution, and what it sees of a spoofer."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import make_attack
from spoofgym.detectors import ClockDrift, make_detector
from spoofgym.detectors.clock_drift import drift_score
from spoofgym.navigation.facts import FilterFacts
from spoofgym.navigation.white import white_epochs
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from tests.detectors.test_raim import PRESENT, epoch_of, ranges

RATES = make_scenario("liu-flight:coupling=tight,horizon=60")
CARRIERS = make_scenario("kujur-flight:onset=60,horizon=30")


@pytest.mark.parametrize("present", PRESENT, ids=["all", "gaps"])
@pytest.mark.parametrize("carrier", [False, True], ids=["rate", "carrier"])
def test_the_score_is_that_of_a_step_of_the_drift(present, carrier):
    """h'S⁻¹z / √(h'S⁻¹h), with the inverse of all of S."""
    innovation, _ = ranges(0, 6, present)
    score = drift_score(innovation, carrier)
    step = np.concatenate([present & carrier, present]).astype(float)
    for run in range(6):
        weight = np.linalg.inv(innovation.covariance[run])
        expected = step @ weight @ innovation.residual[run] / np.sqrt(step @ weight @ step)
        assert score[run] == pytest.approx(expected, rel=1e-8)


def test_a_covariance_that_all_runs_share_gives_the_same_score():
    white = RATES.family.white_innovations()
    normals = np.random.default_rng(2).standard_normal((4, white.dimension))
    together = drift_score(white.innovation(3, normals), False)
    apart = [drift_score(white.innovation(3, normals[k : k + 1]), False)[0] for k in range(4)]
    np.testing.assert_allclose(together, apart, rtol=1e-12)


@pytest.mark.parametrize("scenario", [RATES, CARRIERS], ids=["rate", "carrier"])
def test_the_statistic_is_chi_square_with_one_degree_of_freedom(scenario):
    detector = make_detector("clock-drift:n=5,p_fa=1e-3")
    runs = 4000
    detector.bind(runs, scenario.dimension)
    detector.know(scenario.facts)
    white = scenario.family.white_innovations()
    normals = np.random.default_rng(3).standard_normal((runs, 5, white.dimension))
    for epoch in white_epochs(white, scenario.timeline, normals):
        statistic = detector.update(epoch)
    assert stats.kstest(statistic, stats.chi2(1).cdf).pvalue > 1e-7
    assert detector.threshold == pytest.approx(stats.chi2.isf(1e-3, 1))


def test_epochs_without_ranges_count_as_zero():
    innovation, _ = ranges(4, 2, np.ones(6, dtype=bool))
    detector = ClockDrift(n=3, threshold=1.0)
    detector.bind(2, 12)
    detector.know(FilterFacts("here", 1.0, np.zeros(6), (), lambda burn_in: None, observable="rate"))
    first = detector.update(epoch_of(innovation))
    again = detector.update(epoch_of(innovation, 1, available=np.array([True, False])))
    np.testing.assert_allclose(again, first * [4.0, 1.0])
    detector.reset(np.array([0]))
    np.testing.assert_allclose(detector.update(epoch_of(innovation, 2))[0], first[0])


def alarms(attack, scenario, name, runs=40):
    """Share of runs that alarm at some time."""
    detector = make_detector(name)
    simulation = Simulation(scenario, make_attack(attack), [detector], None, runs, 7)
    simulation.reset()
    found = np.zeros(runs, dtype=bool)
    for _ in range(scenario.timeline.num_epochs):
        simulation.resolve()
        simulation.observe()
        found |= simulation.alarm
    return found.mean()


def test_it_sees_a_pull_of_the_clock_that_a_test_of_the_position_does_not():
    """5 m/s at once are 26 of the 0.19 m/s that the crystal's drift wanders in a second."""
    pull = "liu-spoofer:0,clock_rate=5"
    assert alarms(pull, RATES, "clock-drift:n=5,p_fa=1e-6") == 1.0
    assert alarms(pull, RATES, "signed-mean:n=20,p_fa=1e-6") == 0.0
    assert alarms("ramp:0.05", RATES, "clock-drift:n=5,p_fa=1e-6") == 0.0


def test_a_filter_on_fixes_has_no_clock():
    with pytest.raises(ValueError, match="needs ranges to satellites"):
        Simulation(make_scenario("liu-flight"), None, [make_detector("clock-drift:p_fa=1e-3")], seed=0)
