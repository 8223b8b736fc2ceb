"""The covariance of the tightly coupled filter along the truth, every range used, and what it keeps of each epoch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.error_model import NUM_NAVIGATION
from spoofgym.navigation.tight import kalman as tight_filter
from spoofgym.navigation.tight.kalman import FilterSteps, Ranges


class Kept(NamedTuple):
    """What the recursion keeps of each epoch, as in `TightModel`; arrays of no epochs if only its end is wanted."""

    covariance: Floats
    innovation_covariance: Floats
    innovation_factor: Floats
    whitened_gain: Floats
    position_response: Floats


def empty_kept(epochs: int, m: int, n: int) -> Kept:
    """Arrays for so many epochs of a filter of n states on m ranges."""
    return Kept(
        covariance=np.empty((epochs, n, n)),
        innovation_covariance=np.empty((epochs, m, m)),
        innovation_factor=np.empty((epochs, m, m)),
        whitened_gain=np.empty((epochs, m, n)),
        position_response=np.empty((epochs, m, 3)),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def covariance_recursion(steps: FilterSteps, ranges: Ranges, covariance: Floats, kept: Kept) -> None:
    """Carry P (n, n), in place, through all epochs; keep what the arrays of epochs have room for."""
    m, n = ranges.columns.shape[0], covariance.shape[0]
    work, cross, innovation = np.empty((NUM_NAVIGATION, n)), np.empty((m, n)), np.empty((m, m))
    factor, gain = np.empty((m, m)), np.empty((m, n))
    keep = len(kept.covariance) > 0
    for k in range(len(steps.transition)):
        tight_filter.predict_filter(k, steps, covariance, work)
        tight_filter.innovation_covariance(
            covariance, ranges.columns, ranges.values[k], ranges.variance[k], cross, innovation
        )
        kalman.cholesky(innovation, factor)
        tight_filter.whitened_gain(cross, factor, gain)
        if keep:
            _copy(covariance, kept.covariance[k])
            _copy(innovation, kept.innovation_covariance[k])
            _copy(factor, kept.innovation_factor[k])
            _copy(gain, kept.whitened_gain[k])
            tight_filter.position_response(ranges.columns, ranges.values[k], factor, kept.position_response[k])
        tight_filter.update_covariance(gain, covariance)


@njit(cache=True, nogil=True, error_model="numpy")
def _copy(matrix: Floats, to: Floats) -> None:
    """Element by element: a kernel that assigns an array to a part of another takes seconds more to compile."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            to[i, j] = matrix[i, j]
