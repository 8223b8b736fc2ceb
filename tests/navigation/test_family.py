"""A filter is a folder: one with a sixteenth state, made here, plays in a simulation like any other."""

from dataclasses import dataclass, fields

import numpy as np
import pytest

from spoofgym.burn_in_cache import kept_by_burn_in
from spoofgym.detectors import make_detector
from spoofgym.navigation.facts import INERTIAL_SOLUTION
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.navigation.linear_model import ErrorDynamics, linear_model
from spoofgym.navigation.loose.family import LooseFamily
from spoofgym.navigation.loose.own_gains import OwnCovarianceNavigator
from spoofgym.navigation.loose.shared_gains import LinearNavigator
from spoofgym.navigation.loose.warm_start import ERROR
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams

BASE = "liu-flight:horizon=30,onset=300"
BARO, UP, RUNS, EPOCHS = 15, 8, 3, 24


class Biased:
    """What a navigator starts with: the error of the barometer's bias beside the other states."""

    def reset(self, runs, initial, streams):
        super().reset(runs, initial[:, :-1], streams)
        self.state[runs, BARO] = initial[:, -1]


class SharedGains(Biased, LinearNavigator):
    """Every run uses every measurement."""


class OwnGains(Biased, OwnCovarianceNavigator):
    """Every run has a covariance of its own."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BarometerFamily(LooseFamily):
    """A loosely coupled filter that measures a height, too, and estimates its constant bias: n = 16, m = 4."""

    bias: float = 20.0
    noise: float = 0.5

    num_states, dimension = 16, 4
    measures_velocity, measurement = False, "fixes and heights"
    fidelities, offers = ("linear",), (INERTIAL_SOLUTION,)

    def epochs(self, first, last):
        """The observation of the height, and a state that stays."""
        inertial, count = super().epochs(first, last), last - first
        transition, noise = np.tile(np.eye(16), (count, 1, 1)), np.zeros((count, 16, 16))
        observation = np.zeros((count, 4, 16))
        transition[:, :15, :15], noise[:, :15, :15] = inertial.transition, inertial.process_noise
        observation[:, :3, :9] = inertial.observation
        observation[:, 3, [UP, BARO]] = 1.0
        return ErrorDynamics(transition, noise, inertial.true_noise, observation)

    @kept_by_burn_in
    def warm_start(self, burn_in=0):
        """That of the filter on fixes: the barometer is switched on just before the game."""
        plain = {item.name: getattr(self, item.name) for item in fields(LooseFamily)}
        return LooseFamily(**plain).warm_start(burn_in)

    @kept_by_burn_in
    def linear_model(self, burn_in=0):
        """The game with the barometer."""
        first, timeline = self.truth.first(burn_in), self.truth.timeline_from(burn_in)
        prior = np.zeros((16, 16))
        prior[:15, :15], prior[BARO, BARO] = self.warm_start(burn_in).filter_covariance, self.bias**2
        noise = np.diag(np.square([*self.tuning.measurement_sigma, self.noise]))
        return linear_model(self.epochs(first, first + timeline.num_epochs + 1), prior, noise, timeline)

    def navigator(self, fidelity, demands, burn_in, num_runs, slices):
        """In the linear fidelity."""
        kind = OwnGains if demands.excludes else SharedGains
        return kind(self.linear_model(burn_in), self.grade, self.truth.interval, num_runs, slices, demands)

    def draw_initial(self, runs, burn_in, streams):
        """The error of the bias comes last."""
        bias = [[self.bias * streams(run, "initial").standard_normal()] for run in runs]
        return np.hstack([super().draw_initial(runs, burn_in, streams), bias])

    def draw_receiver_noise(self, runs, initial, burn_in, streams):
        """Of the fixes, then of the heights."""
        count = burn_in + self.truth.horizon + 1
        height = [self.noise * streams(run, "receiver").standard_normal((count, 1)) for run in runs]
        fixes = [self.tuning.measurement_sigma * streams(run, "receiver").standard_normal((count, 3)) for run in runs]
        return np.concatenate([fixes, height], axis=2)

    def spoofed(self, fidelity, index, burn_in, spoof):
        """Nobody spoofs the pressure of the air."""
        return np.hstack([spoof.offset, np.zeros((len(index), 1))])


@pytest.fixture(scope="module")
def scenario():
    base = make_scenario(BASE)
    plain = {item.name: getattr(base.family, item.name) for item in fields(LooseFamily)}
    return Scenario(family=BarometerFamily(**plain), drag_off_rate=base.drag_off_rate, error_scale=base.error_scale)


def by_matrices(model, start, normals, deviations, used):
    """One run of the filter as it is printed, from epoch 0 to the last of ``deviations``: state, P before, NIS, P."""
    x, P, R = start.copy(), model.prior_covariance, model.measurement_covariance
    for k, (d, use) in enumerate(zip(deviations, used, strict=True)):
        F, H, w = model.transition[k], model.observation[k], np.zeros(16)
        w[:9] = model.noise_factor[k] @ normals[k]
        x, P = F @ x + w, F @ P @ F.T + model.process_noise[k]
        S, z = H @ P @ H.T + R, H @ x - d
        nis = z @ np.linalg.solve(S, z)
        if use:
            K = P @ H.T @ np.linalg.inv(S)
            x, P = x - K @ z, (np.eye(16) - K @ H) @ P @ (np.eye(16) - K @ H).T + K @ R @ K.T
    return x, P, nis


def test_exclusions_and_backtracks_are_those_of_sixteen_states_by_matrices(scenario):
    simulation = Simulation(
        scenario, None, [make_detector("windowed:n=5,p_fa=1e-9")], None, RUNS, 11, demands=Demands(True, history=8)
    )
    navigator, model = simulation.navigator, scenario.linear_model()
    assert navigator.state.shape == (RUNS, 16)
    simulation.reset()
    normals, deviations = navigator.normals.copy(), simulation._noise.copy()
    initial = scenario.family.draw_initial(np.arange(RUNS), 0, RunStreams.from_seed(11, RUNS))
    starts, used = np.hstack([initial[:, ERROR], initial[:, -1:]]), np.zeros((RUNS, 0), dtype=bool)
    for k in range(EPOCHS):
        use = np.array([True, k % 4 != 2, not 9 <= k < 14])
        depth = np.array([0, 0, 6 if k == 9 else 0])
        nis = simulation.epoch.innovation.nis.copy()
        for run in range(RUNS):
            mask = np.append(used[run], False)
            _, _, expected = by_matrices(model, starts[run], normals[run], deviations[run, : k + 1], mask)
            assert nis[run] == pytest.approx(expected, rel=1e-6)
        used[2, k - depth[2] : k] = False
        used = np.column_stack([used, use])
        simulation.resolve(Decision(use, depth))
        for run in range(RUNS):
            x, P, _ = by_matrices(model, starts[run], normals[run], deviations[run, : k + 1], used[run])
            np.testing.assert_allclose(navigator.state[run], x, rtol=1e-6, atol=1e-9)
            np.testing.assert_allclose(np.diag(navigator.covariance[run]), np.diag(P), rtol=1e-6)
        offset = np.tile([0.0, 2.0 * k, 0.0], (RUNS, 1))
        simulation.observe(offset)
        deviations[:, k + 1, :3] += offset
