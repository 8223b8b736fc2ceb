"""The equations of the tightly coupled filter, one run at a time, in the whitened form of `kalman`.

What makes them fast is the structure of the model: only nine states have a dense row in Φ, the clock has one entry off
the diagonal, every other state has its decay alone; a row of H has nine entries. All loops run along rows of P.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.batch import Weights
from spoofgym.navigation.error_model import NUM_NAVIGATION
from spoofgym.navigation.tight.states import CLOCK, DRIFT, NUM_COMMON, NUM_INERTIAL, PER_SATELLITE, POSITION

FIRST_POSITION = POSITION.start
"""Place of the position's first state."""


class FilterSteps(NamedTuple):
    """Φ and Q as the filter believes them; leading axis: epochs. What each is, `TightDynamics` says."""

    transition: Floats
    process_noise: Floats
    decay: Floats
    variance: Floats
    clock_noise: Floats
    intervals: Floats
    clock_jump: Floats
    started: Flags
    satellite_sigma: Floats


class Ranges(NamedTuple):
    """H and R of the ranges of all epochs.

    Attributes:
        columns: places of the entries of H, (m, 9).
        values: the entries, (E, m, 9); zeros cost nothing.
        variance: the diagonal of R, (E, m).
    """

    columns: Runs
    values: Floats
    variance: Floats


class RangeInnovations(NamedTuple):
    """What kernels fill with the innovations of k runs on ranges.

    Attributes:
        residual: z, predicted minus measured, (k, m), m and m/s.
        covariance: S, (k, m, m).
        whitened: w, (k, m).
        nis: w' w, (k,).
        response: L⁻¹ H on the three states of the position, (k, m, 3), 1/m.
    """

    residual: Floats
    covariance: Floats
    whitened: Floats
    nis: Floats
    response: Floats


class Workspace(NamedTuple):
    """Memory for the innovation of one run: H (m, 9) and R (m,) of the ranges used, HP (m, n) and L (m, m)."""

    values: Floats
    variance: Floats
    cross: Floats
    factor: Floats


