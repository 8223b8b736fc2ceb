"""The loop over epochs: run i is the same whatever runs beside it, and what bad input is told."""

import copy
import dataclasses

import numpy as np
import pytest

from spoofgym.attacks.profiles import Ramp, SlowChange
from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.detectors.chi_square import Snapshot, Windowed
from spoofgym.navigation.interface import Demands
from spoofgym.responses.exclude import Exclude
from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.liu_flight import liu_flight
from spoofgym.sensors.receiver import Receiver
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams

FIDELITIES = ("linear", "strapdown")
HORIZON = 5


def matched():
    return liu_flight(onset=30.0, horizon=HORIZON)


def coloured():
    """A filter that is not matched: detectors are burnt in by clean epochs."""
    base = liu_flight(onset=30.0, horizon=HORIZON, imu="tactical")
    return base.changed(receiver=Receiver(markov_sigma=(3.0, 3.0, 5.0), markov_time=30.0))


def simulation(scenario, runs, fidelity="linear", threads=1, seed=60, attack=True, **options):
    """With a window whose threshold is so low that some runs alarm in their burn-in and draw again."""
    options.setdefault("detectors", [Snapshot(), Windowed(4, threshold=22.0)])
    attack = SlowChange() if attack is True else attack
    return Simulation(scenario, attack, num_runs=runs, seed=seed, fidelity=fidelity, threads=threads, **options)


def snapshot(sim):
    """Everything that one epoch shows, and the truth, by run."""
    epoch, innovation = sim.epoch, sim.epoch.innovation
    parts = [sim.error, sim.offset, epoch.index, epoch.time, innovation.residual, innovation.covariance]
    parts += [innovation.whitened, innovation.nis, *epoch.statistics.values(), sim.alarm]
    parts += [sim.navigator.position_covariance, sim.navigator.estimated_bias]
    return [np.array(part, dtype=float).reshape(sim.num_runs, -1) for part in parts]


def record(sim, epochs=HORIZON, episodes=1):
    """(N, numbers) of whole episodes."""
    rows = []
    for _ in range(episodes):
        sim.reset()
        rows += snapshot(sim)
        for _ in range(epochs):
            sim.resolve()
            sim.observe()
            rows += snapshot(sim)
    return np.hstack(rows)


@pytest.mark.parametrize("excludes", [False, True], ids=["use", "exclude"])
@pytest.mark.parametrize("fidelity", FIDELITIES)
@pytest.mark.parametrize("make", [matched, coloured])
def test_run_i_is_bit_identical_for_any_number_of_runs_and_threads(make, fidelity, excludes):
    scenario = make()
    options = [{"response": Exclude()} if excludes else {} for _ in range(6)]
    whole = record(simulation(scenario, 64, fidelity, **options[0]), episodes=2)
    assert np.unique(whole[:, 0]).size == 64
    assert np.isfinite(whole).all()
    for (runs, threads), extra in zip([(1, 1), (7, 1), (7, 2), (64, 2)], options[1:], strict=False):
        part = record(simulation(scenario, runs, fidelity, threads, **extra), episodes=2)
        np.testing.assert_array_equal(part, whole[:runs])
    alone = record(simulation(scenario, 1, fidelity, seed=65, **options[5]), episodes=2)
    np.testing.assert_array_equal(alone, whole[5:6])


@pytest.mark.parametrize("excludes", [False, True], ids=["use", "exclude"])
def test_slices_of_the_linear_fidelity_change_nothing(excludes):
    """Enough runs that two threads really share them."""
    one, two = (
        record(simulation(matched(), 600, threads=threads, response=Exclude() if excludes else None))
        for threads in (1, 2)
    )
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("fidelity", FIDELITIES)
@pytest.mark.parametrize("make", [matched, coloured])
def test_resetting_some_runs_leaves_the_others_alone(make, fidelity):
    """The runs that are reset play on as in the second episode of a batch that is reset as a whole."""
    undisturbed = simulation(make(), 6, fidelity)
    whole = simulation(make(), 6, fidelity)
    some = simulation(make(), 6, fidelity)
    again, others = np.array([1, 4]), np.array([0, 2, 3, 5])
    for sim in (undisturbed, whole, some):
        sim.reset()
        for _ in range(2):
            sim.resolve()
            sim.observe()
    whole.reset()
    some.reset(again)
    for step in range(4):
        kept, new, mixed = (snapshot(sim) for sim in (undisturbed, whole, some))
        for a, b, c in zip(kept, new, mixed, strict=True):
            np.testing.assert_array_equal(c[others], a[others])
            np.testing.assert_array_equal(c[again], b[again])
        if step < 3:
            for sim in (undisturbed, whole, some):
                sim.resolve()
                sim.observe()


