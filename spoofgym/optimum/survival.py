"""What one epoch costs the spoofer: log P(no alarm) of the snapshot test, and its slope.

With mean whitened innovation u the statistic is noncentral chi-square with m degrees of freedom and noncentrality |u|²,
so P(no alarm) = P(χ²_m(|u|²) <= threshold). It is the Gaussian measure of a ball shifted by u, hence log-concave in u
(Prékopa 1973, "On logarithmic concave measures and functions"): every optimum of this package rests on that.

Computed as the Poisson mixture of central distributions (Johnson, Kotz and Balakrishnan, Continuous Univariate
Distributions 2, eq 29.3), F = Σ_j Poisson(j; λ/2) P(m/2 + j, threshold/2), relative to its largest term, so that it
neither underflows nor returns NaN far in the tail.
"""

from __future__ import annotations

import math

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.kernels import njit

# Beyond this distance of |u| from √threshold the leading term of the asymptotic expansion replaces the mixture.
_FAR = 1000.0
LARGEST_THRESHOLD = 2000.0
"""Of the snapshot test: no fix that noise alone makes comes near it. Beyond it a score can have no digits left."""


def check_threshold(threshold: float) -> float:
    """The threshold, if a snapshot test can have it.

    Raises:
        ValueError: the threshold is not a positive number of at most `LARGEST_THRESHOLD`.
    """
    return validation.above("snapshot test", "threshold", threshold, largest=LARGEST_THRESHOLD)


def log_survival(magnitude: Floats, dimension: int, threshold: float) -> Floats:
    """Log-probability that one epoch raises no alarm.

    Args:
        magnitude: |u|, norm of the mean whitened innovation, any shape.
        dimension: m of the fix.
        threshold: of the snapshot test.

    Returns:
        log P(χ²_m(|u|²) <= threshold), same shape.
    """
    return log_survival_and_slope(magnitude, dimension, threshold)[0]


def log_survival_and_slope(magnitude: Floats, dimension: int, threshold: float) -> tuple[Floats, Floats]:
    """`log_survival` and its derivative with respect to the noncentrality |u|².

    Returns:
        both with the shape of ``magnitude``; the derivative with respect to the vector u is 2 slope u.
    """
    flat = np.ascontiguousarray(magnitude, dtype=np.float64).reshape(-1)
    value, slope = np.empty_like(flat), np.empty_like(flat)
    evaluate(flat, dimension, threshold, value, slope)
    return value.reshape(np.shape(magnitude)), slope.reshape(np.shape(magnitude))


@njit(cache=True, nogil=True)
def evaluate(magnitude: Floats, dimension: int, threshold: float, value: Floats, slope: Floats) -> None:
    """Fill ``value`` and ``slope`` (both (n,)) for magnitudes (n,): see `log_survival_and_slope`."""
    root = math.sqrt(threshold)
    largest = 0.0
    for i in range(magnitude.size):
        if magnitude[i] - root <= _FAR:
            largest = max(largest, magnitude[i])
    length = _num_terms(0.5 * largest**2, 0.5 * threshold)
    log_central, fall = _central_survivals(0.5 * dimension, 0.5 * threshold, length)
    for i in range(magnitude.size):
        if magnitude[i] - root > _FAR:
            value[i], slope[i] = _far_tail(magnitude[i], dimension, root)
        else:
            value[i], slope[i] = _mixture(0.5 * magnitude[i] ** 2, log_central, fall)


@njit(cache=True, nogil=True)
def _num_terms(half_noncentrality: float, half_threshold: float) -> int:
    """Terms of the mixture after which the remainder is below 2^-60 of the sum.

    The ratio of term j + 1 to term j is below y / (j + 1) and below y t / (j + 1)², with y = λ/2, t = threshold/2. So
    the largest term comes before min(y, √(y t)), and from twice that on each term is less than half of the one before.
    """
    peak = min(half_noncentrality, math.sqrt(half_noncentrality * half_threshold))
    return int(2.0 * peak) + 64


@njit(cache=True, nogil=True)
def _central_survivals(shape: float, half_threshold: float, length: int) -> tuple[Floats, Floats]:
    """Logarithm of P_j, and 1 - P_{j+1} / P_j, for P_j = P(shape + j, t), j = 0 .. length-1.

    P is the regularised lower incomplete gamma function. By the backward recursion P(a, t) = P(a + 1, t) + t^a e^-t /
    Γ(a + 1) (DLMF 8.8.5), all terms positive, started with the series DLMF 8.7.1.
    """
    log_central, fall = np.empty(length), np.empty(length)
    last = shape + length
    term, total, n = 1.0, 1.0, 0
    while term > 1e-17 * total:
        n += 1
        term *= half_threshold / (last + n)
        total += term
    following = _log_difference(last, half_threshold) + math.log(total)
    for j in range(length - 1, -1, -1):
        difference = _log_difference(shape + j, half_threshold)
        largest = max(following, difference)
        log_central[j] = largest + math.log1p(math.exp(-abs(following - difference)))
        fall[j] = math.exp(difference - log_central[j])
        following = log_central[j]
    return log_central, fall


@njit(cache=True, nogil=True)
def _log_difference(shape: float, half_threshold: float) -> float:
    """The logarithm of P(a, t) - P(a + 1, t) = t^a e^-t / Γ(a + 1)."""
    return shape * math.log(half_threshold) - half_threshold - math.lgamma(shape + 1.0)


@njit(cache=True, nogil=True)
def _mixture(half_noncentrality: float, log_central: Floats, fall: Floats) -> tuple[float, float]:
    """Logarithm of F = Σ_j Poisson(j; y) P_j, and d log F / dλ = -½ Σ_j Poisson(j; y) (P_j - P_{j+1}) / F.

    The terms rise to one peak and fall. They are summed both ways from it, relative to it.
    """
    if half_noncentrality == 0.0:
        return log_central[0], -0.5 * fall[0]
    low, peak = 0, log_central.size - 1
    while low < peak:  # first j whose next term is not larger
        middle = (low + peak) // 2
        if half_noncentrality * (1.0 - fall[middle]) > middle + 1.0:
            low = middle + 1
        else:
            peak = middle
    total, falling = 1.0, fall[peak]
    term, j = 1.0, peak
    while j > 0 and term > 1e-18:
        j -= 1
        term *= (j + 1.0) / (half_noncentrality * (1.0 - fall[j]))
        total += term
        falling += term * fall[j]
    term, j = 1.0, peak
    while j < log_central.size - 1 and term > 1e-18:
        term *= half_noncentrality * (1.0 - fall[j]) / (j + 1.0)
        j += 1
        total += term
        falling += term * fall[j]
    log_peak = peak * math.log(half_noncentrality) - half_noncentrality - math.lgamma(peak + 1.0) + log_central[peak]
    return log_peak + math.log(total), -0.5 * falling / total


@njit(cache=True, nogil=True)
def _far_tail(magnitude: float, dimension: int, root: float) -> tuple[float, float]:
    """Log-probability and slope for |u| far outside the ball (leading term for large argument of the Bessel function).

    F ≈ φ(d) / d · (√threshold / |u|)^((m - 1) / 2) with d = |u| - √threshold; relative error of log F below 1e-9.
    """
    distance = magnitude - root
    power = 0.5 * (dimension - 1)
    value = -0.5 * distance**2 - math.log(distance * math.sqrt(2.0 * math.pi)) + power * math.log(root / magnitude)
    slope = -(distance + 1.0 / distance + power / magnitude) / (2.0 * magnitude)
    return value, slope
