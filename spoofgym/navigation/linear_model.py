"""The error state along a true trajectory, one step per GNSS epoch: Φ, Q, H, gains.

Liu 2018, section 4.1: a spoofing offset of kilometres changes Φ and the gain by less than 1e-3, so they can be computed
once along the truth and serve every run. The transition is the product over the IMU samples of the epoch, not a series
in the epoch's length.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.immutable import Immutable
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.error_model import NUM_INERTIAL, NUM_NAVIGATION, navigation_dynamics, transition_matrix
from spoofgym.navigation.tuning import FilterTuning, true_noise_density
from spoofgym.sensors.imu import ImuGrade
from spoofgym.sensors.receiver import Receiver
from spoofgym.timeline import Timeline
from spoofgym.trajectory import Trajectory


@dataclass(frozen=True)
class ErrorDynamics:
    """What the trajectory makes of an error, epoch by epoch; leading axis: epochs.

    Attributes:
        transition: Φ from the epoch before, (E, 15, 15).
        process_noise: the filter's Q, (E, 15, 15).
        true_noise: covariance of the white noise that really acts on attitude, velocity and position, (E, 9, 9).
        observation: H on the nine navigation states, (E, m, 9).
    """

    transition: Floats
    process_noise: Floats
    true_noise: Floats
    observation: Floats


class LinearSteps(NamedTuple):
    """The arrays of a `LinearModel` that kernels carry runs with; leading axis: epochs.

    Attributes:
        transition_columns: the first nine rows of Φ, stored by columns, (K+1, n, 9).
        transition: Φ, (K+1, n, n).
        process_noise: the filter's Q, (K+1, n, n).
        noise_columns: the factor of the true noise, stored by columns, (K+1, 9, 9).
    """

    transition_columns: Floats
    transition: Floats
    process_noise: Floats
    noise_columns: Floats


@dataclass(frozen=True)
class LinearModel(Immutable):
    """A game in the linear fidelity: epochs k = 0..K, of which 0 is the last clean one.

    Attributes:
        time: of the epochs, (K+1,), s.
        transition: Φ from epoch k-1 to k, (K+1, 15, 15).
        process_noise: the filter's Q of that step, (K+1, 15, 15).
        noise_factor: lower Cholesky factor of the true noise on attitude, velocity and position, (K+1, 9, 9).
        observation: H on the nine navigation states, (K+1, m, 9).
        measurement_covariance: the filter's R, (m, m).
        prior_covariance: the filter's P after epoch -1, (15, 15).
        covariance: the filter's P at epoch k before the fix, every fix used, (K+1, 15, 15).
        innovation_covariance: S, (K+1, m, m).
        innovation_factor: lower L with S = L L', (K+1, m, m).
        whitened_gain: U' = L⁻¹ H P, so that the gain is U L⁻¹, (K+1, m, 15).
    """

    time: Floats
    transition: Floats
    process_noise: Floats
    noise_factor: Floats
    observation: Floats
    measurement_covariance: Floats
    prior_covariance: Floats
    covariance: Floats
    innovation_covariance: Floats
    innovation_factor: Floats
    whitened_gain: Floats

    @property
    def dimension(self) -> int:
        """m, of the fix."""
        return self.observation.shape[1]

    @cached_property
    def transition_columns(self) -> Floats:
        """The first nine rows of each Φ, stored by columns, (K+1, 15, 9)."""
        return np.ascontiguousarray(self.transition[:, :NUM_NAVIGATION].transpose(0, 2, 1))

    @cached_property
    def noise_columns(self) -> Floats:
        """Each noise factor, stored by columns, (K+1, 9, 9)."""
        return np.ascontiguousarray(self.noise_factor.transpose(0, 2, 1))

    @cached_property
    def steps(self) -> LinearSteps:
        """What kernels carry runs with."""
        return LinearSteps(self.transition_columns, self.transition, self.process_noise, self.noise_columns)

    @property
    def num_states(self) -> int:
        """n, of the filter."""
        return self.transition.shape[1]

    @property
    def num_epochs(self) -> int:
        """K."""
        return len(self.time) - 1


def error_dynamics(
    trajectory: Trajectory,
    grade: ImuGrade,
    receiver: Receiver,
    tuning: FilterTuning,
    true_position_random_walk: float,
    num_epochs: int,
) -> ErrorDynamics:
    """Φ, Q and H from the start of the trajectory over ``num_epochs`` GNSS epochs.

    Args:
        trajectory: the truth, sampled at the IMU rate.
        grade: of the IMU.
        receiver: gives the epochs, the lever arm and the latency.
        tuning: gives the filter's process noise.
        true_position_random_walk: what really acts on the position, m/√s.
        num_epochs: E.

    Returns:
        Arrays of E epochs; the first ends one interval after the start.
    """
    samples = receiver.samples_per_fix(trajectory.rate)
    filter_density = np.diag(tuning.noise_density(grade))
    true_density = np.zeros((NUM_INERTIAL, NUM_INERTIAL))
    np.fill_diagonal(true_density[:NUM_NAVIGATION], true_noise_density(grade, true_position_random_walk))
    transition = np.empty((num_epochs, NUM_INERTIAL, NUM_INERTIAL))
    densities = np.stack([filter_density, true_density]) / trajectory.rate
    if np.array_equal(*densities):
        densities = densities[:1]
    noise = np.empty((len(densities), num_epochs, NUM_INERTIAL, NUM_INERTIAL))
    motion = Motion(trajectory.attitude, trajectory.velocity, trajectory.position, trajectory.specific_force)
    _accumulate(motion, 1.0 / trajectory.rate, samples, densities, transition, noise)
    ends = samples * np.arange(1, num_epochs + 1)
    observation = observation_matrices(trajectory, receiver, ends)
    return ErrorDynamics(transition, noise[0], noise[-1, :, :NUM_NAVIGATION, :NUM_NAVIGATION], observation)


def observation_matrices(trajectory: Trajectory, receiver: Receiver, samples: np.ndarray) -> Floats:
    """H on the nine navigation states at IMU samples, (E, m, 9).

    The antenna sits at the lever arm l and the fix is τ old: z = δp + (C l) x φ - τ δv, and with velocity z_v = δv - τ
        f x φ.
    """
    attitude = trajectory.attitude[samples]
    arm = antenna_arm(attitude, receiver)
    observation = np.zeros((len(samples), receiver.dimension, NUM_NAVIGATION))
    observation[:, :3, 0:3] = _cross(arm)
    observation[:, range(3), range(3, 6)] = -receiver.latency
    observation[:, range(3), range(6, 9)] = 1.0
    if receiver.dimension == 6:
        force = np.einsum("eij,ej->ei", attitude, trajectory.specific_force[samples - 1])
        observation[:, 3:, 0:3] = -receiver.latency * _cross(force)
        observation[:, range(3, 6), range(3, 6)] = 1.0
    return observation


def antenna_arm(attitude: Floats, receiver: Receiver) -> Floats:
    """C l, the lever arm in ENU for attitudes (E, 3, 3), (E, 3), m."""
    return np.einsum("eij,j->ei", attitude, np.array(receiver.lever_arm, dtype=np.float64))


def _cross(vectors: Floats) -> Floats:
    """Cross-product matrices [v x], (E, 3, 3)."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)