def empty_innovations(count: int, m: int) -> RangeInnovations:
    """Arrays for the innovations of ``count`` runs with ``m`` ranges each."""
    return RangeInnovations(
        residual=np.empty((count, m)),
        covariance=np.empty((count, m, m)),
        whitened=np.empty((count, m)),
        nis=np.empty(count),
        response=np.empty((count, m, 3)),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def workspace(ranges: Ranges, n: int) -> Workspace:
    """Memory for the innovations of a filter of n states."""
    m, entries = ranges.columns.shape
    return Workspace(np.empty((m, entries)), np.empty(m), np.empty((m, n)), np.empty((m, m)))


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def predict_error(
    columns: Floats, decay: Floats, interval: float, noise: Floats, error: Floats, work: Floats
) -> None:
    """x <- Φ x + w.

    Args:
        columns: the first nine rows of Φ, stored by columns, (15, 9): no other state acts on them.
        decay: the diagonal of Φ, (n,); its first nine entries are not read.
        interval: between epochs, s: what the clock's rate adds to its offset.
        noise: w, (n,).
        error: x, (n,), in place.
        work: (9,).
    """
    for i in range(NUM_NAVIGATION):
        work[i] = noise[i]
    for j in range(NUM_INERTIAL):
        factor = error[j]
        for i in range(NUM_NAVIGATION):
            work[i] += columns[j, i] * factor
    error[CLOCK] += interval * error[DRIFT]
    for i in range(NUM_NAVIGATION):
        error[i] = work[i]
    for i in range(NUM_NAVIGATION, error.shape[0]):
        error[i] = decay[i] * error[i] + noise[i]


@njit(cache=True, nogil=True, error_model="numpy")
def predict_covariance(
    transition: Floats,
    process_noise: Floats,
    decay: Floats,
    variance: Floats,
    clock_noise: Floats,
    interval: float,
    covariance: Floats,
    work: Floats,
) -> None:
    """P <- Φ P Φ' + Q.

    Args:
        transition: the first nine rows of Φ, (9, 15).
        process_noise: Q of the nine navigation states, (9, 9).
        decay: the diagonal of Φ, (n,).
        variance: the diagonal of Q from the tenth state on, (n,), without the clock's.
        clock_noise: Q of the clock, (2, 2).
        interval: between epochs, s.
        covariance: P, (n, n), in place.
        work: (9, n).
    """
    n = covariance.shape[0]
    for j in range(n):
        covariance[CLOCK, j] += interval * covariance[DRIFT, j]
    for i in range(n):
        covariance[i, CLOCK] += interval * covariance[i, DRIFT]
    for i in range(NUM_NAVIGATION):
        for j in range(n):
            work[i, j] = 0.0
        for k in range(NUM_INERTIAL):
            factor = transition[i, k]
            if factor != 0.0:
                for j in range(n):
                    work[i, j] += factor * covariance[k, j]
    for i in range(NUM_NAVIGATION):
        for j in range(i + 1):
            total = process_noise[i, j]
            for k in range(NUM_INERTIAL):
                total += work[i, k] * transition[j, k]
            covariance[i, j] = total
            covariance[j, i] = total
    for j in range(NUM_NAVIGATION, n):
        for i in range(NUM_NAVIGATION):
            covariance[i, j] = work[i, j] * decay[j]
            covariance[j, i] = covariance[i, j]
    for i in range(NUM_NAVIGATION, n):
        factor = decay[i]
        for j in range(NUM_NAVIGATION, n):
            covariance[i, j] *= factor * decay[j]
        covariance[i, i] += variance[i]
    for i in range(2):
        for j in range(2):
            covariance[CLOCK + i, CLOCK + j] += clock_noise[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def start_satellites(started: Flags, sigma: Floats, covariance: Floats) -> None:
    """A slot that holds a new satellite forgets the old one.

    Args:
        started: whether each slot does, (S,) bool.
        sigma: prior of the five states of a satellite, (5,).
        covariance: P, (n, n), in place.
    """
    for s in range(started.shape[0]):
        if started[s]:
            for a in range(PER_SATELLITE):
                place = NUM_COMMON + PER_SATELLITE * s + a
                for j in range(covariance.shape[0]):
                    covariance[place, j] = 0.0
                    covariance[j, place] = 0.0
                covariance[place, place] = sigma[a] * sigma[a]


@njit(cache=True, nogil=True, error_model="numpy")
def predict_filter(k: int, steps: FilterSteps, covariance: Floats, work: Floats) -> None:
    """Carry P (n, n), in place, from epoch k - 1 to epoch k; work (9, n) is overwritten."""
    predict_covariance(
        steps.transition[k],
        steps.process_noise[k],
        steps.decay,
        steps.variance,
        steps.clock_noise,
        steps.intervals[k],
        covariance,
        work,
    )
    covariance[CLOCK, CLOCK] += steps.clock_jump[k]
    start_satellites(steps.started[k], steps.satellite_sigma, covariance)


@njit(cache=True, nogil=True, error_model="numpy")
def innovation_covariance(
    covariance: Floats, columns: Runs, values: Floats, variance: Floats, cross: Floats, innovation: Floats
) -> None:
    """HP and S = H P H' + R.

    Args:
        covariance: P, (n, n).
        columns: places of the entries of H, (m, 9).
        values: the entries, (m, 9); zeros cost nothing.
        variance: the diagonal of R, (m,).
        cross: HP, (m, n), overwritten.
        innovation: S, (m, m), overwritten.
    """
    m, n = cross.shape
    for a in range(m):
        for j in range(n):
            cross[a, j] = 0.0
        for k in range(columns.shape[1]):
            factor = values[a, k]
            if factor != 0.0:
                row = columns[a, k]
                for j in range(n):
                    cross[a, j] += factor * covariance[row, j]
    for a in range(m):
        for b in range(a + 1):
            total = variance[a] if a == b else 0.0
            for k in range(columns.shape[1]):
                total += values[b, k] * cross[a, columns[b, k]]
            innovation[a, b] = total
            innovation[b, a] = total


@njit(cache=True, nogil=True, error_model="numpy")
def whitened_gain(cross: Floats, factor: Floats, gain: Floats) -> None:
    """U' = L⁻¹ H P; cross HP (m, n), factor L (m, m), gain U' (m, n), overwritten."""
    m, n = cross.shape
    for a in range(m):
        for i in range(n):
            gain[a, i] = cross[a, i]
        for b in range(a):
            share = factor[a, b]
            if share != 0.0:
                for i in range(n):
                    gain[a, i] -= share * gain[b, i]
        scale = 1.0 / factor[a, a]
        for i in range(n):
            gain[a, i] *= scale


@njit(cache=True, nogil=True, error_model="numpy")
def position_response(columns: Runs, values: Floats, factor: Floats, response: Floats) -> None:
    """L⁻¹ H on the three states of the position, (m, 3), overwritten."""
    m = factor.shape[0]
    for a in range(m):
        for c in range(3):
            response[a, c] = 0.0
        for k in range(3):
            if columns[a, k] >= FIRST_POSITION:
                response[a, columns[a, k] - FIRST_POSITION] = values[a, k]
        for c in range(3):
            total = response[a, c]
            for b in range(a):
                total -= factor[a, b] * response[b, c]
            response[a, c] = total / factor[a, a]


@njit(cache=True, nogil=True, error_model="numpy")
def update_covariance(gain: Floats, covariance: Floats) -> None:
    """P <- P - U U'; gain U' (m, n), covariance (n, n) in place.

    Four measurements at a time, so that a row of P is loaded a quarter as often.
    """
    m, n = gain.shape
    for i in range(n):
        a = 0
        while a + 4 <= m:
            f0, f1, f2, f3 = gain[a, i], gain[a + 1, i], gain[a + 2, i], gain[a + 3, i]
            for j in range(n):
                covariance[i, j] -= (
                    f0 * gain[a, j] + f1 * gain[a + 1, j] + f2 * gain[a + 2, j] + f3 * gain[a + 3, j]
                )
            a += 4
        while a < m:
            f0 = gain[a, i]
            for j in range(n):
                covariance[i, j] -= f0 * gain[a, j]
            a += 1
    for i in range(n):
        for j in range(i):
            covariance[j, i] = covariance[i, j]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def correct_error(gain: Floats, whitened: Floats, error: Floats) -> None:
    """x <- x - K z = x - U w; gain U' (m, n), whitened w (m,), error x (n,) in place."""
    for a in range(gain.shape[0]):
        factor = whitened[a]
        for i in range(gain.shape[1]):
            error[i] -= gain[a, i] * factor


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def observe(columns: Runs, values: Floats, state: Floats, deviation: Floats, residual: Floats) -> None:
    """z = H x - deviation; columns and values of H (m, 9), state x (n,), the others (m,)."""
    for a in range(residual.shape[0]):
        total = -deviation[a]
        for k in range(columns.shape[1]):
            total += values[a, k] * state[columns[a, k]]
        residual[a] = total


@njit(cache=True, nogil=True, error_model="numpy")
def leave_out(
    satellites: Flags, values: Floats, variance: Floats, scale: float, residual: Floats, taken: Floats, used: Floats
) -> None:
    """H and R of the satellites that are used; the others become like empty slots.

    Args:
        satellites: which are used, (S,).
        values: entries of H, (m, 9).
        variance: diagonal of R, (m,).
        scale: factor on it.
        residual: z, (m,), in place.
        taken: entries of H that are left, (m, 9), overwritten.
        used: diagonal of R, (m,), overwritten.
    """
    slots = satellites.shape[0]
    for a in range(residual.shape[0]):
        use = satellites[a % slots]
        used[a] = scale * variance[a] if use else 1.0
        for k in range(values.shape[1]):
            taken[a, k] = values[a, k] if use else 0.0
        if not use:
            residual[a] = 0.0


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def form_innovation(
    place: int,
    k: int,
    ranges: Ranges,
    weights: Weights,
    covariance: Floats,
    gain: Floats,
    formed: RangeInnovations,
    work: Workspace,
) -> None:
    """Form all that the residual of a run leads to: S, U', L⁻¹ H on the position, w, and the NIS.

    Args:
        place: where the run stands in ``weights`` and ``formed``.
        k: the run's epoch.
        ranges: of all epochs.
        weights: the ranges used; the residual of the others becomes zero.
        covariance: P, (n, n).
        gain: U', (m, n), overwritten.
        formed: holds the residual; the rest of the place is overwritten.
        work: overwritten.
    """
    residual = formed.residual[place]
    leave_out(
        weights.satellites[place],
        ranges.values[k],
        ranges.variance[k],
        weights.noise_scale[place],
        residual,
        work.values,
        work.variance,
    )
    innovation_covariance(covariance, ranges.columns, work.values, work.variance, work.cross, formed.covariance[place])
    kalman.cholesky(formed.covariance[place], work.factor)
    whitened_gain(work.cross, work.factor, gain)
    position_response(ranges.columns, work.values, work.factor, formed.response[place])
    formed.nis[place] = kalman.whiten(work.factor, residual, formed.whitened[place])