@pytest.mark.parametrize("fidelity", FIDELITIES)
@pytest.mark.parametrize("make", [matched, coloured])
def test_reset_in_parts_is_a_reset(make, fidelity):
    whole, parts = (simulation(make(), 5, fidelity) for _ in range(2))
    whole.reset()
    for runs in ([3, 0], [], [1], [4, 2]):
        parts.reset(np.array(runs, dtype=np.int64))
    for _ in range(2):
        for a, b in zip(snapshot(whole), snapshot(parts), strict=True):
            np.testing.assert_array_equal(a, b)
        for sim in (whole, parts):
            sim.resolve()
            sim.observe()


@pytest.mark.parametrize("fidelity", FIDELITIES)
@pytest.mark.parametrize("make", [matched, coloured])
def test_two_attackers_on_a_seed_meet_the_same_noise_in_every_episode(make, fidelity):
    """First episodes of different length and offset, one attacker drawing numbers; the second episodes are clean."""
    quiet, loud = simulation(make(), 4, fidelity, attack=None), simulation(make(), 4, fidelity)
    for sim, epochs in ((quiet, 2), (loud, HORIZON)):
        sim.reset()
        for _ in range(epochs):
            sim.resolve()
            sim.observe()
        sim.reset()
    first = quiet.epoch.innovation.residual.copy()
    for _ in range(HORIZON):
        for a, b in zip(snapshot(quiet), snapshot(loud), strict=True):
            np.testing.assert_array_equal(a, b)
        for sim in (quiet, loud):
            sim.resolve()
            sim.observe(np.zeros((4, 3)))
    quiet.reset()
    assert not np.array_equal(quiet.epoch.innovation.residual, first)


def test_an_offset_enters_the_fix_with_its_rate():
    """z falls by the offset, and the velocity's by the offset's change over the interval."""
    base = matched()
    sigma = (3.7, 3.7, 6.0, 0.1, 0.1, 0.2)
    scenario = base.changed(
        receiver=Receiver(velocity_sigma=sigma[3:]),
        tuning=dataclasses.replace(base.family.tuning, measurement_sigma=sigma),
    )
    clean, spoofed = (Simulation(scenario, num_runs=2, seed=1) for _ in range(2))
    for sim in (clean, spoofed):
        sim.reset()
        sim.resolve()
    offset = np.array([[3.0, -2.0, 1.0], [0.0, 0.0, 0.0]])
    change = spoofed.observe(offset).innovation.residual - clean.observe().innovation.residual
    np.testing.assert_allclose(change, np.hstack([-offset, -offset]), atol=1e-12)
    for sim in (clean, spoofed):
        sim.resolve()
    before = spoofed.error[0] - clean.error[0]
    assert (before * offset[0] > 0.0).all()  # the estimate follows the spoofed fix
    np.testing.assert_array_equal(spoofed.error[1], clean.error[1])


def test_the_attack_of_the_simulation_is_the_offset_of_a_caller():
    own, given = simulation(matched(), 3, attack=Ramp(2.0)), simulation(matched(), 3, attack=None)
    own.reset()
    given.reset()
    for k in range(1, HORIZON + 1):
        own.resolve()
        given.resolve()
        own.observe()
        given.observe(np.tile([2.0 * k, 0.0, 0.0], (3, 1)))
        for a, b in zip(snapshot(own), snapshot(given), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12)


def test_reset_ends_at_a_clean_epoch_zero_without_an_alarm_in_the_burn_in():
    sim = simulation(coloured(), 32)
    epoch = sim.reset()
    np.testing.assert_array_equal(epoch.index, 0)
    np.testing.assert_array_equal(epoch.time, 30.0)
    assert not sim.offset.any()


def test_observing_beyond_the_end_raises():
    sim = simulation(matched(), 3)
    sim.reset()
    for _ in range(HORIZON):
        sim.resolve()
        sim.observe()
    sim.resolve()
    with pytest.raises(RuntimeError, match="run 0 has reached its last epoch: reset it"):
        sim.observe()
    sim.reset(np.array([0]))
    with pytest.raises(RuntimeError, match="run 1 has reached its last epoch"):
        sim.observe()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"detectors": [Windowed(7)]}, "detector 'windowed:n=7' has no threshold yet: calibrate it first"),
        ({"attack": Ramp(1.0, onset=10.0)}, "onset 10 s lies outside the game, which runs from 30 s to 35 s"),
        ({"attack": Ramp(1.0, onset=35.0)}, "onset 35 s lies outside the game"),
        ({"runs": 0}, "num_runs must be a whole number, 1 or more, got 0"),
        ({"seed": -1}, "seed must be a non-negative integer or None, got -1"),
        ({"threads": 0}, "threads must be a whole number, 1 or more, got 0"),
        ({"fidelity": "exact"}, "has no fidelity 'exact'; valid fidelities: linear, strapdown"),
    ],
)
def test_bad_input_is_told_what_is_valid(options, message):
    with pytest.raises(ValueError, match=message):
        simulation(matched(), **{"runs": 2, **options})