def linear_model(
    dynamics: ErrorDynamics, prior_covariance: Floats, measurement_covariance: Floats, timeline: Timeline
) -> LinearModel:
    """The game on epochs 0..K of ``dynamics``, every fix used.

    Args:
        dynamics: of the K+1 epochs of the game.
        prior_covariance: the filter's P after epoch -1, (15, 15).
        measurement_covariance: the filter's R, (m, m).
        timeline: of the game.
    """
    covariance, factor, gain, innovation = filter_gains(dynamics, prior_covariance, measurement_covariance)
    return LinearModel(
        time=timeline.times,
        transition=dynamics.transition,
        process_noise=dynamics.process_noise,
        noise_factor=np.array([semidefinite_factor(q) for q in dynamics.true_noise]),
        observation=dynamics.observation,
        measurement_covariance=measurement_covariance,
        prior_covariance=prior_covariance,
        covariance=covariance,
        innovation_covariance=innovation,
        innovation_factor=factor,
        whitened_gain=gain,
    )


def filter_gains(
    dynamics: ErrorDynamics, prior_covariance: Floats, measurement_covariance: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """The filter's covariance recursion with every fix used.

    Returns:
        P before the fix (E, n, n), L (E, m, m), U' (E, m, n), S (E, m, m); n is that of the prior covariance.
    """
    n, (epochs, m, _) = len(prior_covariance), dynamics.observation.shape
    prior = np.empty((epochs, n, n))
    factor, innovation = np.empty((epochs, m, m)), np.empty((epochs, m, m))
    gain = np.empty((epochs, m, n))
    covariance = prior_covariance.copy()
    cross, work = np.empty((m, n)), np.empty((NUM_NAVIGATION, n))
    for k in range(epochs):
        kalman.predict_covariance(dynamics.transition[k], dynamics.process_noise[k], covariance, work)
        prior[k] = covariance
        kalman.innovation_covariance(covariance, dynamics.observation[k], measurement_covariance, cross, innovation[k])
        kalman.cholesky(innovation[k], factor[k])
        kalman.whitened_gain(cross, factor[k], gain[k])
        kalman.update_covariance(gain[k], covariance)
    return prior, factor, gain, innovation


def semidefinite_factor(covariance: Floats) -> Floats:
    """A square root of a symmetric positive semidefinite matrix, scaled so that small blocks keep their digits.

    Lower triangular where the matrix is definite; from the eigenvectors of the correlation matrix where it is singular.
    """
    scale = np.sqrt(np.diag(covariance))
    positive = scale > 0
    factor = np.zeros_like(covariance)
    inner = covariance[np.ix_(positive, positive)] / np.outer(scale[positive], scale[positive])
    try:
        root = np.linalg.cholesky(inner)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(inner)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
    factor[np.ix_(positive, positive)] = scale[positive, None] * root
    return factor


class Motion(NamedTuple):
    """A true motion at the rate of its inertial samples; shapes as in `Trajectory`."""

    attitude: Floats
    velocity: Floats
    position: Floats
    specific_force: Floats


@njit(cache=True, nogil=True)
def _accumulate(
    motion: Motion, step: float, samples: int, densities: Floats, transition: Floats, noise: Floats
) -> None:
    """Multiply the transitions of the IMU samples of every epoch, and carry noise of each density to its end."""
    dynamics, work = np.empty((NUM_NAVIGATION, NUM_NAVIGATION)), np.empty((2, NUM_NAVIGATION, NUM_NAVIGATION))
    one = np.empty((NUM_NAVIGATION, NUM_INERTIAL))
    product = np.empty((NUM_NAVIGATION, NUM_INERTIAL))
    force, middle = np.empty(3), np.empty((3, 3))
    for epoch in range(transition.shape[0]):
        total = transition[epoch]
        total[:, :] = 0.0
        for a in range(NUM_INERTIAL):
            total[a, a] = 1.0
        noise[:, epoch, :, :] = 0.0
        for i in range(epoch * samples, (epoch + 1) * samples):
            for a in range(3):
                force[a] = 0.0
                for b in range(3):
                    middle[a, b] = 0.5 * (motion.attitude[i, a, b] + motion.attitude[i + 1, a, b])
                    force[a] += middle[a, b] * motion.specific_force[i, b]
            navigation_dynamics(motion.velocity[i], motion.position[i], force, dynamics)
            transition_matrix(dynamics, middle, step, one, work)
            for a in range(NUM_NAVIGATION):
                for b in range(NUM_INERTIAL):
                    product[a, b] = 0.0
                for c in range(NUM_NAVIGATION):
                    for b in range(NUM_INERTIAL):
                        product[a, b] += one[a, c] * total[c, b]
                for c in range(NUM_NAVIGATION, NUM_INERTIAL):  # biases stay what they are
                    product[a, c] += one[a, c]
            for a in range(NUM_NAVIGATION):
                for b in range(NUM_INERTIAL):
                    total[a, b] = product[a, b]
            for d in range(len(densities)):
                kalman.predict_covariance(one, densities[d], noise[d, epoch], product)
