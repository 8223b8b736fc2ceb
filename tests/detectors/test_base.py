"""What every detector inherits, and a detector that a user writes."""

import copy

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.calibration.clean_statistics import joint_statistics, white_statistics
from spoofgym.detectors import Ensemble, make_detector
from spoofgym.detectors.base import Detector
from spoofgym.detectors.ring import Ring
from spoofgym.navigation.interface import Epoch, Innovation
from spoofgym.responses import make_response
from spoofgym.responses.watching import Watching
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation


class Leaky(Detector):
    """A user's detector in plain NumPy: an exponentially forgetting sum of the nis."""

    name = "leaky"
    threshold = 60.0
    memory = 10

    def bind(self, num_runs, dimension):
        self.total = np.zeros(num_runs)

    def update(self, epoch):
        self.total = 0.8 * self.total + epoch.innovation.nis
        return self.total.copy()


def epoch_of(nis):
    n = len(nis)
    residual = np.stack([nis, nis, nis], axis=1)
    return Epoch(np.zeros(n, dtype=np.int64), np.zeros(n), Innovation(residual, np.zeros((n, 3, 3)), residual, nis))


def test_ring_forgets_the_oldest_and_takes_from_a_smaller_one():
    ring, small = Ring(3, 2), Ring(2, 2)
    for value in (1.0, 2.0, 3.0):
        ring.push(np.array([value, 10 * value, 100 * value]))
        small.push(np.array([-value, -10 * value]))
    assert np.sort(ring.values, axis=1).tolist() == [[2, 3], [20, 30], [200, 300]]
    ring.take(np.array([2, 0]), small)
    ring.push(np.array([5.0, 5.0, 5.0]))
    assert np.sort(ring.values, axis=1).tolist() == [[-30, 5], [5, 30], [-3, 5]]


def test_a_ring_that_was_reset_lies_in_memory_as_a_new_one():
    """The order in which a sum is taken, and so its last bit, depends on the episode alone."""
    used, new = Ring(2, 3), Ring(2, 3)
    used.push(np.array([7.0, 8.0]))
    used.reset(np.array([1]))
    for value in (1.0, 2.0):
        used.push(np.array([value, value]))
        new.push(np.array([value, value]))
    assert used.values[1].tolist() == new.values[1].tolist()
    assert used.values[0].tolist() == [7.0, 1.0, 2.0]


@pytest.mark.parametrize("make", [lambda: make_detector("windowed:n=4"), lambda: make_detector("acna"), Leaky])
def test_take_copies_the_memories_of_fewer_runs(make):
    """Afterwards the runs that were taken go on as in the small detector, the others as if nothing had happened."""
    rng = np.random.default_rng(2)
    whole, untouched = make(), make()
    whole.bind(5, 3)
    untouched.bind(5, 3)
    small = copy.copy(whole)
    small.bind(2, 3)
    for _ in range(7):
        nis = rng.integers(0, 50, 5).astype(float)
        whole.update(epoch_of(nis))
        untouched.update(epoch_of(nis))
    for _ in range(6):
        small.update(epoch_of(rng.integers(100, 150, 2).astype(float)))
    runs = np.array([3, 1])
    whole.take(runs, small)
    for _ in range(5):
        nis = rng.integers(0, 50, 5).astype(float)
        got = whole.update(epoch_of(nis))
        assert got[runs].tolist() == pytest.approx(small.update(epoch_of(nis[runs])).tolist(), rel=1e-14)
        assert got[[0, 2, 4]].tolist() == untouched.update(epoch_of(nis))[[0, 2, 4]].tolist()


def test_take_leaves_what_both_share():
    """A constant whose length happens to be the number of runs."""
    whole = Leaky()
    whole.weights = np.array([1.0, 2.0])
    whole.bind(5, 3)
    small = copy.copy(whole)
    small.bind(2, 3)
    whole.take(np.array([1, 0]), small)
    assert whole.weights.tolist() == [1.0, 2.0]


