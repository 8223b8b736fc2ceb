"""The innovation in the position domain: what measurements of any kind say about the three axes of the position.

Kujur 2024, eqs 17-20: the innovation γ with covariance S and observation matrix H projects onto a direction u as
u'H'S⁻¹γ, of variance u'H'S⁻¹H u. With the whitened innovation w = L⁻¹ γ and W = L⁻¹ H these are u'W'w and u'W'W u.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, read_only
from spoofgym.kernels import njit
from spoofgym.navigation import kalman

OBSERVED = 1e-12
"""Smallest pivot of the correlation matrix of W'W at which its three directions count as observed."""


def whitened_axes(covariance: Floats) -> Floats:
    """L⁻¹ on the first three components, (N, m, 3): the response of a fix of position, for S (N, m, m)."""
    n, m, _ = covariance.shape
    response = np.empty((n, m, 3))
    _whiten_axes(read_only(covariance), response)
    return response


@njit(cache=True, nogil=True, error_model="numpy")
def _whiten_axes(covariance: Floats, response: Floats) -> None:
    m = covariance.shape[1]
    factor = np.empty((m, m))
    for run in range(len(covariance)):
        kalman.cholesky(covariance[run], factor)
        for a in range(m):
            for c in range(3):
                total = 1.0 if a == c else 0.0
                for b in range(a):
                    total -= factor[a, b] * response[run, b, c]
                response[run, a, c] = total / factor[a, a]


@njit(cache=True, nogil=True, error_model="numpy")
def project_onto_position(
    response: Floats, whitened: Floats, residual: Floats, covariance: Floats, axes: Floats, nis: Floats
) -> None:
    """Generalised least squares of the position: A = W'W, residual A⁻¹ W'w, covariance A⁻¹, and its whitened form.

    Args:
        response: W, (N, m, 3).
        whitened: w, (N, m).
        residual: (N, 3), m, overwritten; zero where a direction is not observed.
        covariance: (N, 3, 3), m², overwritten; the identity where a direction is not observed.
        axes: C⁻¹ residual with A⁻¹ = C C', C lower, (N, 3), overwritten.
        nis: squared norm of the last, (N,), overwritten.
    """
    information, projected, factor = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    for run in range(len(nis)):
        for i in range(3):
            projected[i] = 0.0
            for j in range(i + 1):
                information[i, j] = 0.0
        for a in range(whitened.shape[1]):
            for i in range(3):
                projected[i] += response[run, a, i] * whitened[run, a]
                for j in range(i + 1):
                    information[i, j] += response[run, a, i] * response[run, a, j]
        if not _invert(information, covariance[run]):
            for i in range(3):
                residual[run, i], axes[run, i] = 0.0, 0.0
                for j in range(3):
                    covariance[run, i, j] = 1.0 if i == j else 0.0
            nis[run] = 0.0
            continue
        for i in range(3):
            residual[run, i] = 0.0
            for j in range(3):
                residual[run, i] += covariance[run, i, j] * projected[j]
        kalman.cholesky(covariance[run], factor)
        nis[run] = kalman.whiten(factor, residual[run], axes[run])


@njit(cache=True, nogil=True, error_model="numpy")
def _invert(lower: Floats, inverse: Floats) -> bool:
    """Inverse of a symmetric (3, 3) matrix, of which the lower triangle is read; whether it is positive definite."""
    a, b, c = lower[0, 0], lower[1, 1], lower[2, 2]
    d, e, f = lower[1, 0], lower[2, 0], lower[2, 1]
    determinant = a * (b * c - f * f) - d * (d * c - e * f) + e * (d * f - e * b)
    if not determinant > OBSERVED * a * b * c:
        return False
    inverse[0, 0] = (b * c - f * f) / determinant
    inverse[1, 1] = (a * c - e * e) / determinant
    inverse[2, 2] = (a * b - d * d) / determinant
    inverse[1, 0] = (e * f - d * c) / determinant
    inverse[2, 0] = (d * f - e * b) / determinant
    inverse[2, 1] = (d * e - a * f) / determinant
    inverse[0, 1], inverse[0, 2], inverse[1, 2] = inverse[1, 0], inverse[2, 0], inverse[2, 1]
    return True
