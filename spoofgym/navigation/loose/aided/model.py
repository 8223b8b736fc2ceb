"""The game of an aided filter in the linear fidelity: gains of fixes and aids along the truth, everything used."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation import kalman
from spoofgym.navigation.aids.aid_set import AidSet
from spoofgym.navigation.aids.kernels import form
from spoofgym.navigation.error_model import NUM_INERTIAL, NUM_NAVIGATION
from spoofgym.navigation.linear_model import LinearModel, semidefinite_factor
from spoofgym.navigation.loose.aided.dynamics import AidedDynamics
from spoofgym.timeline import Timeline


class AidGains(NamedTuple):
    """Of every measurement of an aid, where all are used: L, (B, R, R), and U' = L⁻¹ H P, (B, R, n)."""

    factor: Floats
    gain: Floats


class Steps(NamedTuple):
    """The arrays that kernels carry errors with; leading axis: steps S.

    Attributes:
        per_epoch: U, steps of an epoch.
        transition_columns: the first nine rows of Φ, stored by columns, (S, 15, 9).
        noise_columns: factor of the true noise, stored by columns, (S, 9, 9).
        walk: of the states of the aids in a step, (a,).
        transition: the first nine rows of Φ, (S, 9, 15).
        process_noise: the filter's Q, (S, n, n).
    """

    per_epoch: int
    transition_columns: Floats
    noise_columns: Floats
    walk: Floats
    transition: Floats
    process_noise: Floats


class Measurements(NamedTuple):
    """Those of all aids in their order, as kernels take them.

    Attributes:
        first: measurements first[s]..first[s+1]-1 come after step s, (S + 1,).
        aid: which aid each is of, (B,).
        observation: H, (B, R, n).
        rows: r of each aid, (A,).
        first_row: of each aid among all, (A,).
        sigma: of the noise of each aid, (A, R).
        limit: normalised innovation squared above which a measurement of each aid is left out, (A,).
    """

    first: Runs
    aid: Runs
    observation: Floats
    rows: Runs
    first_row: Runs
    sigma: Floats
    limit: Floats


@dataclass(frozen=True)
class AidedModel(LinearModel):
    """A game of an aided filter: epochs k = 0..K.

    Φ is what an epoch without any noise makes of an error, the corrections by the aids included: x⁻ = Φ x after the fix
    before. It changes all states, so that its `transition_columns` have all rows. Q is what noise of inertial unit and
    aids adds, P⁻ - Φ P Φ'. `noise_factor` is not used: the true noise stands in `aid_steps`.

    Attributes:
        aids: of the filter.
        aid_steps: what errors are carried with.
        measurements: of the aids.
        aid_gains: of these, everything used.
    """

    aids: AidSet
    aid_steps: Steps
    measurements: Measurements
    aid_gains: AidGains

    @cached_property
    def transition_columns(self) -> Floats:
        """Φ, stored by columns, (K+1, n, n)."""
        return np.ascontiguousarray(self.transition.transpose(0, 2, 1))


def measurements_of(dynamics: AidedDynamics, aids: AidSet) -> Measurements:
    """The measurements of the aids, as kernels take them."""
    sigma = np.zeros((len(aids.aids), aids.most_rows))
    for j, aid in enumerate(aids.aids):
        sigma[j, : aid.dimension] = aid.noise
    return Measurements(
        dynamics.first_measurement,
        dynamics.aid,
        dynamics.aid_observation,
        np.array([aid.dimension for aid in aids.aids]),
        np.array(aids.first_row),
        sigma,
        np.array([aid.limit(aids.usual_gate) for aid in aids.aids]),
    )