def staggered(num_runs, steps=40):
    """Statistics, indices and nis of every step; run i restarts at steps of its own."""
    scenario = make_scenario("liu-flight:horizon=30")
    detectors = [Leaky(), make_detector("windowed:n=5,p_fa=1e-6")]
    simulation = Simulation(scenario, make_attack("ramp:1"), detectors, None, num_runs, seed=100)
    simulation.reset()
    rows = []
    for step in range(steps):
        due = np.array([run for run in range(num_runs) if (step + 4 * run) % (13 + run % 5) == 0], dtype=np.int64)
        simulation.resolve()
        simulation.restart(due)
        epoch = simulation.observe()
        columns = [epoch.index, epoch.innovation.nis, *epoch.statistics.values(), simulation.alarm]
        rows.append(np.stack([np.array(column, dtype=float) for column in columns]))
    return np.array(rows)


def test_a_users_detector_runs_with_staggered_resets():
    """The statistic is the recursion written out, started anew from a burn-in that had no alarm."""
    index, nis, leaky, windowed, alarm = staggered(7).transpose(1, 2, 0)
    restarts = 0
    for run in range(7):
        for step in range(1, 40):
            if index[run, step] == 0:
                restarts += 1
                burnt = (leaky[run, step] - nis[run, step]) / 0.8  # what the burn-in left
                assert 0.0 < burnt <= Leaky.threshold
            else:
                assert leaky[run, step] == pytest.approx(0.8 * leaky[run, step - 1] + nis[run, step], rel=1e-12)
            if index[run, step] >= 5:
                assert windowed[run, step] == pytest.approx(nis[run, step - 4 : step + 1].sum(), rel=1e-12)
    limit = Simulation(make_scenario("liu-flight:horizon=30"), None, [make_detector("windowed:n=5,p_fa=1e-6")])
    threshold = next(iter(limit.detectors.values())).threshold
    assert restarts > 7
    assert np.array_equal(alarm.astype(bool), (leaky > Leaky.threshold) | (windowed > threshold))


def test_a_run_is_bit_identical_for_any_number_of_runs():
    one, seven, many = (staggered(n) for n in (1, 7, 64))
    assert np.array_equal(one, many[:, :, :1])
    assert np.array_equal(seven, many[:, :, :7])


def test_a_reset_of_some_runs_leaves_the_others():
    scenario = make_scenario("liu-flight:horizon=30")
    simulations = [Simulation(scenario, None, [Leaky()], None, 5, seed=1) for _ in range(2)]
    for simulation in simulations:
        simulation.reset()
    for step in range(12):
        for simulation in simulations:
            simulation.resolve()
            simulation.observe()
        if step == 5:
            before = simulations[0].error.copy()
            simulations[0].reset(np.array([1, 3]))
            assert np.all(np.abs(simulations[0].error - before)[[1, 3]].sum(axis=1) > 0)
    kept = [0, 2, 4]
    assert np.array_equal(simulations[0].error[kept], simulations[1].error[kept])
    assert np.array_equal(*(simulation.epoch.statistics["leaky"][kept] for simulation in simulations))
    assert simulations[0].epoch.index.tolist() == [12, 6, 12, 6, 12]


def test_simulation_refuses():
    scenario = make_scenario("liu-flight:horizon=30")
    with pytest.raises(ValueError, match="detector 'windowed:n=5' has no threshold yet: calibrate it first"):
        Simulation(scenario, None, [make_detector("windowed:n=5")])
    with pytest.raises(ValueError, match="num_runs must be a whole number, 1 or more, got 0"):
        Simulation(scenario, num_runs=0)
    with pytest.raises(ValueError, match="no fidelity 'exact'; valid fidelities: linear, strapdown"):
        Simulation(scenario, fidelity="exact")
    with pytest.raises(ValueError, match=r"threshold 0.001 of 'windowed:n=5,threshold=0.001' is far too low"):
        Simulation(scenario, None, [make_detector("windowed:n=5,threshold=1e-3")], None, 3, seed=0)
    short = Simulation(make_scenario("liu-flight:horizon=1"), seed=0)
    short.reset()
    short.resolve()
    short.observe()
    short.resolve()
    with pytest.raises(RuntimeError, match="run 0 has reached its last epoch: reset it"):
        short.observe()


