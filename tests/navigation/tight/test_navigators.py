"""The tightly coupled navigators: statistics, both fidelities, satellites that are left out, fixes taken back."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.navigation.tight.own_gains import TightOwnNavigator
from spoofgym.navigation.tight.shared_gains import TightNavigator
from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.kujur_flight import kujur_flight
from spoofgym.simulation import Simulation

SHORT = "kujur-flight:onset=60,horizon=40"
FIDELITIES = ("linear", "strapdown")
OWN = Demands(excludes=True, history=20)
HISTORY = 20


def simulation(runs, fidelity="linear", demands=OWN, scenario=SHORT, attack=None, seed=3, threads=1):
    made = Simulation(
        make_scenario(scenario), attack, (), None, runs, seed, fidelity=fidelity, demands=demands, threads=threads
    )
    made.reset()
    return made


def play(made, epochs, decide=lambda k: None):
    """Errors after each resolve, and whitened innovations."""
    errors, whitened = [], []
    for k in range(epochs):
        made.resolve(decide(k))
        errors.append(made.error.copy())
        whitened.append(made.observe().innovation.whitened.copy())
    return np.array(errors), np.array(whitened)


class Pull(Attack):
    """Moves position and clock at once, by steps."""

    name = "pull"

    def __init__(self, offset, clock):
        self._step, self._clock_step = np.array(offset), clock

    def offset(self, clock):
        return np.where(self.started(clock)[:, None], self._step, 0.0)

    def clock_offset(self, clock):
        return np.where(self.started(clock), self._clock_step, 0.0)


def test_clean_innovations_are_white_with_the_degrees_of_the_satellites_in_view():
    """600 runs x 30 epochs: the sum of nis lies in its chi-square interval of 1e-9, lag-one products are zero."""
    made = simulation(600, demands=Demands())
    assert isinstance(made.navigator, TightNavigator)
    total, degrees, lagged, last = 0.0, 0, 0.0, None
    for _ in range(30):
        made.resolve()
        innovation = made.observe().innovation
        total += innovation.nis.sum()
        degrees += int(innovation.degrees.sum())
        if last is not None:
            lagged += (last * innovation.whitened).sum()
        last = innovation.whitened.copy()
    assert stats.chi2.ppf(5e-10, degrees) < total < stats.chi2.ppf(1.0 - 5e-10, degrees)
    assert abs(lagged) < 6.2 * np.sqrt(degrees * 29 / 30)


def test_true_errors_have_the_covariance_of_the_filter():
    """Sum of the squared errors of all states against P at the end, 800 runs, interval of 1e-9."""
    made = simulation(800, demands=Demands())
    play(made, 20)
    navigator = made.navigator
    covariance = navigator.model.covariance[20]
    scale = np.sqrt(np.diag(covariance))
    used = scale > 0
    root = np.linalg.cholesky(covariance[np.ix_(used, used)] / np.outer(scale[used], scale[used]))
    normal = np.linalg.solve(root, (navigator.state[:, used] / scale[used]).T)
    assert stats.chi2.ppf(5e-10, normal.size) < (normal**2).sum() < stats.chi2.ppf(1.0 - 5e-10, normal.size)


def test_estimated_biases_and_their_errors_make_the_data_sheet():
    made = simulation(2000, demands=Demands(), scenario="kujur-flight:onset=60,horizon=2")
    bias = made.navigator.true_bias / made.scenario.bias_sigma
    assert stats.chi2.ppf(5e-10, bias.size) < (bias**2).sum() < stats.chi2.ppf(1.0 - 5e-10, bias.size)


def test_a_covariance_of_its_own_changes_nothing_while_every_range_is_used():
    shared, own = simulation(5, demands=Demands(auxiliary=True)), simulation(5, demands=Demands(True, 0, True))
    assert isinstance(own.navigator, TightOwnNavigator)
    (error, whitened), (other_error, other_whitened) = play(shared, 30), play(own, 30)
    np.testing.assert_allclose(other_error, error, atol=1e-9)
    np.testing.assert_allclose(other_whitened, whitened, atol=1e-7)
    np.testing.assert_allclose(own.navigator.auxiliary_offset, shared.navigator.auxiliary_offset, atol=1e-9)
    np.testing.assert_allclose(own.navigator.position_covariance, shared.navigator.position_covariance, rtol=1e-7)
    np.testing.assert_allclose(own.navigator.inertial_covariance, shared.navigator.inertial_covariance, rtol=1e-6)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_run_i_is_bit_identical_for_any_number_of_runs_and_threads(fidelity):
    few = play(simulation(2, fidelity), 12)
    many = play(simulation(5, fidelity, threads=2), 12)
    for one, other in zip(few, many, strict=True):
        np.testing.assert_array_equal(one, other[:, :2])


def test_strapdown_agrees_with_linear_on_common_noise():
    """Without inertial noise all noise is common: the spoofed error grows to 10 m, the solutions agree to a centimetre.

    What is left is second order: the carrier makes the filter answer a false velocity of 0.7 m/s with tilts and heading
    errors that the linear transition carries to first order (a spoofer ten times as fast: 1.6 m of 100 m).
    """
    scenario = kujur_flight(onset=60.0, horizon=40)
    errors, innovations, clocks = [], [], []
    for fidelity in FIDELITIES:
        made = Simulation(scenario, None, (), None, 3, 3, fidelity=fidelity)
        if fidelity == "linear":
            made.navigator.model.dynamics.noise_columns[:] = 0.0
        else:
            made.navigator.model.true_noise[:] = 0.0
        made.reset()
        rows = []
        for k in range(1, 31):
            made.resolve()
            made.observe(np.tile(k * np.array([0.3, -0.2, 0.1, 0.2]), (3, 1)))
            rows.append(made.error.copy())
        errors.append(rows)
        innovations.append(made.epoch.innovation.in_position.residual)
        clocks.append(made.navigator.clock_error)
    first, second = np.array(errors)
    assert np.linalg.norm(first[-1] - first[0], axis=-1).min() > 8.0
    np.testing.assert_allclose(first, second, atol=0.03)
    np.testing.assert_allclose(clocks[0], clocks[1], atol=0.03)
    np.testing.assert_allclose(innovations[0], innovations[1], atol=0.001)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_pulled_clock_moves_the_clock_and_a_pulled_position_the_position(fidelity):
    """Against the same run without the spoofer: code and carrier agree with the lie, so that the filter swallows it.

    The velocity that a jump leaves behind has not died out after 20 s: 3 m in the vertical.
    """
    runs = 3
    quiet = simulation(runs, fidelity)
    for _ in range(40):
        quiet.resolve()
        quiet.observe()
    for offset, clock in (((0.0, 0.0, 0.0), 30.0), ((20.0, -10.0, 5.0), 0.0)):
        made = simulation(runs, fidelity, attack=Pull(offset, clock))
        for _ in range(40):
            made.resolve()
            made.observe()
        np.testing.assert_allclose(made.error - quiet.error, np.tile(offset, (runs, 1)), atol=4.0)
        np.testing.assert_allclose(made.navigator.clock_error - quiet.navigator.clock_error, clock, atol=4.0)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_satellite_that_is_left_out_is_not_believed(fidelity):
    """A jump of 500 m in the ranges of one satellite moves the estimate only where they are used."""

    class One(Pull):
        def captured(self, clock, satellites):
            return np.arange(satellites.shape[1]) == first

    made = simulation(2, fidelity)
    first = int(np.flatnonzero(made.scenario.tight_model().dynamics.present[0])[0])
    attack = One([0.0, 0.0, 300.0], 0.0)
    use = np.ones(2, dtype=bool)
    without = np.ones((2, made.scenario.slots), dtype=bool)
    without[:, first] = False
    errors = []
    for spoofed in (False, True):
        made = simulation(2, fidelity, attack=attack if spoofed else None)
        errors.append(play(made, 20, lambda k: Decision(use, satellites=without))[0])
    np.testing.assert_array_equal(errors[0], errors[1])
    believed = play(simulation(2, fidelity, attack=attack), 20, lambda k: Decision(use))[0]
    assert np.abs(believed[-1] - errors[0][-1]).max() > 5.0


def test_leaving_a_satellite_out_is_a_filter_without_it():
    """The update with fewer rows, by dense algebra."""
    made = simulation(1)
    navigator, dynamics = made.navigator, made.navigator.model.dynamics
    k, slots = int(navigator.index[0]), made.scenario.slots
    out = int(np.flatnonzero(dynamics.present[k])[1])
    keep = [a for a in range(2 * slots) if a % slots != out and dynamics.present[k, a % slots]]
    matrix = np.zeros((2 * slots, dynamics.num_states))
    for a in range(2 * slots):
        np.add.at(matrix[a], dynamics.columns[a], dynamics.values[k, a])
    matrix, noise = matrix[keep], np.diag(dynamics.noise_variance[k, keep])
    before, state = navigator.covariance[0].copy(), navigator.state[0].copy()
    residual = made.epoch.innovation.residual[0, keep]
    gain = before @ matrix.T @ np.linalg.inv(matrix @ before @ matrix.T + noise)
    satellites = np.ones((1, slots), dtype=bool)
    satellites[0, out] = False
    made.resolve(Decision(np.ones(1, dtype=bool), satellites=satellites))
    np.testing.assert_allclose(navigator.state[0], state - gain @ residual, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(navigator.covariance[0], before - gain @ matrix @ before, rtol=1e-5, atol=1e-8)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_taking_back_equals_leaving_out(fidelity):
    """Bit for bit, as for the loosely coupled filter; the truth and its biases stay where they are."""
    runs, at = 3, 25
    depths = np.array([0, 7, HISTORY])

    def back(k):
        return Decision(np.full(runs, k < at), backtrack=depths) if k == at else Decision(np.full(runs, k < at))

    one, other = simulation(runs, fidelity, seed=4), simulation(runs, fidelity, seed=4)
    errors = play(one, 32, back)[0]
    expected = play(other, 32, lambda k: Decision(k < at - depths))[0]
    np.testing.assert_array_equal(errors[at:], expected[at:])
    np.testing.assert_array_equal(one.navigator.covariance, other.navigator.covariance)
    np.testing.assert_array_equal(one.navigator.true_bias, other.navigator.true_bias)
    assert (one.navigator.backtracked == 0).all()


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_reset_goes_to_the_position_that_the_ranges_ask_for(fidelity):
    made = simulation(2, fidelity)
    made.resolve(Decision(np.zeros(2, dtype=bool)))
    made.observe(np.full((2, 4), 40.0))
    wanted = made.error - made.epoch.innovation.in_position.residual
    made.resolve(Decision(np.ones(2, dtype=bool), reset=np.full(2, 9.0)))
    np.testing.assert_allclose(made.error, wanted, atol=1e-3)
    np.testing.assert_allclose(made.navigator.position_covariance, np.tile(9.0 * np.eye(3), (2, 1, 1)))


def test_shared_gains_refuse_to_leave_ranges_out():
    made = simulation(2, demands=Demands())
    with pytest.raises(ValueError, match="covariance per run"):
        made.resolve(Decision(np.array([True, False])))


def test_a_backtrack_without_a_history_is_refused():
    made = simulation(2, demands=Demands(excludes=True))
    with pytest.raises(ValueError, match="history"):
        made.resolve(Decision(np.ones(2, dtype=bool), backtrack=np.array([3, 0])))


@pytest.mark.parametrize("hour", [2.0, 8.9])
def test_satellites_rise_and_set_along_the_way(hour):
    """In half a minute one rises, or one rises and one sets; innovations stay matched through it (interval of 1e-9)."""
    scenario = make_scenario(f"kujur-flight:onset=60,horizon=60,hour={hour}")
    dynamics = scenario.tight_model().dynamics
    assert dynamics.started[1:].any()
    counts = dynamics.present.sum(axis=1)
    assert counts.min() < counts.max() <= scenario.slots
    around = np.flatnonzero(dynamics.started.any(axis=1) | (np.diff(counts, prepend=counts[0]) != 0))
    made = simulation(60, demands=Demands(), scenario=scenario)
    total = degrees = 0.0
    for k in range(1, int(around[-1]) + 3):
        made.resolve()
        innovation = made.observe().innovation
        assert (innovation.degrees == 2 * counts[k]).all()
        if (np.abs(around - k) <= 2).any():
            total, degrees = total + innovation.nis.sum(), degrees + innovation.degrees.sum()
    assert stats.chi2.ppf(5e-10, degrees) < total < stats.chi2.ppf(1.0 - 5e-10, degrees)


def test_position_domain_is_generalised_least_squares():
    innovation = simulation(4).epoch.innovation
    part = innovation.in_position
    for run in range(4):
        response, whitened = innovation.response[run], innovation.whitened[run]
        found, *_ = np.linalg.lstsq(response, whitened, rcond=None)
        np.testing.assert_allclose(part.residual[run], found, rtol=1e-9)
        np.testing.assert_allclose(part.covariance[run] @ (response.T @ response), np.eye(3), atol=1e-9)
        factor = np.linalg.cholesky(part.covariance[run])
        np.testing.assert_allclose(factor @ part.whitened[run], found, rtol=1e-9)
        assert part.nis[run] == pytest.approx(part.whitened[run] @ part.whitened[run])
