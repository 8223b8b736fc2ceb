"""The self-tuning filter against a plain reading of eqs 8-13, its guards, exclusion and backtracking."""

import dataclasses

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.navigation.loose.adaptation import Adaptation, NegativeRatioError
from spoofgym.navigation.loose.adaptive import AdaptiveNavigator, AdaptiveStrapdownNavigator
from spoofgym.parallel import RunSlices
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.imu import ImuGrade
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams

FIDELITIES = ("linear", "strapdown")
EXCLUDES = Demands(excludes=True)
ATTACK = "ramp:4,direction=45,onset=15"
STILL = ImuGrade(
    name="still",
    gyro_bias=0.01,
    gyro_random_walk=0.0,
    gyro_instability=0.0,
    accelerometer_bias=100.0,
    accelerometer_random_walk=0.0,
    accelerometer_instability=0.0,
    correlation_time=3600.0,
    source="none: an IMU without noise, so that both fidelities meet the same",
)


def flight(adaptation, noise="white", **changes):
    return make_scenario(f"shadmehri-flight:noise={noise}").changed(adaptation=adaptation, **changes)


class Oracle:
    """One run of eqs 8-13 as they are printed, with H, K and lists; the guards by their docstrings."""

    def __init__(self, adaptation, model):
        self.adaptation, self.model = adaptation, model
        self.P, self.R, self.scale = model.prior_covariance, model.measurement_covariance, 1.0
        self.v, self.gamma = [], []

    def step(self, k, z, used=True):
        """Predict to epoch k, test z and use it; the NIS and the correction of the error state."""
        m, a = len(z), self.adaptation
        H = np.zeros((m, 15))
        H[:, :9] = self.model.observation[k]
        phi = self.model.transition[k]
        prior = phi @ self.P @ phi.T + self.scale * self.model.process_noise[k]
        S = H @ prior @ H.T + self.R
        nis = z @ np.linalg.solve(S, z)
        self.P = prior
        if not used:
            return nis, np.zeros(15)
        K = prior @ H.T @ np.linalg.inv(S)
        self.P = (np.eye(15) - K @ H) @ prior
        if not (a.has("frozen") and nis > a.threshold):
            self.v.append(z - H @ K @ z)
            self.gamma.append(z)
            end = len(self.v) - (a.lag if a.has("lagged") else 0)
            if end >= a.window:
                self.renew(slice(end - a.window, end), H @ prior @ H.T, H @ self.P @ H.T)
        return nis, -K @ z

    def renew(self, window, prior, post):
        a, initial = self.adaptation, self.model.measurement_covariance
        self.R = np.mean([np.outer(v, v) for v in self.v[window]], axis=0) + post
        if a.has("bounded"):
            wanted = np.sqrt(np.diag(self.R))
            low, high = (limit * np.sqrt(np.diag(initial)) for limit in a.noise_limits)
            factor = np.diag(np.clip(wanted, low, high) / wanted)
            self.R = factor @ self.R @ factor
        matched = np.mean([np.outer(g, g) for g in self.gamma[window]], axis=0)
        alpha = np.trace(matched - self.R) / np.trace(prior)
        if a.has("clipped"):
            alpha = np.clip(alpha, *a.ratio_limits)
        elif a.has("non-cumulative"):
            alpha = max(alpha, 0.0)
        elif alpha <= 0.0:
            return
        self.scale = np.sqrt(alpha) * (1.0 if a.has("non-cumulative") else self.scale)
        if a.has("clipped") or a.has("non-cumulative"):
            self.scale = np.clip(self.scale, *a.scale_limits)