class AidedFilter:
    """The covariance of a filter that uses everything, carried step by step.

    Attributes:
        covariance: P, (n, n).
        closed: what was made of an error since `begin`, (n, n).
    """

    def __init__(self, dynamics: AidedDynamics, measurements: Measurements, covariance: Floats) -> None:
        """Begin before the first step of the dynamics, with P = ``covariance``."""
        count, rows, n = dynamics.aid_observation.shape
        self.covariance = covariance.copy()
        self.closed = np.eye(n)
        self.gains = AidGains(np.zeros((count, rows, rows)), np.zeros((count, rows, n)))
        self._dynamics, self._measurements = dynamics, measurements
        self._work = np.empty((NUM_NAVIGATION, n))

    def begin(self) -> None:
        """Begin an epoch."""
        self.closed = np.eye(len(self.covariance))

    def predict(self, step: int) -> None:
        """P <- Φ P Φ' + Q."""
        transition = self._dynamics.steps.transition[step]
        kalman.predict_covariance(transition, self._dynamics.filter_noise(step), self.covariance, self._work)
        self.closed[:NUM_INERTIAL] = transition @ self.closed[:NUM_INERTIAL]

    def of_step(self, step: int) -> range:
        """The measurements that come after a step."""
        first = self._measurements.first
        return range(int(first[step]), int(first[step + 1]))

    def correct(self, number: int) -> tuple[Floats, Floats, Floats]:
        """Use a measurement; its H (r, n), its gain K (n, r) and the variance of its noise, (r,)."""
        measurements, gains = self._measurements, self.gains
        aid = measurements.aid[number]
        rows = int(measurements.rows[aid])
        observation = measurements.observation[number, :rows]
        variance = measurements.sigma[aid, :rows] ** 2
        n = len(self.covariance)
        factor, gain, cross = np.empty((rows, rows)), np.empty((rows, n)), np.empty((rows, n))
        form(self.covariance, observation, variance, cross, factor, gain)
        kalman.update_covariance(gain, self.covariance)
        gains.factor[number, :rows, :rows], gains.gain[number, :rows] = factor, gain
        kalman_gain = np.asarray(np.linalg.solve(factor.T, gain).T, np.float64)
        self.closed = self.closed - kalman_gain @ (observation @ self.closed)
        return observation, kalman_gain, variance


def aided_model(
    dynamics: AidedDynamics, aids: AidSet, prior_covariance: Floats, measurement_covariance: Floats, timeline: Timeline
) -> AidedModel:
    """The game on epochs 0..K of ``dynamics``, every fix and every measurement of an aid used.

    Args:
        dynamics: of the K+1 epochs of the game.
        aids: of the filter.
        prior_covariance: the filter's P after epoch -1, (n, n).
        measurement_covariance: the filter's R of a fix, (m, m).
        timeline: of the game.
    """
    (epochs, m, _), n = dynamics.observation.shape, dynamics.num_states
    measurements = measurements_of(dynamics, aids)
    state = AidedFilter(dynamics, measurements, prior_covariance)
    transition, noise, prior = np.empty((epochs, n, n)), np.empty((epochs, n, n)), np.empty((epochs, n, n))
    factor, innovation = np.empty((epochs, m, m)), np.empty((epochs, m, m))
    gain, cross = np.empty((epochs, m, n)), np.empty((m, n))
    for k in range(epochs):
        before = state.covariance.copy()
        state.begin()
        for step in range(k * dynamics.per_epoch, (k + 1) * dynamics.per_epoch):
            state.predict(step)
            for number in state.of_step(step):
                state.correct(number)
        prior[k], transition[k] = state.covariance, state.closed
        added = prior[k] - transition[k] @ before @ transition[k].T
        noise[k] = 0.5 * (added + added.T)
        kalman.innovation_covariance(
            state.covariance, dynamics.observation[k], measurement_covariance, cross, innovation[k]
        )
        kalman.cholesky(innovation[k], factor[k])
        kalman.whitened_gain(cross, factor[k], gain[k])
        kalman.update_covariance(gain[k], state.covariance)
    return AidedModel(
        time=timeline.times,
        transition=transition,
        process_noise=noise,
        noise_factor=np.zeros((epochs, NUM_NAVIGATION, NUM_NAVIGATION)),
        observation=dynamics.observation,
        measurement_covariance=measurement_covariance,
        prior_covariance=prior_covariance,
        covariance=prior,
        innovation_covariance=innovation,
        innovation_factor=factor,
        whitened_gain=gain,
        aids=aids,
        aid_steps=_steps(dynamics),
        measurements=measurements,
        aid_gains=state.gains,
    )


def _steps(dynamics: AidedDynamics) -> Steps:
    steps = dynamics.steps
    factor = np.array([semidefinite_factor(noise) for noise in steps.true_noise])
    return Steps(
        dynamics.per_epoch,
        np.ascontiguousarray(steps.transition[:, :NUM_NAVIGATION].transpose(0, 2, 1)),
        np.ascontiguousarray(factor.transpose(0, 2, 1)),
        dynamics.walk,
        np.ascontiguousarray(steps.transition[:, :NUM_NAVIGATION]),
        np.array([dynamics.filter_noise(step) for step in range(len(steps.transition))]),
    )