class Giving(Detector):
    """A user's detector that gives something else from its fourth epoch on."""

    name = "giving"

    def __init__(self, given, threshold=100.0):
        self.given, self.threshold = given, threshold

    def bind(self, num_runs, dimension):
        self.count = 0

    def update(self, epoch):
        self.count += 1
        return epoch.innovation.nis if self.count <= 3 else self.given


BLIND = [
    (np.array([1.0, np.nan, 2.0]), r"'giving': update must return numbers, .* it returned nan in run 1, which exceeds"),
    (np.array([1.0, 1.0, -np.inf]), r"'giving': .* it returned -inf in run 2"),
    (np.zeros(2), r"'giving': .* 3 runs, real numbers in an array of shape \(3,\), got float64 of shape \(2,\)"),
    (np.zeros((3, 1)), r"'giving': .* got float64 of shape \(3, 1\)"),
    (np.zeros(3, dtype=complex), r"'giving': .* got complex128 of shape \(3,\)"),
    (np.array(["1", "2", "3"]), r"'giving': .* got <U1 of shape \(3,\)"),
    (1.5, r"'giving': .* got 1.5"),
    (None, r"'giving': .* got None"),
    ([[1.0], [1.0, 2.0], [3.0]], r"'giving': .* got \[\[1.0\], \[1.0, 2.0\], \[3.0\]\]"),
]


def played(detectors):
    """Five epochs of three runs."""
    simulation = Simulation(make_scenario("liu-flight:horizon=9,onset=300"), None, detectors, None, 3, seed=0)
    simulation.reset()
    for _ in range(5):
        simulation.resolve()
        simulation.observe()
    return simulation


@pytest.mark.parametrize(("given", "message"), BLIND)
def test_a_blind_detector_is_refused_by_its_name(given, message):
    with pytest.raises(ValueError, match=message):
        played([Giving(given)])
    with pytest.raises(ValueError, match=message):
        played([Ensemble([Giving(given), make_detector("snapshot")], 1.0)])
    clean = white_statistics(np.eye(3), 10)
    with pytest.raises(ValueError, match=message):
        clean(Giving(given), 3, np.random.default_rng(0))
    with pytest.raises(ValueError, match=message):
        joint_statistics(make_scenario("liu-flight:horizon=9,onset=300"), "linear")(
            [Giving(given)], 3, np.random.default_rng(0)
        )


@pytest.mark.parametrize("given", [[1, 200, 3], np.array([1, 200, 3], dtype=np.float32), np.array([1.0, np.inf, 3.0])])
def test_other_real_numbers_are_taken_as_they_are(given):
    simulation = played([Giving(given)])
    assert simulation.alarm.tolist() == [False, True, False]
    assert simulation.epoch.statistics["giving"].dtype == np.float64


@pytest.mark.parametrize("threshold", [np.nan, np.inf, -np.inf, 0.0, -1.0, "3", np.array([1.0, 2.0])])
def test_a_threshold_that_decides_nothing_is_refused(threshold):
    message = r"detector 'giving': threshold must be a finite number greater than 0, got "
    with pytest.raises(ValueError, match=message):
        played([Giving(np.zeros(3), threshold)])
    with pytest.raises(ValueError, match=message):
        played([Ensemble([Giving(np.zeros(3), threshold), make_detector("snapshot")], 1.0)])
    with pytest.raises(ValueError, match=message):
        Watching(make_response("exclude"), "giving", [Giving(np.zeros(3), threshold)])
