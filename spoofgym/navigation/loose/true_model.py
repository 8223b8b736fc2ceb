"""What really acts on the error of an unaided solution and on the fixes, whatever a filter believes of it.

The state is y = [x (15), bias instability (6), coloured receiver noise (3)], the last two where there are any, and

    y_k = A_k y_{k-1} + w_k,    z_k = C_k y_k - n_k - offset,    w ~ N(0, Q), n ~ N(0, R).

z is what a filter that uses no fix sees as its innovation. The equations are those by which `warm_start` carries the
truth; a filter that uses this model errs least of all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.navigation.error_model import NUM_INERTIAL, NUM_NAVIGATION
from spoofgym.navigation.loose.family import LooseFamily
from spoofgym.navigation.loose.warm_start import COLOUR, ERROR, INSTABILITY


@dataclass(frozen=True)
class TrueModel:
    """The error of an unaided solution along a game; leading axis: epochs k = 0..K.

    Attributes:
        transition: A from epoch k-1 to k, (K+1, n, n).
        process_noise: Q of that step, (K+1, n, n).
        observation: C, (K+1, m, n).
        measurement_covariance: R of the white noise of a fix, (m, m).
        prior_covariance: of y after epoch -1, (n, n).
    """

    transition: Floats
    process_noise: Floats
    observation: Floats
    measurement_covariance: Floats
    prior_covariance: Floats


def true_model(family: LooseFamily) -> TrueModel:
    """The model of a family's truth, from its epoch 0 on.

    Args:
        family: filters on fixes; those made from ranges have slow errors, which are not modelled here.

    Raises:
        ValueError: fixes are made from ranges.
    """
    if family.ranges is not None:
        raise ValueError(f"scenario {family.truth.name!r}: fixes from ranges have no such model: take noise=white")
    first = family.truth.first(0)
    dynamics = family.epochs(first, first + family.truth.horizon + 1)
    grade, receiver = family.grade, family.receiver
    unstable, coloured = bool(np.any(grade.instability_sigma)), any(receiver.markov_sigma)
    states = [*range(ERROR.start, ERROR.stop)]
    states += range(INSTABILITY.start, INSTABILITY.stop) if unstable else ()
    states += range(COLOUR.start, COLOUR.stop) if coloured else ()
    size, epochs = len(states), len(dynamics.transition)
    advance, noise = np.zeros((epochs, size, size)), np.zeros((epochs, size, size))
    observation = np.zeros((epochs, receiver.dimension, size))
    advance[:, ERROR, ERROR] = dynamics.transition
    noise[:, :NUM_NAVIGATION, :NUM_NAVIGATION] = dynamics.true_noise
    observation[:, :, :NUM_NAVIGATION] = dynamics.observation
    if unstable:
        decay = np.exp(-receiver.interval / grade.correlation_time)
        slow, biases = slice(NUM_INERTIAL, NUM_INERTIAL + 6), slice(NUM_NAVIGATION, NUM_INERTIAL)
        advance[:, slow, slow], advance[:, biases, slow] = decay * np.eye(6), (decay - 1.0) * np.eye(6)
        step = np.diag((1.0 - decay**2) * np.square(grade.instability_sigma))
        for a in (slow, biases):
            for b in (slow, biases):
                noise[:, a, b] = step
    if coloured:
        decay, colour = np.exp(-receiver.interval / receiver.markov_time), slice(size - 3, size)
        advance[:, colour, colour] = decay * np.eye(3)
        noise[:, colour, colour] = np.diag((1.0 - decay**2) * np.square(receiver.markov_sigma))
        observation[:, :3, colour] = -np.eye(3)
    prior = family.warm_start(0).joint_covariance[np.ix_(states, states)]
    return TrueModel(advance, noise, observation, np.diag(np.square(receiver.white_deviation)), prior)
