"""The equations of the error-state Kalman filter, one run at a time.

Every function works in place on one run's arrays, so that a navigator's loop over runs allocates nothing. The
measurement touches the nine navigation states only (H is (m, 9)), the six bias states are random constants or walks: Φ
= [[Φn, Φb], [0, I]] with rows (9, 15) stored.

The update is written in whitened form: with S = L L', U = P H' L⁻ᵀ and w = L⁻¹ z,

    K z = U w,        P⁺ = P - U U',        NIS = w' w,

which keeps P symmetric and uses one Cholesky factor for the gain, the test and the update. U is stored by columns, as
U' (m, 15), so that every inner loop runs along a row. Source: Bar-Shalom, Li and Kirubarajan 2001, ch. 5, rearranged.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.kernels import njit

N = 9
FULL = 15


@njit(cache=True, nogil=True, error_model="numpy")
def predict_error(columns: Floats, noise: Floats, error: Floats, work: Floats) -> None:
    """x <- Φ x + w.

    Args:
        columns: the first nine rows of Φ, stored by columns so that the inner loop is a vector operation, (15, 9).
        noise: w, (15,).
        error: x, (15,), in place.
        work: (9,).
    """
    for i in range(N):
        work[i] = noise[i]
    for j in range(FULL):
        factor = error[j]
        for i in range(N):
            work[i] += columns[j, i] * factor
    for i in range(N):
        error[i] = work[i]
    for i in range(N, FULL):
        error[i] += noise[i]


@njit(cache=True, nogil=True, error_model="numpy")
def predict_mean(transition: Floats, error: Floats, work: Floats) -> None:
    """x <- Φ x, for a Φ stored by rows.

    Args:
        transition: first nine rows of Φ, (9, 15).
        error: x, (15,), in place.
        work: (9,).
    """
    for i in range(N):
        work[i] = 0.0
        for j in range(FULL):
            work[i] += transition[i, j] * error[j]
    for i in range(N):
        error[i] = work[i]


@njit(cache=True, nogil=True, error_model="numpy")
def predict_covariance(transition: Floats, process_noise: Floats, covariance: Floats, work: Floats) -> None:
    """P <- Φ P Φ' + Q.

    Args:
        transition: first nine rows of Φ, (9, 15).
        process_noise: Q, (15, 15).
        covariance: P, (15, 15), in place.
        work: (9, 15).
    """
    for i in range(N):
        for j in range(FULL):
            work[i, j] = 0.0
        for k in range(FULL):
            factor = transition[i, k]
            for j in range(FULL):
                work[i, j] += factor * covariance[k, j]
    for i in range(N):
        for j in range(i + 1):
            total = process_noise[i, j]
            for k in range(FULL):
                total += work[i, k] * transition[j, k]
            covariance[i, j] = total
            covariance[j, i] = total
        for j in range(N, FULL):
            covariance[i, j] = work[i, j] + process_noise[i, j]
            covariance[j, i] = covariance[i, j]
    for i in range(N, FULL):
        for j in range(N, FULL):
            covariance[i, j] += process_noise[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def innovation_covariance(
    covariance: Floats, observation: Floats, noise_covariance: Floats, cross: Floats, innovation: Floats
) -> None:
    """HP and S = H P H' + R.

    Args:
        covariance: P, (15, 15).
        observation: H, (m, 9); mostly zeros, which cost nothing.
        noise_covariance: R, (m, m).
        cross: HP, (m, 15), overwritten.
        innovation: S, (m, m), overwritten.
    """
    m = observation.shape[0]
    for a in range(m):
        for j in range(FULL):
            cross[a, j] = 0.0
        for k in range(N):
            factor = observation[a, k]
            if factor != 0.0:
                for j in range(FULL):
                    cross[a, j] += factor * covariance[k, j]
    for a in range(m):
        for b in range(m):
            total = noise_covariance[a, b]
            for k in range(N):
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
    """One state gets a new variance and is correlated with no other; covariance (15, 15) in place."""
    for i in range(FULL):
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


@njit(cache=True, nogil=True, error_model="numpy")
def whitened_gain(cross: Floats, factor: Floats, gain: Floats) -> None:
    """U' = L⁻¹ H P.

    Args:
        cross: HP, (m, 15).
        factor: L, (m, m).
        gain: U', (m, 15), overwritten.
    """
    for a in range(factor.shape[0]):
        for i in range(FULL):
            gain[a, i] = cross[a, i]
        for b in range(a):
            share = factor[a, b]
            for i in range(FULL):
                gain[a, i] -= share * gain[b, i]
        scale = 1.0 / factor[a, a]
        for i in range(FULL):
            gain[a, i] *= scale


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
def update_covariance(gain: Floats, covariance: Floats) -> None:
    """P <- P - U U'; gain U' (m, 15), covariance (15, 15) in place.

    Whole rows are faster than the lower triangle alone; it is mirrored, since the last bits of both halves may differ.
    """
    for i in range(FULL):
        for a in range(gain.shape[0]):
            factor = gain[a, i]
            for j in range(FULL):
                covariance[i, j] -= factor * gain[a, j]
        for j in range(i):
            covariance[j, i] = covariance[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def correct_error(gain: Floats, whitened: Floats, error: Floats) -> None:
    """x <- x - K z = x - U w; gain U' (m, 15), whitened w (m,), error x (15,) in place."""
    for a in range(gain.shape[0]):
        factor = whitened[a]
        for i in range(FULL):
            error[i] -= gain[a, i] * factor
