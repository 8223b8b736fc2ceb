"""The joint distribution of truth and filter at the moment a game begins.

An episode starts with a warm filter. Its covariance follows from its own recursion along the trajectory; its true error
follows from the recursion of the joint covariance of everything that is random in the truth,

    y = [x (15), bias instability (6), coloured receiver noise (3), constant bias (6)],

with the true noises and the filter's gains. The two agree only where the filter's model is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.navigation.error_model import NUM_NAVIGATION, NUM_STATES
from spoofgym.navigation.linear_model import ErrorDynamics, filter_gains, semidefinite_factor
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.sensors.imu import ImuGrade
from spoofgym.sensors.receiver import Receiver

ERROR = slice(0, 15)
INSTABILITY = slice(15, 21)
COLOUR = slice(21, 24)
CONSTANT_BIAS = slice(24, 30)
NUM_JOINT = 30


@dataclass(frozen=True)
class WarmStart:
    """What is known just after an epoch has been resolved.

    Attributes:
        filter_covariance: the filter's P, (15, 15).
        joint_covariance: of y, (30, 30).
        joint_factor: a square root of it, (30, 30).
    """

    filter_covariance: Floats
    joint_covariance: Floats
    joint_factor: Floats


def cold_start(grade: ImuGrade, receiver: Receiver, tuning: FilterTuning) -> WarmStart:
    """At power-on: no bias is estimated yet, so that the bias errors are the biases themselves."""
    believed = tuning.initial_scale * tuning.initial_sigma(grade)
    if not tuning.bias_states:
        believed[NUM_NAVIGATION:] = 0.0
    filter_covariance = np.diag(believed**2)
    joint = np.zeros((NUM_JOINT, NUM_JOINT))
    joint[ERROR, ERROR] = np.diag(tuning.initial_sigma(grade) ** 2)
    for part, sigma in ((INSTABILITY, grade.instability_sigma), (CONSTANT_BIAS, grade.bias_sigma)):
        variance = np.diag(np.square(sigma))
        joint[part, part] = variance
        joint[NUM_NAVIGATION:NUM_STATES, part] = variance
        joint[part, NUM_NAVIGATION:NUM_STATES] = variance
    joint[COLOUR, COLOUR] = np.diag(np.square(receiver.markov_sigma))
    return WarmStart(filter_covariance, joint, semidefinite_factor(joint))


def warm_up(
    start: WarmStart, dynamics: ErrorDynamics, grade: ImuGrade, receiver: Receiver, tuning: FilterTuning
) -> WarmStart:
    """Carry a start over the epochs of ``dynamics``, every fix used.

    The joint covariance is propagated as y <- A y + noise and updated as y <- (I - G [H, 0, -I, 0]) y + G n, G the
    filter's gain on x.
    """
    measurement_covariance = tuning.measurement_covariance
    prior, factor, gain, _ = filter_gains(dynamics, start.filter_covariance, measurement_covariance)
    if len(prior) == 0:
        return start
    joint = start.joint_covariance
    decay = np.exp(-receiver.interval / grade.correlation_time)
    colour_decay = np.exp(-receiver.interval / receiver.markov_time) if any(receiver.markov_sigma) else 0.0
    advance, noise = np.zeros((NUM_JOINT, NUM_JOINT)), np.zeros((NUM_JOINT, NUM_JOINT))
    advance[INSTABILITY, INSTABILITY] = decay * np.eye(6)
    advance[NUM_NAVIGATION:NUM_STATES, INSTABILITY] = (decay - 1.0) * np.eye(6)
    advance[COLOUR, COLOUR] = colour_decay * np.eye(3)
    advance[CONSTANT_BIAS, CONSTANT_BIAS] = np.eye(6)
    step = np.diag((1.0 - decay**2) * np.square(grade.instability_sigma))
    for a in (INSTABILITY, slice(NUM_NAVIGATION, NUM_STATES)):
        for b in (INSTABILITY, slice(NUM_NAVIGATION, NUM_STATES)):
            noise[a, b] = step
    noise[COLOUR, COLOUR] = np.diag((1.0 - colour_decay**2) * np.square(receiver.markov_sigma))
    white = np.square(receiver.white_deviation)
    observed = np.zeros((receiver.dimension, NUM_JOINT))
    observed[range(3), range(COLOUR.start, COLOUR.stop)] = -1.0
    for k in range(len(prior)):
        advance[ERROR, ERROR] = dynamics.transition[k]
        noise[:NUM_NAVIGATION, :NUM_NAVIGATION] = dynamics.true_noise[k]
        observed[:, :NUM_NAVIGATION] = dynamics.observation[k]
        joint = advance @ joint @ advance.T + noise
        update = np.eye(NUM_JOINT)
        kalman_gain = gain[k].T @ np.linalg.inv(factor[k])
        update[ERROR] -= kalman_gain @ observed
        joint = update @ joint @ update.T
        joint[ERROR, ERROR] += (kalman_gain * white) @ kalman_gain.T
        joint = 0.5 * (joint + joint.T)
    covariance = prior[-1] - gain[-1].T @ gain[-1]
    return WarmStart(covariance, joint, semidefinite_factor(joint))
