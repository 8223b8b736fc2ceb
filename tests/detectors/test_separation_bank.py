import copy

import numpy as np
import pytest
from scipy import stats

from spoofgym.detectors import SeparationBank, make_detector
from spoofgym.detectors.separation_bank import DIRECTIONS
from spoofgym.navigation.interface import Decision, Demands, Epoch
from spoofgym.navigation.separation.coasting import coasting_tables
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

FALSE_FAILURE = 1e-8
FLIGHT = make_scenario("kujur-flight:onset=60,horizon=40")
OWN = Demands(excludes=True, history=12, auxiliary=True)
SHARED = Demands(auxiliary=True)


def ready(detector, runs, scenario=FLIGHT):
    detector.bind(runs, scenario.dimension)
    detector.know(scenario.facts)
    return detector


def simulate(runs, demands, scenario=FLIGHT, seed=3, **options):
    simulation = Simulation(scenario, None, (), None, runs, seed, demands=demands, **options)
    return simulation, simulation.reset()


@pytest.mark.parametrize("direction", ["up", "horizontal"])
def test_shared_gains_and_own_covariances_say_the_same(direction):
    detectors = [SeparationBank(15, direction), SeparationBank(15, direction)]
    simulations = [
        Simulation(FLIGHT, None, [detector], None, 4, 5, demands=demands)
        for detector, demands in zip(detectors, (SHARED, OWN), strict=True)
    ]
    for simulation in simulations:
        simulation.reset()
    for _ in range(40):
        for simulation in simulations:
            simulation.resolve()
            simulation.observe(np.full((4, 3), 0.1))
        one, other = (simulation.epoch.statistics[detectors[0].name] for simulation in simulations)
        np.testing.assert_allclose(one, other, rtol=1e-9)
        for name in ("protection_level", "coasting_sigma", "recovery_depth"):
            one, other = (getattr(detector, name) for detector in detectors)
            np.testing.assert_allclose(one, other, rtol=1e-9)


def test_the_separation_and_the_coasting_err_as_much_as_the_bank_believes():
    """900 games in which one filter uses every range and its twin none of the last 20; intervals of 1e-8 each."""
    runs, last, n = 900, 30, 20
    (using, _), (coasting, _) = simulate(runs, SHARED), simulate(runs, OWN)
    use = np.ones(runs, dtype=bool)
    for k in range(last + 1):
        if k:
            using.observe()
            coasting.observe()
        using.resolve(Decision(use))
        coasting.resolve(Decision(use if k <= last - n else ~use))
    tables = coasting_tables(FLIGHT.tight_model(), (0, 1, 2), n)
    row = last + n - 1
    for axis in range(3):
        variance, filtered = tables.variance[row, axis, n - 1], tables.filtered[row, axis]
        separation = (using.error - coasting.error)[:, axis]
        bounds = stats.chi2.ppf([FALSE_FAILURE / 2, 1.0 - FALSE_FAILURE / 2], runs) / runs
        assert bounds[0] < np.mean(separation**2) / variance < bounds[1]
        assert bounds[0] < np.mean(coasting.error[:, axis] ** 2) / (variance + filtered) < bounds[1]


def white(detector, runs, epochs, seed, scenario=FLIGHT):
    """Statistics (epochs, N) of white innovations, the burn-in left out."""
    ready(detector, runs, scenario)
    generator, white_innovations, kept = np.random.default_rng(seed), scenario.family.white_innovations(), []
    for k in range(-detector.memory, epochs):
        innovation = white_innovations.innovation(k, generator.standard_normal((runs, scenario.dimension)))
        index = np.full(runs, k)
        kept.append(detector.update(Epoch(index, index.astype(float), innovation)).copy())
    return np.array(kept[detector.memory :])


def test_one_window_has_the_false_alarm_rate_that_was_asked_for():
    statistic = white(SeparationBank(1, p_fa=0.05), 20_000, 1, 1)[0]
    assert stats.binomtest(int((statistic > 1.0).sum()), 20_000, 0.05).pvalue > FALSE_FAILURE


