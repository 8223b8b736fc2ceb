"""The joint distribution of truth and filter at the moment a game begins.

An episode starts with a warm filter. Its covariance follows from its own recursion along the trajectory; its true error
follows from the recursion of the joint covariance of everything that is random in the truth,

    y = [x (15), bias instability (6), coloured receiver noise (3), constant bias (6), slow errors of the ranges (C)],

with the true noises and the filter's gains; C is zero where the fixes are not made from ranges. The two covariances
agree only where the filter's model is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.navigation.error_model import NUM_INERTIAL, NUM_NAVIGATION
from spoofgym.navigation.linear_model import ErrorDynamics, filter_gains, semidefinite_factor
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.sensors.imu import ImuGrade
from spoofgym.sensors.range_fix import RangeFix
from spoofgym.sensors.receiver import Receiver

ERROR = slice(0, 15)
INSTABILITY = slice(15, 21)
COLOUR = slice(21, 24)
CONSTANT_BIAS = slice(24, 30)
NUM_JOINT = 30
"""States of y without those of the ranges."""
RANGES = slice(NUM_JOINT, None)


@dataclass(frozen=True)
class WarmStart:
    """What is known just after an epoch has been resolved.

    Attributes:
        filter_covariance: the filter's P, (15, 15).
        joint_covariance: of y, (30 + C, 30 + C).
        joint_factor: a square root of it, of the same shape.
    """

    filter_covariance: Floats
    joint_covariance: Floats
    joint_factor: Floats


def num_joint(ranges: RangeFix | None) -> int:
    """States of y."""
    return NUM_JOINT + (0 if ranges is None else ranges.num_states)


def cold_start(
    grade: ImuGrade, receiver: Receiver, tuning: FilterTuning, ranges: RangeFix | None = None
) -> WarmStart:
    """At power-on: no bias is estimated yet, so that the bias errors are the biases themselves."""
    believed = tuning.initial_scale * tuning.initial_sigma(grade)
    if not tuning.bias_states:
        believed[NUM_NAVIGATION:] = 0.0
    filter_covariance = np.diag(believed**2)
    joint = np.zeros((num_joint(ranges), num_joint(ranges)))
    joint[ERROR, ERROR] = np.diag(tuning.initial_sigma(grade) ** 2)
    for part, sigma in ((INSTABILITY, grade.instability_sigma), (CONSTANT_BIAS, grade.bias_sigma)):
        variance = np.diag(np.square(sigma))
        joint[part, part] = variance
        joint[NUM_NAVIGATION:NUM_INERTIAL, part] = variance
        joint[part, NUM_NAVIGATION:NUM_INERTIAL] = variance
    joint[COLOUR, COLOUR] = np.diag(np.square(receiver.markov_sigma))
    if ranges is not None:
        joint[RANGES, RANGES] = np.diag(ranges.sigma**2)
    return WarmStart(filter_covariance, joint, semidefinite_factor(joint))


def warm_up(
    start: WarmStart,
    dynamics: ErrorDynamics,
    grade: ImuGrade,
    receiver: Receiver,
    tuning: FilterTuning,
    ranges: RangeFix | None = None,
) -> WarmStart:
    """Carry a start over the epochs of ``dynamics``, every fix used.

    The joint covariance is propagated as y <- A y + noise and updated as y <- (I - G [H, 0, -I, 0, -M]) y + G n, G the
    filter's gain on x, M what the slow errors of the ranges make of the fix. A satellite that rises brings new ones,
    which nothing is correlated with.

    Args:
        start: before these epochs.
        dynamics: of the epochs.
        grade: of the IMU.
        receiver: of the fixes.
        tuning: what the filter believes.
        ranges: noise of the fixes from the same epoch on, where they are made from ranges.
    """
    measurement_covariance = tuning.measurement_covariance
    prior, factor, gain, _ = filter_gains(dynamics, start.filter_covariance, measurement_covariance)
    if len(prior) == 0:
        return start
    joint = start.joint_covariance
    decay = np.exp(-receiver.interval / grade.correlation_time)
    colour_decay = np.exp(-receiver.interval / receiver.markov_time) if any(receiver.markov_sigma) else 0.0
    size = len(joint)
    advance, noise = np.zeros((size, size)), np.zeros((size, size))
    advance[INSTABILITY, INSTABILITY] = decay * np.eye(6)
    advance[NUM_NAVIGATION:NUM_INERTIAL, INSTABILITY] = (decay - 1.0) * np.eye(6)
    advance[COLOUR, COLOUR] = colour_decay * np.eye(3)
    advance[CONSTANT_BIAS, CONSTANT_BIAS] = np.eye(6)
    step = np.diag((1.0 - decay**2) * np.square(grade.instability_sigma))
    for a in (INSTABILITY, slice(NUM_NAVIGATION, NUM_INERTIAL)):
        for b in (INSTABILITY, slice(NUM_NAVIGATION, NUM_INERTIAL)):
            noise[a, b] = step
    noise[COLOUR, COLOUR] = np.diag((1.0 - colour_decay**2) * np.square(receiver.markov_sigma))
    if ranges is not None:
        advance[RANGES, RANGES] = np.diag(ranges.decay)
        noise[RANGES, RANGES] = np.diag((1.0 - ranges.decay**2) * ranges.sigma**2)
    white = np.square(receiver.white_deviation)
    observed = np.zeros((receiver.dimension, size))
    observed[range(3), range(COLOUR.start, COLOUR.stop)] = -1.0
    for k in range(len(prior)):
        advance[ERROR, ERROR] = dynamics.transition[k]
        noise[:NUM_NAVIGATION, :NUM_NAVIGATION] = dynamics.true_noise[k]
        observed[:, :NUM_NAVIGATION] = dynamics.observation[k]
        joint = advance @ joint @ advance.T + noise
        if ranges is not None:
            _start_anew(joint, ranges, k)
            observed[:3, RANGES] = -ranges.mapping[k]
        update = np.eye(size)
        kalman_gain = gain[k].T @ np.linalg.inv(factor[k])
        update[ERROR] -= kalman_gain @ observed
        joint = update @ joint @ update.T
        joint[ERROR, ERROR] += (kalman_gain * white) @ kalman_gain.T
        if ranges is not None:
            ranging = kalman_gain[:, :3] @ ranges.white[k]
            joint[ERROR, ERROR] += ranging @ ranging.T
        joint = 0.5 * (joint + joint.T)
    covariance = prior[-1] - gain[-1].T @ gain[-1]
    return WarmStart(covariance, joint, semidefinite_factor(joint))


def _start_anew(joint: Floats, ranges: RangeFix, epoch: int) -> None:
    """Forget the errors of satellites that have set, where others take their place."""
    states = np.flatnonzero(ranges.started[epoch])
    places = NUM_JOINT + states
    joint[places] = 0.0
    joint[:, places] = 0.0
    joint[places, places] = ranges.sigma[states] ** 2