@pytest.mark.parametrize(
    ("guard", "noise"),
    [
        *[(guard, "markov") for guard in ("hold", "non-cumulative", "clipped", "lagged", "frozen", "bounded")],
        *[(guard, noise) for guard in ("clipped+bounded", "all") for noise in ("white", "markov")],
    ],
)
def test_equals_a_plain_reading_of_the_equations(guard, noise):
    """The attack makes the test alarm; every ninth fix is left out."""
    adaptation = Adaptation(window=20, guard=guard, lag=15, threshold=9.0)
    scenario = flight(adaptation, noise)
    simulation = Simulation(scenario, make_attack(ATTACK), (), None, 2, 5, demands=EXCLUDES)
    epoch, run = simulation.reset(), 1
    navigator = simulation.navigator
    assert isinstance(navigator, AdaptiveNavigator)
    oracle = Oracle(adaptation, navigator.model)
    for k in range(250):
        used = k % 9 != 4
        nis, correction = oracle.step(k, epoch.innovation.residual[run], used)
        np.testing.assert_allclose(epoch.innovation.nis[run], nis, rtol=1e-9, atol=1e-9)
        before = navigator.state[run].copy()
        simulation.resolve(Decision(np.full(2, used)))
        moved = navigator.state[run] - before
        np.testing.assert_allclose(moved, correction, rtol=1e-8, atol=1e-11)
        np.testing.assert_allclose(navigator.tuned.noise[run], oracle.R, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(navigator.tuned.scale[run], oracle.scale, rtol=1e-8)
        np.testing.assert_allclose(navigator.covariance[run], oracle.P, rtol=1e-8, atol=1e-12)
        epoch = simulation.observe()
    assert navigator.tuned.count[run] == len(oracle.v)


def course(scenario, runs, seed=0, fidelity="linear", threads=1, attack=None, epochs=250, demands=EXCLUDES):
    """NIS of each epoch (K, N), and the simulation after it."""
    attack = None if attack is None else make_attack(attack)
    simulation = Simulation(scenario, attack, (), None, runs, seed, fidelity=fidelity, threads=threads, demands=demands)
    rows = [simulation.reset().innovation.nis.copy()]
    for _ in range(epochs):
        simulation.resolve()
        rows.append(simulation.observe().innovation.nis.copy())
    return np.array(rows), simulation


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_before_the_windows_are_full_it_is_the_common_filter(fidelity):
    own, one = course(flight(Adaptation(window=1000)), 3, fidelity=fidelity, attack=ATTACK)
    common, other = course(flight(None), 3, fidelity=fidelity, attack=ATTACK)
    np.testing.assert_array_equal(own, common)
    np.testing.assert_array_equal(one.error, other.error)


def test_the_published_recursion_ends_where_alpha_is_negative_and_says_what_to_choose():
    """Under correlated noise 400 runs of 400 have met α < 0 by 20 s; of 16 here, one is enough."""
    scenario = flight(Adaptation(), "markov")
    simulation = Simulation(scenario, None, (), None, 16, 0)
    simulation.reset()

    def go_on():
        for _ in range(250):
            simulation.resolve()
            simulation.observe()

    with pytest.raises(NegativeRatioError, match=r"run \d+, epoch \d+ at .* alpha = -.* choose a guard: hold"):
        go_on()
    assert issubclass(NegativeRatioError, FloatingPointError)
    for part in (simulation.navigator.tuned.noise, simulation.navigator.tuned.scale, simulation.navigator.covariance):
        assert np.isfinite(part).all()


@pytest.mark.parametrize("noise", ["white", "markov"])
def test_the_least_guard_changes_nothing_until_then(noise):
    pair = [Simulation(flight(Adaptation(guard=guard), noise), None, (), None, 3, 1) for guard in ("none", "hold")]
    for simulation in pair:
        simulation.reset()
    for _ in range(250):
        try:
            pair[0].resolve()
        except NegativeRatioError:
            break
        pair[1].resolve()
        one, other = (simulation.observe().innovation.nis for simulation in pair)
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("guard", ["hold", "all"])
@pytest.mark.parametrize("noise", ["white", "markov"])
def test_nothing_becomes_nan_under_an_attack(guard, noise):
    nis, simulation = course(flight(Adaptation(guard=guard, window=10), noise), 64, attack=ATTACK, epochs=298)
    assert np.isfinite(nis).all()
    assert np.isfinite(simulation.error).all()


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_run_does_not_depend_on_the_others_or_the_threads(fidelity):
    runs = 300 if fidelity == "linear" else 6
    scenario = flight(Adaptation(guard="all", window=10, lag=5))
    many, _ = course(scenario, runs, 3, fidelity, threads=2, attack=ATTACK, epochs=200)
    alone, _ = course(scenario, 1, 3 + runs - 2, fidelity, attack=ATTACK, epochs=200)
    np.testing.assert_array_equal(many[:, runs - 2], alone[:, 0])


@pytest.mark.parametrize("guard", ["hold", "non-cumulative", "all"])
def test_both_fidelities_tune_themselves_alike(guard):
    """An IMU without noise: biases, initial errors and receiver noise are common, and what differs is second order.

    Bounds: a centimetre of the error, and the thousandth part of what is learnt in 25 s, wound up or not.
    """
    scenario = flight(Adaptation(guard=guard), grade=STILL, true_position_random_walk=0.0)
    (one, first), (other, second) = (course(scenario, 4, 2, fidelity, attack=ATTACK) for fidelity in FIDELITIES)
    assert isinstance(second.navigator, AdaptiveStrapdownNavigator)
    assert (np.abs(one - other) / (1.0 + one)).max() < 0.002
    assert np.abs(first.error - second.error).max() < 0.01
    np.testing.assert_allclose(first.navigator.tuned.noise, second.navigator.tuned.noise, rtol=1e-3, atol=0.02)
    np.testing.assert_allclose(first.navigator.tuned.scale, second.navigator.tuned.scale, rtol=1e-3)


@pytest.mark.parametrize("share", [0.5, 1.0, 1.5])
def test_r_follows_the_noise_of_the_receiver(share):
    """The mean over 400 runs of a variance matched to 50 fixes has a relative deviation of √(2 / 50 / 400) = 1 %.

    A tenth is ten of them; what Q makes of the mean is within it.
    """
    base = flight(Adaptation(guard="non-cumulative"))
    sigma = tuple(share * value for value in base.family.receiver.white_sigma)
    scenario = base.changed(receiver=dataclasses.replace(base.family.receiver, white_sigma=sigma))
    _, simulation = course(scenario, 400, epochs=150)
    learnt = np.diagonal(simulation.navigator.tuned.noise.mean(axis=0))
    np.testing.assert_allclose(learnt, np.square(sigma), rtol=0.1)


def test_an_attack_raises_the_r_by_which_it_is_tested_unless_the_windows_lag():
    """R of a run has a relative deviation of √(2 / 50) = 20 %, the median of 64 runs one of 3 %.

    The spoofed one is more than twice the clean one, the lagged one is no other: both bounds are six deviations away.
    """
    late = "ramp:4.3,direction=45,onset=20"

    def learnt(guard, attack):
        _, simulation = course(flight(Adaptation(guard=guard)), 64, attack=attack)
        return np.median(simulation.navigator.tuned.noise[:, 0, 0])

    clean, spoofed, lagged = learnt("hold", None), learnt("hold", late), learnt("lagged+non-cumulative", late)
    assert spoofed > 1.6 * clean
    assert lagged < 1.3 * clean


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_fix_left_out_or_reset_to_does_not_enter_the_windows(fidelity):
    simulation = Simulation(
        flight(Adaptation(window=5, guard="hold")), None, (), None, 3, 0, fidelity=fidelity, demands=EXCLUDES
    )
    simulation.reset()
    use, reset = np.array([True, False, True]), np.array([0.0, 0.0, 9.0])
    for _ in range(10):
        simulation.resolve(Decision(use, reset=reset))
        simulation.observe()
    tuned = simulation.navigator.tuned
    assert tuned.count.tolist() == [10, 0, 0]
    initial = simulation.scenario.family.tuning.measurement_covariance
    assert not np.array_equal(tuned.noise[0], initial)
    np.testing.assert_array_equal(tuned.noise[1:], np.stack([initial, initial]))


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_fixes_taken_back_are_as_if_they_had_been_left_out(fidelity):
    """Windows, R and Q are taken back, too; twice, the second time into the stretch that has been recomputed."""
    depths, at, runs = np.array([0, 3, 11, 20]), 60, 4
    scenario = flight(Adaptation(window=10, guard="all", lag=4))

    def play(decide):
        demands = Demands(excludes=True, history=20)
        simulation = Simulation(
            scenario, make_attack("ramp:4,direction=45,onset=3"), (), None, runs, 7, fidelity=fidelity, demands=demands
        )
        simulation.reset()
        rows = []
        for k in range(100):
            simulation.resolve(decide(k))
            tuned = simulation.navigator.tuned
            rows.append((*simulation.error.ravel(), *tuned.noise.ravel(), *tuned.scale, *tuned.count))
            simulation.observe()
        return np.array(rows)

    def back(k):
        depth = depths if k == at else np.full(runs, 8) if k == at + 6 else np.zeros(runs, dtype=int)
        return Decision(np.full(runs, k < at or k > at + 6), backtrack=depth)

    def out(k):
        # 8 epochs back from the second time is 2 epochs before the first
        return Decision((k < at - np.maximum(depths, 2)) | (k > at + 6))

    np.testing.assert_array_equal(play(back)[at + 6 :], play(out)[at + 6 :])


def test_a_new_episode_has_learnt_nothing():
    scenario = flight(Adaptation(window=5, guard="hold"))
    navigator = scenario.family.navigator("linear", EXCLUDES, 0, 2, RunSlices(1))
    runs, streams = np.arange(2), RunStreams.from_seed(0, 2)
    for _ in range(2):
        initial = scenario.family.draw_initial(runs, 0, streams)
        navigator.reset(runs, initial, streams)
        assert navigator.tuned.count.tolist() == [0, 0]
        assert navigator.tuned.scale.tolist() == [1.0, 1.0]
        np.testing.assert_array_equal(navigator.tuned.noise[1], scenario.family.tuning.measurement_covariance)
        for _ in range(8):
            navigator.propagate()
            navigator.innovate(np.full((2, 3), 4.0))
            navigator.resolve(Decision(np.ones(2, dtype=bool)))
        assert navigator.tuned.count.tolist() == [8, 8]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"window": 0}, "window must be a whole number, 1 or more, got 0"),
        ({"lag": -1}, "lag must be a whole number"),
        ({"guard": "some"}, "guard must be one of none, hold, non-cumulative"),
        ({"guard": "none+clipped"}, "'none' cannot be joined"),
        ({"threshold": 0.0}, "threshold must be a finite number greater than 0"),
        ({"ratio_limits": (4.0, 0.25)}, "ratio_limits must be two positive numbers, least first"),
        ({"noise_limits": (0.0, 2.0)}, "noise_limits must be a finite number greater than 0, got 0.0"),
    ],
)
def test_wrong_settings_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Adaptation(**arguments)
