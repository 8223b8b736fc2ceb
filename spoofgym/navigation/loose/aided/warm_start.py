"""The joint distribution of truth and aided filter when a game begins: `loose/warm_start.py`, in the steps of the aids.

The state is that of `warm_start`, with the errors of the aids' states behind it. Bias instability and slow noise of the
receiver change once an epoch, at its end, as they do in both fidelities.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation import kalman
from spoofgym.navigation.aids.aid_set import AidSet
from spoofgym.navigation.error_model import NUM_INERTIAL, NUM_NAVIGATION
from spoofgym.navigation.linear_model import semidefinite_factor
from spoofgym.navigation.loose.aided.dynamics import AidedDynamics
from spoofgym.navigation.loose.aided.model import AidedFilter, measurements_of
from spoofgym.navigation.loose.warm_start import COLOUR, CONSTANT_BIAS, ERROR, INSTABILITY, NUM_JOINT, WarmStart
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.sensors.imu import ImuGrade
from spoofgym.sensors.receiver import Receiver


def aided_cold_start(cold: WarmStart, aids: AidSet) -> WarmStart:
    """A cold start, and the states of the aids, which nothing is known of but their sigma."""
    variance = np.diag(aids.sigma**2)
    covariance, joint = _beside(cold.filter_covariance, variance), _beside(cold.joint_covariance, variance)
    return WarmStart(covariance, joint, semidefinite_factor(joint))


def _beside(first: Floats, second: Floats) -> Floats:
    whole = np.zeros((len(first) + len(second),) * 2)
    whole[: len(first), : len(first)] = first
    whole[len(first) :, len(first) :] = second
    return whole


def aided_warm_up(
    start: WarmStart,
    dynamics: AidedDynamics,
    aids: AidSet,
    grade: ImuGrade,
    receiver: Receiver,
    tuning: FilterTuning,
) -> WarmStart:
    """Carry a start over the epochs of ``dynamics``, every fix and every measurement of an aid used.

    Args:
        start: before these epochs.
        dynamics: of the epochs.
        aids: of the filter.
        grade: of the IMU.
        receiver: of the fixes.
        tuning: what the filter believes.
    """
    state = AidedFilter(dynamics, measurements_of(dynamics, aids), start.filter_covariance)
    joint, size = start.joint_covariance, len(start.joint_covariance)
    error = np.array([*range(NUM_INERTIAL), *range(NUM_JOINT, size)])
    slow_advance, slow_noise = _slow(grade, receiver, size)
    white, noise = np.square(receiver.white_deviation), tuning.measurement_covariance
    m, n = receiver.dimension, dynamics.num_states
    cross, factor, gain, innovation = np.empty((m, n)), np.empty((m, m)), np.empty((m, n)), np.empty((m, m))
    for k in range(dynamics.num_epochs):
        last = (k + 1) * dynamics.per_epoch - 1
        for step in range(k * dynamics.per_epoch, last + 1):
            advance, added = np.eye(size), np.zeros((size, size))
            if step == last:
                advance, added = slow_advance.copy(), slow_noise.copy()
            advance[ERROR, ERROR] = dynamics.steps.transition[step]
            added[:NUM_NAVIGATION, :NUM_NAVIGATION] += dynamics.steps.true_noise[step]
            added[error[NUM_INERTIAL:], error[NUM_INERTIAL:]] += dynamics.walk**2
            joint = advance @ joint @ advance.T + added
            state.predict(step)
            for number in state.of_step(step):
                observation, aid_gain, variance = state.correct(number)
                joint = _corrected(joint, error, _on(error, observation, size), aid_gain, variance)
        kalman.innovation_covariance(state.covariance, dynamics.observation[k], noise, cross, innovation)
        kalman.cholesky(innovation, factor)
        kalman.whitened_gain(cross, factor, gain)
        kalman.update_covariance(gain, state.covariance)
        observed = np.zeros((m, size))
        observed[:, :NUM_NAVIGATION] = dynamics.observation[k]
        observed[range(3), range(COLOUR.start, COLOUR.stop)] = -1.0
        fix_gain = np.asarray(np.linalg.solve(factor.T, gain).T, np.float64)
        joint = _corrected(joint, error, observed, fix_gain, white)
    return WarmStart(state.covariance, joint, semidefinite_factor(joint))


def _slow(grade: ImuGrade, receiver: Receiver, size: int) -> tuple[Floats, Floats]:
    """What an epoch makes of bias instability and coloured noise: advance and noise, (size, size) each."""
    decay = np.exp(-receiver.interval / grade.correlation_time)
    colour_decay = np.exp(-receiver.interval / receiver.markov_time) if any(receiver.markov_sigma) else 0.0
    advance, noise = np.eye(size), np.zeros((size, size))
    biases = slice(NUM_NAVIGATION, NUM_INERTIAL)
    advance[INSTABILITY, INSTABILITY] = decay * np.eye(6)
    advance[biases, INSTABILITY] = (decay - 1.0) * np.eye(6)
    advance[COLOUR, COLOUR] = colour_decay * np.eye(3)
    advance[CONSTANT_BIAS, CONSTANT_BIAS] = np.eye(6)
    step = np.diag((1.0 - decay**2) * np.square(grade.instability_sigma))
    for a in (INSTABILITY, biases):
        for b in (INSTABILITY, biases):
            noise[a, b] = step
    noise[COLOUR, COLOUR] = np.diag((1.0 - colour_decay**2) * np.square(receiver.markov_sigma))
    return advance, noise


def _on(error: Runs, observation: Floats, size: int) -> Floats:
    """H (r, n) on the joint state, (r, size)."""
    whole = np.zeros((len(observation), size))
    whole[:, error] = observation
    return whole


def _corrected(joint: Floats, error: Runs, observed: Floats, gain: Floats, variance: Floats) -> Floats:
    """Y <- (I - K C) Y (I - K C)' + K R K' of the joint covariance; K (n, r) acts on the places ``error``."""
    update = np.eye(len(joint))
    update[error] -= gain @ observed
    joint = update @ joint @ update.T
    joint[np.ix_(error, error)] += (gain * variance) @ gain.T
    return np.asarray(0.5 * (joint + joint.T))
