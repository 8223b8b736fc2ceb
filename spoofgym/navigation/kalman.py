"""The equations of the error-state Kalman filter, one run at a time.

Every function works in place on one run's arrays, so that a navigator's loop over runs allocates nothing. The number of
states n follows from the arrays. The first nine are attitude, velocity and position; the others (six biases, and what a
family adds) are random constants or walks: Φ = [[Φn, Φb], [0, I]], of whose first nine rows the first w columns are
stored, n or fewer; the rest are zero. A measurement observes the first h states: H is (m, h), 9 or more.

The update is written in whitened form: with S = L L', U = P H' L⁻ᵀ and w = L⁻¹ z,

    K z = U w,        P⁺ = P - U U',        NIS = w' w,

which keeps P symmetric and uses one Cholesky factor for the gain, the test and the update. U is stored by columns, as
U' (m, n), so that every inner loop runs along a row. Source: Bar-Shalom, Li and Kirubarajan 2001, ch. 5, rearranged.

The short functions are compiled into their callers, since a call takes as long as their arithmetic. Those that divide
are inlined by LLVM (``forceinline``) and not by numba: numba would let the caller decide what a division by zero does.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.kernels import njit

N = 9
"""Attitude, velocity and position."""
USUAL = 15
"""States of most filters. Every function over the states is compiled with this number as a constant, too. The compiler
then unrolls its inner loops, which takes a third to a half of the time away and leaves the bits as they are."""


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def predict_error(columns: Floats, noise: Floats, error: Floats, work: Floats) -> None:
    """x <- Φ x + w.

    Args:
        columns: the first nine rows of Φ, stored by columns so that the inner loop is a vector operation, (w, 9).
        noise: w, (n,).
        error: x, (n,), in place.
        work: (9,).
    """
    n, width = error.shape[0], columns.shape[0]
    if n == USUAL and width == USUAL:
        _predict_error(USUAL, USUAL, columns, noise, error, work)
    else:
        _predict_error(n, width, columns, noise, error, work)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _predict_error(n: int, width: int, columns: Floats, noise: Floats, error: Floats, work: Floats) -> None:
    for i in range(N):
        work[i] = noise[i]
    for j in range(width):
        factor = error[j]
        for i in range(N):
            work[i] += columns[j, i] * factor
    for i in range(N):
        error[i] = work[i]
    for i in range(N, n):
        error[i] += noise[i]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def predict_mean(transition: Floats, error: Floats, work: Floats) -> None:
    """x <- Φ x, for a Φ stored by rows.

    Args:
        transition: first nine rows of Φ, (9, w).
        error: x, (w,) at least, in place.
        work: (9,).
    """
    width = transition.shape[1]
    if width == USUAL:
        _predict_mean(USUAL, transition, error, work)
    else:
        _predict_mean(width, transition, error, work)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _predict_mean(width: int, transition: Floats, error: Floats, work: Floats) -> None:
    for i in range(N):
        work[i] = 0.0
        for j in range(width):
            work[i] += transition[i, j] * error[j]
    for i in range(N):
        error[i] = work[i]


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def predict_covariance(transition: Floats, process_noise: Floats, covariance: Floats, work: Floats) -> None:
    """P <- Φ P Φ' + Q.

    Args:
        transition: first nine rows of Φ, (9, w).
        process_noise: Q, (n, n).
        covariance: P, (n, n), in place.
        work: (9, n).
    """
    n, width = covariance.shape[0], transition.shape[1]
    if n == USUAL and width == USUAL:
        _predict_covariance(USUAL, USUAL, transition, process_noise, covariance, work)
    else:
        _predict_covariance(n, width, transition, process_noise, covariance, work)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _predict_covariance(
    n: int, width: int, transition: Floats, process_noise: Floats, covariance: Floats, work: Floats
) -> None:
    for i in range(N):
        for j in range(n):
            work[i, j] = 0.0
        for k in range(width):
            factor = transition[i, k]
            for j in range(n):
                work[i, j] += factor * covariance[k, j]
    for i in range(N):
        for j in range(i + 1):
            total = process_noise[i, j]
            for k in range(width):
                total += work[i, k] * transition[j, k]
            covariance[i, j] = total
            covariance[j, i] = total
        for j in range(N, n):
            covariance[i, j] = work[i, j] + process_noise[i, j]
            covariance[j, i] = covariance[i, j]
    for i in range(N, n):
        for j in range(N, n):
            covariance[i, j] += process_noise[i, j]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def innovation_covariance(
    covariance: Floats, observation: Floats, noise_covariance: Floats, cross: Floats, innovation: Floats
) -> None:
    """HP and S = H P H' + R.

    Args:
        covariance: P, (n, n).
        observation: H, (m, h); mostly zeros, which cost nothing.
        noise_covariance: R, (m, m).
        cross: HP, (m, n), overwritten.
        innovation: S, (m, m), overwritten.
    """
    n, observed = cross.shape[1], observation.shape[1]
    if n == USUAL and observed == N:
        _innovation_covariance(USUAL, N, covariance, observation, noise_covariance, cross, innovation)
    else:
        _innovation_covariance(n, observed, covariance, observation, noise_covariance, cross, innovation)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _innovation_covariance(
    n: int,
    observed: int,
    covariance: Floats,
    observation: Floats,
    noise_covariance: Floats,
    cross: Floats,
    innovation: Floats,
) -> None:
    m = observation.shape[0]
    for a in range(m):
        for j in range(n):
            cross[a, j] = 0.0
        for k in range(observed):
            factor = observation[a, k]
            if factor != 0.0:
                for j in range(n):
                    cross[a, j] += factor * covariance[k, j]
    for a in range(m):
        for b in range(m):
            total = noise_covariance[a, b]
            for k in range(observed):
                total += observation[a, k] * cross[b, k]
            innovation[a, b] = total


@njit(cache=True, nogil=True, error_model="numpy")
def scale_noise(scale: float, noise_covariance: Floats, innovation: Floats) -> None:
    """S <- S + (scale - 1) R: the innovation covariance of a fix whose R is ``scale`` times larger; (m, m)."""
    if scale != 1.0:
        for a in range(innovation.shape[0]):
            for b in range(innovation.shape[1]):
                innovation[a, b] += (scale - 1.0) * noise_covariance[a, b]


@njit(cache=True, nogil=True, error_model="numpy")
def forget_correlations(state: int, variance: float, covariance: Floats) -> None:
    """One state gets a new variance and is correlated with no other; covariance (n, n) in place."""
    for i in range(covariance.shape[0]):
        covariance[state, i] = 0.0
        covariance[i, state] = 0.0
    covariance[state, state] = variance


@njit(cache=True, nogil=True, error_model="numpy")
def cholesky(matrix: Floats, factor: Floats) -> None:
    """Lower L with matrix = L L'; (m, m)."""
    m = matrix.shape[0]
    for i in range(m):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i == j:
                factor[i, i] = np.sqrt(total)
            else:
                factor[i, j] = total / factor[j, j]
                factor[j, i] = 0.0


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def whitened_gain(cross: Floats, factor: Floats, gain: Floats) -> None:
    """U' = L⁻¹ H P.

    Args:
        cross: HP, (m, n).
        factor: L, (m, m).
        gain: U', (m, n), overwritten.
    """
    n = gain.shape[1]
    if n == USUAL:
        _whitened_gain(USUAL, cross, factor, gain)
    else:
        _whitened_gain(n, cross, factor, gain)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _whitened_gain(n: int, cross: Floats, factor: Floats, gain: Floats) -> None:
    for a in range(factor.shape[0]):
        for i in range(n):
            gain[a, i] = cross[a, i]
        for b in range(a):
            share = factor[a, b]
            for i in range(n):
                gain[a, i] -= share * gain[b, i]
        scale = 1.0 / factor[a, a]
        for i in range(n):
            gain[a, i] *= scale


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def whiten(factor: Floats, residual: Floats, whitened: Floats) -> float:
    """w = L⁻¹ z, and the NIS w' w.

    Args:
        factor: L, (m, m).
        residual: z, (m,).
        whitened: w, (m,), overwritten.
    """
    nis = 0.0
    for a in range(factor.shape[0]):
        total = residual[a]
        for b in range(a):
            total -= factor[a, b] * whitened[b]
        whitened[a] = total / factor[a, a]
        nis += whitened[a] * whitened[a]
    return nis


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def update_covariance(gain: Floats, covariance: Floats) -> None:
    """P <- P - U U'; gain U' (m, n), covariance (n, n) in place.

    Whole rows are faster than the lower triangle alone; it is mirrored, since the last bits of both halves may differ.
    """
    n = covariance.shape[0]
    if n == USUAL:
        _update_covariance(USUAL, gain, covariance)
    else:
        _update_covariance(n, gain, covariance)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _update_covariance(n: int, gain: Floats, covariance: Floats) -> None:
    for i in range(n):
        for a in range(gain.shape[0]):
            factor = gain[a, i]
            for j in range(n):
                covariance[i, j] -= factor * gain[a, j]
        for j in range(i):
            covariance[j, i] = covariance[i, j]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def correct_error(gain: Floats, whitened: Floats, error: Floats) -> None:
    """x <- x - K z = x - U w; gain U' (m, n), whitened w (m,), error x (n,) in place."""
    n = gain.shape[1]
    if n == USUAL:
        _correct_error(USUAL, gain, whitened, error)
    else:
        _correct_error(n, gain, whitened, error)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _correct_error(n: int, gain: Floats, whitened: Floats, error: Floats) -> None:
    for a in range(gain.shape[0]):
        factor = whitened[a]
        for i in range(n):
            error[i] -= gain[a, i] * factor