@pytest.mark.parametrize("direction", ["up", "horizontal"])
def test_many_windows_share_the_false_alarms(direction):
    """They are correlated, so that all together have less than was asked for, and more than a single one."""
    n, p_fa, runs = 12, 0.05, 20_000
    axes = len(DIRECTIONS[direction])
    alarms = int((white(SeparationBank(n, direction, p_fa=p_fa), runs, 1, 2)[0] > 1.0).sum())
    assert stats.binom.sf(alarms, runs, p_fa / (n * axes)) < FALSE_FAILURE
    assert stats.binom.cdf(alarms, runs, p_fa) < FALSE_FAILURE
    whole = int((white(SeparationBank(n, direction, p_fa=p_fa, split=False), runs, 1, 2)[0] > 1.0).sum())
    assert whole > alarms


@pytest.mark.parametrize("pull", [lambda k: 15.0, lambda k: 1.0 * k], ids=["step", "ramp"])
def test_fast_attacks_are_seen(pull):
    detector = SeparationBank(30)
    simulation = Simulation(FLIGHT, None, [detector], None, 20, 7)
    simulation.reset()
    peak = np.zeros(20)
    for k in range(1, 31):
        simulation.resolve()
        statistic = simulation.observe(np.tile([0.0, 0.0, pull(k)], (20, 1))).statistics[detector.name]
        peak = np.maximum(peak, statistic)
    assert (peak > 1.0).all()


@pytest.mark.parametrize("rate", [0.0, 0.3])
@pytest.mark.parametrize("direction", ["up", "horizontal"])
def test_the_error_is_within_the_protection_level_or_there_is_an_alarm(direction, rate):
    """P(|error| > PL without an alarm) <= 2 P_MD at an epoch, spoofed or not; within the length of the windows."""
    runs, p_md = 1500, 0.05
    detector = SeparationBank(40, direction, p_md=p_md)
    simulation = Simulation(FLIGHT, None, [detector], None, runs, 11)
    simulation.reset()
    alarmed = np.zeros(runs, dtype=bool)
    for k in range(1, 25):
        simulation.resolve()
        offset = rate * k * np.array([1.0, 0.0, 1.0])
        epoch = simulation.observe(np.tile(offset, (runs, 1)))
        alarmed |= epoch.statistics[detector.name] > 1.0
    simulation.resolve()
    error = np.abs(simulation.error[:, 2]) if direction == "up" else np.hypot(*simulation.error[:, :2].T)
    misled = int(((error > detector.protection_level) & ~alarmed).sum())
    assert stats.binom.sf(misled - 1, runs, 2.0 * p_md) > FALSE_FAILURE


def test_the_protection_level_is_the_threshold_plus_the_coasting():
    detector = make_detector("separation-bank:n=25,p_fa=1e-4,p_md=1e-3")
    white(detector, 2, 3, 1)
    tables = coasting_tables(FLIGHT.tight_model(), (2,), 25)
    variance, filtered = tables.variance[26, 0, 24], tables.filtered[26, 0]
    expected = stats.norm.isf(1e-4 / 50) * np.sqrt(variance) + stats.norm.isf(1e-3) * np.sqrt(variance + filtered)
    np.testing.assert_allclose(detector.protection_level, expected, rtol=1e-12)
    np.testing.assert_allclose(detector.coasting_sigma, np.sqrt(variance + filtered), rtol=1e-12)


def test_recovery_goes_to_the_beginning_of_the_last_window_that_closed_clean():
    """Without noise: a jump is in all open windows, and no window closes clean while it is; then new ones do."""
    n, detector = 5, SeparationBank(5)
    ready(detector, 2)
    innovations, depths = FLIGHT.family.white_innovations(), []
    for k in range(-4, 20):
        whitened = np.zeros((2, FLIGHT.dimension))
        whitened[1] = 50.0 if k == 6 else 0.0
        index = np.full(2, k)
        statistic = detector.update(Epoch(index, index.astype(float), innovations.innovation(k, whitened)))
        assert (statistic[1] > 1.0) == (6 <= k < 6 + n)
        depths.append(detector.recovery_depth.copy())
    depths = np.array(depths)[4:]
    assert depths[0].tolist() == [4, 4]  # none has closed yet: all since the reset
    assert (depths[1:, 0] == n).all()
    # windows that were open at epoch 6 alarm then; the first that is opened after it closes at 6 + n
    assert depths[:, 1].tolist() == [4, *[n] * 6, *range(n + 1, 2 * n + 1), *[n] * 8]


