"""The equations by which a measurement of an aid corrects a filter, one run at a time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman


class Told(NamedTuple):
    """What the aids told each run on the way to its present epoch; rows as in `AidSet.first_row`.

    Attributes:
        whitened: sum of the whitened innovations, (N, rows).
        number: measurements of each aid, those that were left out included, (N, A).
        rejected: those that were left out, (N, A).
    """

    whitened: Floats
    number: Runs
    rejected: Runs


@njit(cache=True, nogil=True, error_model="numpy")
def form(
    covariance: Floats, observation: Floats, variance: Floats, cross: Floats, factor: Floats, gain: Floats
) -> None:
    """The factor of S = H P H' + R, and the whitened gain U' = L⁻¹ H P.

    Args:
        covariance: P, (n, n).
        observation: H, (r, n); mostly zeros, which cost nothing.
        variance: the diagonal of R, (r,).
        cross: (r, n), overwritten.
        factor: L, (r, r), overwritten.
        gain: U', (r, n), overwritten.
    """
    rows, n = observation.shape
    innovation = np.empty((rows, rows))
    for a in range(rows):
        for j in range(n):
            cross[a, j] = 0.0
        for k in range(n):
            share = observation[a, k]
            if share != 0.0:
                for j in range(n):
                    cross[a, j] += share * covariance[k, j]
    for a in range(rows):
        for b in range(rows):
            total = variance[a] if a == b else 0.0
            for k in range(n):
                total += observation[a, k] * cross[b, k]
            innovation[a, b] = total
    kalman.cholesky(innovation, factor)
    kalman.whitened_gain(cross, factor, gain)


@njit(cache=True, nogil=True, error_model="numpy")
def observe(observation: Floats, state: Floats, residual: Floats) -> None:
    """Residual += H x; H (r, n), x (n,), residual (r,) in place."""
    for a in range(observation.shape[0]):
        for j in range(observation.shape[1]):
            residual[a] += observation[a, j] * state[j]


@njit(cache=True, nogil=True, error_model="numpy")
def tell(run: int, aid: int, row: int, whitened: Floats, used: bool, told: Told) -> None:
    """Keep the whitened innovation (r,) of an aid whose rows begin at ``row``, and whether it was used."""
    for a in range(len(whitened)):
        told.whitened[run, row + a] += whitened[a]
    told.number[run, aid] += 1
    if not used:
        told.rejected[run, aid] += 1


@njit(cache=True, nogil=True, error_model="numpy")
def forget(run: int, told: Told) -> None:
    """Begin an epoch of a run."""
    for a in range(told.whitened.shape[1]):
        told.whitened[run, a] = 0.0
    for j in range(told.number.shape[1]):
        told.number[run, j] = 0
        told.rejected[run, j] = 0


@njit(cache=True, nogil=True, error_model="numpy")
def correct_unaided(
    observation: Floats, factor: Floats, gain: Floats, work: Floats, whitened: Floats, difference: Floats
) -> None:
    """d <- d - U L⁻¹ H d: the solution without GNSS takes the reading with the filter's gain.

    Both solutions meet the same reading, so that its noise drops out of their difference d (n,), in place. H (r, n), L
    (r, r), U' (r, n); work and whitened (r,), overwritten.
    """
    for a in range(len(work)):
        work[a] = 0.0
    observe(observation, difference, work)
    kalman.whiten(factor, work, whitened)
    kalman.correct_error(gain, whitened, difference)
