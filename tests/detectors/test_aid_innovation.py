"""The test of what aids say: its statistic by hand, its distribution on clean games, and what it finds."""

import numpy as np
import pytest
from scipy.stats import chi2

from spoofgym.attacks import make_attack
from spoofgym.calibration import calibrated
from spoofgym.detectors import make_detector
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

FLIGHT = "liu-flight:horizon=30,onset=60"
AIDED = f"{FLIGHT},aids=barometer+magnetometer:rate=0.5"
QUIET = "threshold=1e8"
CHANCE = 1e-7


def play(scenario, name, runs, attack=None, fidelity="linear"):
    """Statistics of the epochs 0..K, (K+1, N), and what the aids told, epoch by epoch."""
    detectors = [make_detector(name)]
    simulation = Simulation(make_scenario(scenario), attack, detectors, num_runs=runs, seed=4, fidelity=fidelity)
    epoch = simulation.reset()
    statistics, told = [epoch.statistics], [epoch.view.aid_innovations]
    for _ in range(30):
        simulation.resolve()
        epoch = simulation.observe()
        statistics.append(epoch.statistics)
        told.append(epoch.view.aid_innovations)
    (kind,) = simulation.detectors
    return np.array([each[kind] for each in statistics]), told


@pytest.mark.parametrize(("aid", "rows"), [("", (0, 1)), (":barometer", (0,)), (":magnetometer", (1,))])
def test_the_statistic_is_the_squared_mean_over_its_variance(aid, rows):
    comma = "," if aid else ":"
    statistics, told = play(AIDED, f"aid-innovation{aid}{comma}n=5,{QUIET}", 3)
    for k in range(31):
        window = told[max(k - 4, 0) : k + 1]
        expected = np.zeros(3)
        for row in rows:
            total = sum(each.whitened[:, row] for each in window)
            heard = sum(each.count[:, row] > 0 for each in window)
            expected += np.where(heard > 0, total**2 / np.maximum(heard, 1), 0.0)
        np.testing.assert_allclose(statistics[k], expected, rtol=1e-9, atol=1e-12)
    assert {int(each.count[0, 1]) for each in told} == {0, 1}


def test_it_is_chi_square_with_a_degree_for_each_row():
    statistics, _ = play(AIDED, f"aid-innovation:n=6,{QUIET}", 400)
    last = statistics[[5, 11, 17, 23, 29]].ravel()  # windows that do not overlap
    for share in (0.5, 0.9, 0.99):
        exceeding = np.count_nonzero(last > chi2.isf(1.0 - share, 2))
        spread = 5.4 * np.sqrt(len(last) * share * (1.0 - share))  # two sides of a normal number: 7e-8
        assert abs(exceeding - len(last) * (1.0 - share)) <= spread + 1.0


def test_a_pull_of_the_height_is_found_by_the_barometer_alone():
    """Signed means of east and north do not look at the height; a filter with a barometer contradicts itself."""
    found, scenario = {}, make_scenario("liu-flight:horizon=100,onset=60,aids=barometer")
    for name in ("signed-mean:n=20,arl0=1000", "aid-innovation:n=20,arl0=1000"):
        detector = calibrated(make_detector(name), scenario)
        assert 700.0 < detector.arl0 < 1400.0
        simulation = Simulation(scenario, None, [detector], num_runs=200, seed=1)
        simulation.reset()
        alarmed = np.zeros(200, dtype=bool)
        for k in range(100):
            simulation.resolve()
            simulation.observe(np.tile([0.0, 0.0, 1.5 * k], (200, 1)))
            alarmed |= simulation.alarm
        found[name.partition(":")[0]] = alarmed.mean()
    assert found["aid-innovation"] == 1.0
    assert found["signed-mean"] < 0.2


def test_both_fidelities_show_the_same_test():
    low, high = chi2.ppf([CHANCE, 1.0 - CHANCE], 2 * 200)
    for fidelity in ("linear", "strapdown"):
        statistics, _ = play(AIDED, f"aid-innovation:n=6,{QUIET}", 200, fidelity=fidelity)
        assert low < statistics[29].sum() < high


@pytest.mark.parametrize(
    ("scenario", "detector", "message"),
    [
        (FLIGHT, "aid-innovation", r"detector 'aid-innovation:threshold=1e\+08' needs aids, which scenario"),
        (AIDED, "aid-innovation:wheel-speed", "has no aid 'wheel-speed'; it has: barometer, magnetometer"),
    ],
)
def test_what_the_scenario_does_not_have_is_refused(scenario, detector, message):
    separator = "," if ":" in detector else ":"
    with pytest.raises(ValueError, match=message):
        Simulation(make_scenario(scenario), None, [make_detector(detector + separator + QUIET)])


def test_no_spoofer_moves_it_by_the_noise_alone():
    clean, _ = play(AIDED, f"aid-innovation:n=6,{QUIET}", 3)
    same, _ = play(AIDED, f"aid-innovation:n=6,{QUIET}", 3, make_attack("ramp:1,onset=85"))
    np.testing.assert_array_equal(clean[:25], same[:25])
    assert np.any(clean[30] != same[30])