def test_a_reset_closes_the_windows_of_single_runs():
    generator = np.random.default_rng(4)
    whitened = generator.standard_normal((30, 3, FLIGHT.dimension))
    innovations = FLIGHT.family.white_innovations()
    together = ready(SeparationBank(8), 3)
    fresh = None
    for k in range(30):
        index = np.full(3, k)
        if k == 13:
            together.reset(np.array([1]))
            fresh = ready(SeparationBank(8), 1)
        statistic = together.update(Epoch(index, index * 1.0, innovations.innovation(k, whitened[k])))
        if fresh is not None:
            alone = innovations.innovation(k, whitened[k, 1:2])
            assert fresh.update(Epoch(index[:1], index[:1] * 1.0, alone))[0] == statistic[1]
            assert fresh.protection_level[0] == together.protection_level[1]


@pytest.mark.parametrize("demands", [SHARED, OWN], ids=["shared", "own"])
def test_it_is_bit_identical_for_any_number_of_runs(demands):
    def play(runs):
        detector = SeparationBank(6, "horizontal")
        simulation = Simulation(FLIGHT, None, [detector], None, runs, 9, demands=demands)
        simulation.reset()
        kept = []
        for k in range(25):
            simulation.resolve()
            if k == 12:
                simulation.restart(np.array([1]))
            statistic = simulation.observe(np.full((runs, 3), 0.1)).statistics[detector.name]
            kept.append(np.array([statistic, detector.protection_level, detector.recovery_depth])[:, :2])
        return np.array(kept)

    whole = play(2)
    np.testing.assert_array_equal(play(7), whole)
    np.testing.assert_array_equal(play(67), whole)


def test_the_strapdown_fidelity_separates_alike():
    """Φ along the estimate is that along the truth to second order: the standardised separation is normal to 3 %."""
    detector = SeparationBank(1, p_fa=0.05)
    simulation = Simulation(FLIGHT, None, [detector], None, 60, 2, fidelity="strapdown")
    simulation.reset()
    squares = []
    for _ in range(10):
        simulation.resolve()
        squares.append((simulation.observe().statistics[detector.name] * detector.multiplier) ** 2)
    total, bounds = np.sum(squares), stats.chi2.ppf([FALSE_FAILURE / 2, 1.0 - FALSE_FAILURE / 2], 600)
    assert 0.97 * bounds[0] < total < 1.03 * bounds[1]


def test_epochs_that_another_memory_adds_are_not_seen():
    detector, innovations = ready(SeparationBank(4), 2), FLIGHT.family.white_innovations()
    other = copy.copy(detector)
    other.bind(2, FLIGHT.dimension)
    generator = np.random.default_rng(1)
    for k in range(-10, 5):
        index = np.full(2, k)
        epoch = Epoch(index, index * 1.0, innovations.innovation(k, generator.standard_normal((2, FLIGHT.dimension))))
        statistic = detector.update(epoch)
        if k < -3:
            assert not statistic.any()
        else:
            np.testing.assert_array_equal(other.update(epoch), statistic)


def test_it_needs_ranges():
    with pytest.raises(ValueError, match="needs ranges to satellites"):
        Simulation(make_scenario("liu-flight:horizon=20"), None, [SeparationBank(5)], None, 1, 0)


@pytest.mark.parametrize(
    "specification",
    [
        "separation-bank",
        "separation-bank:n=10,direction=horizontal,p_fa=0.001,p_md=0.0001",
        "separation-bank:direction=north,split=false",
        "separation-bank:n=5,arl0=1000",
    ],
)
def test_the_name_builds_the_same_detector(specification):
    detector = make_detector(specification)
    assert isinstance(detector, SeparationBank)
    assert make_detector(detector.name).name == detector.name == specification
    assert detector.memory == detector.n - 1
    assert (detector.threshold is None) == (detector.target_arl0 is not None)


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("separation-bank:0", "n must be a whole number, 1 or more, got 0"),
        ("separation-bank:direction=down", "direction must be one of up, east, north, horizontal, got 'down'"),
        ("separation-bank:p_fa=1", "p_fa must be greater than 0 and less than 1, got 1"),
        ("separation-bank:p_md=0", "p_md must be greater than 0 and less than 1, got 0"),
        ("separation-bank:p_fa=0.1,arl0=10", "at most one of p_fa, arl0; got p_fa and arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