@pytest.mark.parametrize("scenario", [matched, coloured])
def test_thresholds_that_alarm_in_nearly_every_burn_in_are_told_with_their_detectors(scenario):
    loud, quiet = Windowed(4, threshold=1e-9), Windowed(5, threshold=1e6)
    message = r"200 of 200 clean runs alarm .*: threshold 1e-09 of 'windowed:n=4,threshold=1e-09' is far too low"
    with pytest.raises(ValueError, match=message):
        simulation(scenario(), 2, detectors=[quiet, loud])
    # the sum over the three epochs before the game, chi-square with 9 degrees of freedom, is below 2 in 0.9 % of runs:
    # so many of 200 would pass with a probability of 1e-14
    with pytest.raises(ValueError, match="threshold 2 of"):
        simulation(matched(), 1, detectors=[Windowed(4, threshold=2.0)])


@pytest.mark.parametrize(
    "offset", [np.zeros((2, 2)), np.zeros((3, 3)), np.zeros(3), np.full((2, 3), np.nan), "x", [[1j] * 3] * 2]
)
def test_an_offset_that_is_none_is_refused(offset):
    sim = simulation(matched(), 2, attack=None)
    sim.reset()
    sim.resolve()
    with pytest.raises(ValueError, match="Simulation: offset must be finite numbers"):
        sim.observe(offset)
    sim.observe(np.zeros((2, 3)))


def test_the_trial_of_thresholds_leaves_the_runs_as_they_are(monkeypatch):
    detectors = [Windowed(4, threshold=14.0), Windowed(6, threshold=1e6)]
    tried = simulation(coloured(), 3, detectors=copy.deepcopy(detectors))
    monkeypatch.setattr(Simulation, "_passing", lambda self, detectors, runs: runs)
    untried = simulation(coloured(), 3, detectors=copy.deepcopy(detectors))
    for sim in (tried, untried):
        sim.reset()
        sim.resolve()
        sim.observe()
    np.testing.assert_array_equal(tried.error, untried.error)
    for name, statistic in tried.epoch.statistics.items():
        np.testing.assert_array_equal(statistic, untried.epoch.statistics[name])


def test_an_alarm_in_every_burn_in_all_the_same_names_the_thresholds(monkeypatch):
    monkeypatch.setattr(Simulation, "_passing", lambda self, detectors, runs: runs)
    sim = simulation(coloured(), 2, detectors=[Windowed(4, threshold=1e-9)])
    with pytest.raises(RuntimeError, match=r"2 runs alarm in each of 100 clean burn-ins: threshold 1e-09 of 'windowed"):
        sim.reset()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"horizon": 0}, "horizon must be 1 epoch or more, got 0"),
        ({"onset": 1.0}, "onset 1 s with a horizon of 5 epochs does not fit"),
        ({"onset": 1096.0}, "valid from 2 to 1095 s"),
        ({"onset": 30.5}, "onset 30.5 s is no epoch of a receiver at 1 Hz"),
        ({"drag_off_rate": (4.0, 0.0, 4.0)}, "drag_off_rate must be a finite number greater than 0, got 0"),
        ({"receiver": Receiver(velocity_sigma=(1.0, 1.0, 1.0))}, "expects fixes of dimension 3, the receiver gives 6"),
    ],
)
def test_a_scenario_that_does_not_fit_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        matched().changed(**changes)


class BeforeTheGame(Detector):
    """Alarms in every epoch before the game, and in none of it."""

    name = "before-the-game"
    threshold = 0.5

    def update(self, epoch):
        return (epoch.index < 0).astype(float)


@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
def test_a_burn_in_for_another_detector_changes_nothing_for_one_without_memory(fidelity):
    """Neither is its alarm heard before its own memory, nor has the unaided solution drifted before the game."""
    scenario = make_scenario("liu-flight:imu=tactical,horizon=5")
    detectors = [BeforeTheGame(), make_detector("windowed:n=30,threshold=1000")]
    demands = Demands(auxiliary=True)
    simulation = Simulation(scenario, None, detectors, None, 3, 0, fidelity=fidelity, demands=demands)
    assert simulation.burn_in == 29
    simulation.reset()
    assert not simulation.alarm.any()
    np.testing.assert_array_equal(simulation.navigator.auxiliary_offset, 0.0)
    simulation.resolve()
    assert np.all(simulation.navigator.auxiliary_offset[:, :2] != 0.0)


def test_given_streams_are_those_of_a_seed():
    given = simulation(matched(), 4, seed=None, streams=RunStreams.from_seed(60, 4))
    np.testing.assert_array_equal(record(given), record(simulation(matched(), 4, seed=60)))


def test_streams_beside_a_seed_or_of_another_number_of_runs_are_refused():
    with pytest.raises(ValueError, match="at most one of seed, streams"):
        Simulation(matched(), num_runs=3, seed=1, streams=RunStreams.from_seed(1, 3))
    with pytest.raises(ValueError, match="streams must be those of 3 runs, got 2"):
        Simulation(matched(), num_runs=3, streams=RunStreams.from_seed(1, 2))
