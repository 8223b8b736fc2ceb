"""The covariance of an aided filter on ranges along the truth, everything used."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.navigation import kalman
from spoofgym.navigation.aids.kernels import form
from spoofgym.navigation.error_model import NUM_NAVIGATION
from spoofgym.navigation.tight import kalman as tight_filter
from spoofgym.navigation.tight.aided.dynamics import EpochReadings
from spoofgym.navigation.tight.model import TightDynamics, TightModel
from spoofgym.navigation.tight.recursion import empty_kept


@dataclass(frozen=True)
class AidedTightModel(TightModel):
    """A game of an aided filter on ranges; its covariance before the ranges is that after the aids.

    Attributes:
        readings: of the aids, by epoch.
        aided: what the aids of each epoch make of an error, (K+1, n, n).
    """

    readings: EpochReadings
    aided: Floats


def settle_aided(dynamics: TightDynamics, readings: EpochReadings, covariance: Floats) -> Floats:
    """The filter's P after all epochs of ``dynamics``, everything used, (n, n)."""
    settled, work = covariance.copy(), np.empty((NUM_NAVIGATION, len(covariance)))
    m, n = dynamics.dimension, len(covariance)
    cross, innovation, factor, gain = np.empty((m, n)), np.empty((m, m)), np.empty((m, m)), np.empty((m, n))
    for k in range(len(dynamics.time)):
        tight_filter.predict_filter(k, dynamics.filter_steps, settled, work)
        use_aids(readings, k, settled)
        _form(dynamics, k, settled, cross, innovation, factor, gain)
        tight_filter.update_covariance(gain, settled)
    return settled


def aided_tight_model(
    dynamics: TightDynamics, readings: EpochReadings, prior_covariance: Floats
) -> AidedTightModel:
    """The game on the epochs of ``dynamics``, everything used.

    Args:
        dynamics: of the K+1 epochs, with the states of the aids.
        readings: of the aids at these epochs.
        prior_covariance: the filter's P after epoch -1, (n, n).
    """
    epochs, m, n = len(dynamics.time), dynamics.dimension, len(prior_covariance)
    kept, covariance = empty_kept(epochs, m, n), prior_covariance.copy()
    aided, cross, work = np.empty((epochs, n, n)), np.empty((m, n)), np.empty((NUM_NAVIGATION, n))
    for k in range(epochs):
        tight_filter.predict_filter(k, dynamics.filter_steps, covariance, work)
        aided[k] = use_aids(readings, k, covariance)
        kept.covariance[k] = covariance
        factor, gain = kept.innovation_factor[k], kept.whitened_gain[k]
        _form(dynamics, k, covariance, cross, kept.innovation_covariance[k], factor, gain)
        tight_filter.position_response(dynamics.columns, dynamics.values[k], factor, kept.position_response[k])
        tight_filter.update_covariance(gain, covariance)
    return AidedTightModel(dynamics, prior_covariance, **kept._asdict(), readings=readings, aided=aided)


def _form(
    dynamics: TightDynamics, k: int, covariance: Floats, cross: Floats, innovation: Floats, factor: Floats, gain: Floats
) -> None:
    """S, its factor and the whitened gain of the ranges of an epoch."""
    ranges = dynamics.ranges
    tight_filter.innovation_covariance(
        covariance, ranges.columns, ranges.values[k], ranges.variance[k], cross, innovation
    )
    kalman.cholesky(innovation, factor)
    tight_filter.whitened_gain(cross, factor, gain)


def use_aids(readings: EpochReadings, epoch: int, covariance: Floats) -> Floats:
    """Let P (n, n), in place, take the readings of an epoch; what they make of an error, (n, n)."""
    n = len(covariance)
    closed = np.eye(n)
    for j, aid in enumerate(readings.aids.aids):
        number = readings.number[epoch, j]
        if number >= 0:
            observation, rows = readings.observations[j][number], aid.dimension
            factor, gain, cross = np.empty((rows, rows)), np.empty((rows, n)), np.empty((rows, n))
            form(covariance, observation, np.square(aid.noise), cross, factor, gain)
            kalman.update_covariance(gain, covariance)
            kalman_gain = np.asarray(np.linalg.solve(factor.T, gain).T, np.float64)
            closed = closed - kalman_gain @ (observation @ closed)
    return closed
