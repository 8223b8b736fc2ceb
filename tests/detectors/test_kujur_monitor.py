"""The combined monitor: what each half sees, the false alarms of both, and how long its window must be."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import make_attack
from spoofgym.calibration import calibrated
from spoofgym.detectors import KujurMonitor, make_detector
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

FALSE_FAILURE = 1e-8
FLIGHT = make_scenario("kujur-flight:onset=60,horizon=60")


def play(attack, detectors, runs, seed=0, scenario=FLIGHT, pull=None, last=None):
    """Statistics of every epoch after the first, (K, N), by name; ``pull`` gives the offset up by epoch."""
    simulation = Simulation(scenario, attack, detectors, None, runs, seed)
    simulation.reset()
    rows = []
    for k in range(1, (last or scenario.timeline.num_epochs) + 1):
        simulation.resolve()
        offset = None if pull is None else np.tile([0.0, 0.0, pull(k)], (runs, 1))
        rows.append(dict(simulation.observe(offset).statistics))
    return {detector.name: np.array([row[detector.name] for row in rows]) for detector in detectors}


def halves(monitor):
    """The two monitors as detectors of their own."""
    return [make_detector(member.name) for member in monitor.members]


def test_it_is_the_larger_of_both_over_their_thresholds():
    monitor = make_detector("kujur-monitor:n=12,direction=north")
    parts = halves(monitor)
    assert [part.name for part in parts] == [
        "cpi:n=12,direction=north,p_fa=5e-06",
        "separation-bank:n=12,direction=north,p_fa=5e-06",
    ]
    statistics = play(None, [monitor, *parts], 20, last=20)
    expected = np.maximum(*(statistics[part.name] / part.threshold for part in parts))
    np.testing.assert_array_equal(statistics[monitor.name], expected)


def test_each_half_has_half_of_the_false_alarms():
    """P_FA of 0.1 at an epoch: 0.05 by the CPI, which is exact, and 0.05 at most by the bank; 1e-8 each way."""
    runs, monitor = 3000, make_detector("kujur-monitor:n=10,p_fa=0.1")
    last = play(None, [monitor], runs, 4, last=15)[monitor.name][-1]
    alarms = int((last > 1.0).sum())
    assert stats.binom.cdf(alarms, runs, 0.05) > FALSE_FAILURE
    assert stats.binom.sf(alarms - 1, runs, 0.1) > FALSE_FAILURE


def test_a_fast_short_attack_is_seen_by_the_bank():
    monitor = make_detector("kujur-monitor:n=40")
    _, bank = halves(monitor)
    statistics = play(None, [monitor, bank], 30, 2, pull=lambda k: 0.5 * k, last=10)
    assert np.all(statistics[bank.name].max(axis=0) > 1.0)
    assert np.all(statistics[monitor.name] >= statistics[bank.name])


def test_a_long_attack_that_goes_nowhere_is_seen_by_its_tracking_error():
    """10 cm of white error for 40 epochs: the CPI misses 1e-9 of such replicas (`missed_detection`), the bank most.

    The bank alarms at the last epoch in 0.15 % of 2000 games; a fifth of 30 would have a probability below 1e-12.
    """
    monitor = make_detector("kujur-monitor:n=40")
    cumulative, bank = halves(monitor)
    replica = make_attack("tracking-error:ramp:0,sigma=0.1,axis=up")
    statistics = play(replica, [monitor, cumulative, bank], 30, 3, last=40)
    assert np.all(statistics[cumulative.name][-1] > cumulative.threshold)
    assert np.all(statistics[monitor.name][-1] > 1.0)
    assert np.mean(statistics[bank.name][-1] > 1.0) < 0.2


def test_protection_level_and_recovery_are_those_of_the_bank():
    monitor = make_detector("kujur-monitor:n=15,p_fa=0.001,p_md_ss=0.0001")
    bank = make_detector("separation-bank:n=15,p_fa=0.0005,p_md=0.0001")
    simulation = Simulation(FLIGHT, None, [monitor, bank], None, 3, 0)
    simulation.reset()
    for _ in range(10):
        simulation.resolve()
        simulation.observe()
        for name in ("protection_level", "coasting_sigma", "recovery_depth"):
            np.testing.assert_array_equal(getattr(monitor, name), getattr(bank, name))


def test_a_calibrated_factor_is_in_the_protection_level_too():
    """PL = factor T + Q⁻¹(P_MD) σ_coast."""
    levels = []
    for factor in (1.0, 2.0, 3.0):
        monitor = make_detector("kujur-monitor:n=15")
        monitor.set_threshold(factor)
        Simulation(FLIGHT, None, [monitor], None, 1, 0).reset()
        levels.append(monitor.protection_level[0])
    assert levels[1] - levels[0] == pytest.approx(levels[2] - levels[1], rel=1e-9)
    assert levels[1] - levels[0] > 0.1


@pytest.mark.parametrize(("sigma", "time"), [(0.03, 0.0), (0.3, 20.0)])
def test_the_shortest_window_misses_as_seldom_as_required(sigma, time):
    """1000 games, 1e-8 each: with n epochs P_MD of 0.2 or less, with one epoch less more than that."""
    monitor = make_detector("kujur-monitor:p_md_cpi=0.2")
    n = monitor.minimum_epochs(FLIGHT.tight_model(), sigma, time)
    assert 2 < n < 60
    replica = make_attack(f"tracking-error:ramp:0,sigma={sigma},time={time},axis=up")
    detectors = [make_detector(f"cpi:n={terms},p_fa=5e-6") for terms in (n, n - 1)]
    statistics = play(replica, detectors, 1000, 5, last=n)
    missed = [
        int((statistics[detector.name][detector.n - 1] <= detector.threshold).sum()) for detector in detectors
    ]
    assert stats.binom.sf(missed[0] - 1, 1000, 0.2) > FALSE_FAILURE
    assert stats.binom.cdf(missed[1], 1000, 0.2) > FALSE_FAILURE


def test_more_tracking_error_needs_fewer_epochs_and_too_little_more_than_there_are():
    monitor, model = KujurMonitor(), FLIGHT.tight_model()
    needed = [monitor.minimum_epochs(model, sigma, 0.0) for sigma in (1.0, 0.3, 0.1, 0.01)]
    assert needed[-1] is None
    assert needed[0] < needed[1] < needed[2] <= 60
    with pytest.raises(ValueError, match="sigma must be a finite number, 0 or more, got -1"):
        monitor.minimum_epochs(model, -1.0, 0.0)


def test_an_arl0_is_attained_by_a_factor_on_both():
    """Calibrated, then 2000 games of noise of their own: Poisson, 6 sigma of 300 and more first alarms."""
    detector = calibrated(make_detector("kujur-monitor:n=8,arl0=100"), FLIGHT)
    assert detector.calibrated
    simulation = Simulation(FLIGHT, None, [detector], None, 2000, 77)
    simulation.reset()
    alive, alarms, at_risk = np.ones(2000, dtype=bool), 0, 0
    for _ in range(FLIGHT.timeline.num_epochs):
        simulation.resolve()
        at_risk += int(alive.sum())
        now = simulation.observe().statistics[detector.name] > detector.threshold
        alarms += int((now & alive).sum())
        alive &= ~now
    assert at_risk / alarms == pytest.approx(100.0, rel=0.05 + 6.0 / np.sqrt(alarms))


def test_it_needs_ranges():
    message = "detector 'kujur-monitor' needs ranges to satellites, which scenario 'liu-flight' does not give"
    with pytest.raises(ValueError, match=message):
        Simulation(make_scenario("liu-flight"), None, [make_detector("kujur-monitor")])


def test_a_run_is_the_same_in_any_batch():
    name = "kujur-monitor:n=8"
    whole = play(None, [make_detector(name)], 9, 6, last=15)[name]
    np.testing.assert_array_equal(play(None, [make_detector(name)], 2, 6, last=15)[name], whole[:, :2])


@pytest.mark.parametrize(
    "specification",
    ["kujur-monitor", "kujur-monitor:n=20,direction=east,p_fa=0.001,p_md_cpi=1e-05,p_md_ss=0.01"],
)
def test_the_name_builds_the_same_detector(specification):
    detector = make_detector(specification)
    assert isinstance(detector, KujurMonitor)
    assert detector.name == specification
    assert detector.memory == detector.n - 1


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("kujur-monitor:n=0", "kujur-monitor: n must be a whole number, 1 or more, got 0"),
        ("kujur-monitor:direction=horizontal", "direction must be one of east, north, up, got 'horizontal'"),
        ("kujur-monitor:p_fa=0", "kujur-monitor: p_fa must be greater than 0 and less than 1, got 0"),
        ("kujur-monitor:p_md_cpi=1", "kujur-monitor: p_md_cpi must be greater than 0 and less than 1, got 1"),
        ("kujur-monitor:p_md_ss=2", "kujur-monitor: p_md_ss must be greater than 0 and less than 1, got 2"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
