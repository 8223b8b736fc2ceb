"""The generalised chi-square distribution: a sum Q = Σ λ_i y_i² of independent standard normal y_i, with λ_i >= 0.

It is the distribution of x' A x for normal x with mean zero and covariance Σ; the λ are the eigenvalues of Σ^½ A Σ^½
(Mathai and Provost 1992). With K(s) = -½ Σ log(1 - 2 s λ_i) the logarithm of its moment generating function, the saddle
point s of x is where K'(s) = x. Everything is written in t = 1 - 2 s λ_max, which keeps its digits in both tails.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import special

from spoofgym.arrays import Floats

LEAST, LARGEST = 1e-290, 1e15
"""Below and above these multiples of the greatest weight, Q counts as never so small and never so large."""
NEAR = 0.05
"""Within so many deviations of the mean the formula is 0 / 0 and is interpolated."""
NODES = np.array([-2.0, -1.0, 1.0, 2.0]) * NEAR
NEWTON_STEPS = 200
TOLERANCE = 4.0 * np.finfo(float).eps
CLEAR_OF_POLE = 0.25
"""Least distance between the path of the integral and its pole at 0, over one by the standard deviation."""
STEP = 0.05
STEPS = (np.arange(110) + 0.5) * STEP
"""Of the integral: no error above 1e-9 was seen, for one weight or many."""


def cdf(x: Floats | float, weights: Floats) -> Floats:
    """P(Q <= x); arguments and errors as in `log_cdf`. Below 1e-308 it is 0: take `log_cdf` there."""
    return np.exp(log_cdf(x, weights))


def log_cdf(x: Floats | float, weights: Floats) -> Floats:
    """log P(Q <= x), by the saddle-point approximation.

    Lugannani and Rice (1980) with the term of second order (Daniels 1987). The relative error is below a thousandth for
    ten equal weights or more, in every tail, and can reach a tenth where one weight outweighs all others: take `imhof`
    there.

    Args:
        x: of any shape that fits the leading axes of ``weights``.
        weights: λ, (..., m), the unit of ``x``. Zeros count for nothing, so that rows of several lengths can be padded.

    Returns:
        of the shape of ``x`` and the leading axes together.

    Raises:
        ValueError: a weight is negative or not finite, all weights of a row are zero, or ``x`` is nan.
    """
    return _log_tails(x, weights)[0]


def log_sf(x: Floats | float, weights: Floats) -> Floats:
    """log P(Q > x); arguments, method and errors as in `log_cdf`."""
    return _log_tails(x, weights)[1]


def imhof(x: float, weights: Floats) -> tuple[float, float]:
    """P(Q <= x) and P(Q > x), by numerical inversion of the characteristic function: exact to about 1e-9.

    Imhof (1961) integrates along the imaginary axis, where the tails drown in rounding. Here the path crosses the real
    axis at the saddle point and bends as the path of steepest descent does there (Rice 1980): the smaller of the two
    values keeps its digits. Some ten times slower than the approximation.

    Args:
        x: one value.
        weights: λ, (m,), the unit of ``x``.

    Raises:
        ValueError: as `log_cdf`, or an argument has more axes.
    """
    if np.ndim(x) != 0 or np.ndim(weights) != 1:
        raise ValueError(f"imhof: x must be one number, weights (m,); got shapes {np.shape(x)} and {np.shape(weights)}")
    place, share = _scaled(x, weights)
    if place < LEAST or place > LARGEST:
        return (0.0, 1.0) if place < LEAST else (1.0, 0.0)
    least = CLEAR_OF_POLE / float(_moments(share)[1])
    crossing = 0.5 * (1.0 - float(_saddle(place, share)))
    if abs(crossing) < least:
        crossing = -least
    value = _along_path(float(place), share, crossing)
    return (1.0 - value, value) if crossing > 0.0 else (-value, 1.0 + value)


def _along_path(x: float, weights: Floats, crossing: float) -> float:
    """(1 / 2πi) ∫ exp(K(s) - s x) / s ds along a hyperbola that crosses the real axis at ``crossing``.

    P(Q > x) where it crosses to the right of 0, else -P(Q <= x). A parabola, the shape of the steepest descent, would
    come too close to the singularities of small weights beside a great one; the hyperbola has its curvature where both
    cross the axis. With y = sinh(τ) the sum over equal steps of τ converges exponentially.
    """
    tilted = weights / (1.0 - 2.0 * crossing * weights)
    unit = float(tilted.max())
    tilted, pole = tilted / unit, crossing * unit
    second, third = 2.0 * float(np.sum(tilted**2)), 8.0 * float(np.sum(tilted**3))
    bend = third / (3.0 * second)
    y, slope = np.sinh(STEPS) / math.sqrt(second), np.cosh(STEPS) / math.sqrt(second)
    root = np.sqrt(1.0 + (bend * y) ** 2)
    step = (root - 1.0) / bend + 1j * y
    exponent = -0.5 * np.log(1.0 - 2.0 * step[:, None] * tilted).sum(axis=1) - step * (x / unit)
    integrand = np.exp(exponent) / (pole + step) * (bend * y / root + 1j) * slope
    peak = -0.5 * float(np.sum(np.log1p(-2.0 * crossing * weights))) - crossing * x
    return math.exp(peak) * float(integrand.imag.sum()) * STEP / math.pi


def _scaled(x: Floats | float, weights: Floats) -> tuple[Floats, Floats]:
    """x and the weights over the greatest weight, checked; (...) and (..., m)."""
    weights, x = np.asarray(weights, dtype=np.float64), np.asarray(x, dtype=np.float64)
    if weights.ndim == 0 or not np.all(np.isfinite(weights) & (weights >= 0.0)):
        raise ValueError(f"quadratic form: weights must be finite numbers, 0 or more, along an axis, got {weights!r}")
    greatest = weights.max(axis=-1, initial=0.0)
    if np.any(greatest == 0.0):
        raise ValueError("quadratic form: one weight at least must be greater than 0, got none")
    if np.any(np.isnan(x)):
        raise ValueError(f"quadratic form: x must be a number, got {x!r}")
    place = x / greatest
    share = weights / greatest[..., None]
    return place, np.broadcast_to(share, (*place.shape, share.shape[-1]))


def _moments(weights: Floats) -> tuple[Floats, Floats]:
    """Mean and standard deviation of Q."""
    return weights.sum(axis=-1), np.sqrt(2.0 * (weights**2).sum(axis=-1))


def _log_tails(x: Floats | float, weights: Floats) -> tuple[Floats, Floats]:
    """log P(Q <= x) and log P(Q > x)."""
    place, share = _scaled(x, weights)
    mean, deviation = _moments(share)
    normal = (place - mean) / deviation
    middle = np.abs(normal) < NEAR
    # anything but the mean, where the formula cannot be computed
    lower, upper = _lugannani_rice(np.where(middle, 2.0 * mean, np.clip(place, LEAST, LARGEST)), share)
    if np.any(middle):
        between = _interpolated(np.where(middle, normal, 0.0), mean, deviation, share)
        lower, upper = np.where(middle, np.log(between), lower), np.where(middle, np.log1p(-between), upper)
    none, all_of_it = place < LEAST, place > LARGEST
    lower = np.where(none, -np.inf, np.where(all_of_it, 0.0, lower))
    upper = np.where(none, 0.0, np.where(all_of_it, -np.inf, upper))
    return lower, upper


def _interpolated(normal: Floats, mean: Floats, deviation: Floats, share: Floats) -> Floats:
    """P(Q <= mean + normal · deviation) close to the mean: the cubic through four values about it."""
    result = np.zeros_like(normal)
    for j, node in enumerate(NODES):
        others = np.delete(NODES, j)
        basis = np.prod([(normal - other) / (node - other) for other in others], axis=0)
        result += basis * np.exp(_lugannani_rice(mean + node * deviation, share)[0])
    return result


def _lugannani_rice(x: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """log P(Q <= x) and log P(Q > x) away from the mean, where the greatest weight is 1.

    With w = sign(s) √(2 (s x - K)), u = s √K'' and κ_3, κ_4 the standardised cumulants at the saddle point,

        P(Q > x) = 1 - Φ(w) + φ(w) { 1/u - 1/w + (κ_4/8 - 5 κ_3²/24) / u - 1/u³ - κ_3/(2 u²) + 1/w³ }.

    The tail is taken out of φ(w), so that nothing underflows. w² is summed from terms that are all positive.
    """
    t = _saddle(x, weights)
    below = weights * (t[..., None] - 1.0)  # -2 s λ
    tilt = (1.0 - weights) + weights * t[..., None]
    tilted = weights / tilt
    greatest = tilted.max(axis=-1)
    ratio = tilted / greatest[..., None]  # far down in the lower tail the squares of `tilted` underflow
    square = (ratio**2).sum(axis=-1)
    third = math.sqrt(8.0) * (ratio**3).sum(axis=-1) / square**1.5
    fourth = 12.0 * (ratio**4).sum(axis=-1) / square**2
    side = np.sign(1.0 - t)
    w = side * np.sqrt((np.log1p(below) - below / tilt).sum(axis=-1))
    u = (1.0 - t) * greatest * np.sqrt(0.5 * square)
    first_order = 1.0 / u - 1.0 / w
    second_order = (fourth / 8.0 - 5.0 * third**2 / 24.0) / u - 1.0 / u**3 - third / (2.0 * u**2) + 1.0 / w**3
    mills = math.sqrt(0.5 * math.pi) * special.erfcx(np.abs(w) / math.sqrt(2.0))
    tail = np.log(mills + side * (first_order + second_order)) - 0.5 * w**2 - 0.5 * math.log(2.0 * math.pi)
    rest = np.log1p(-np.exp(tail))
    return np.where(side < 0.0, tail, rest), np.where(side < 0.0, rest, tail)


def _saddle(x: Floats, weights: Floats) -> Floats:
    """t = 1 - 2 s with K'(s) = Σ λ / (1 - λ + λ t) = x, where the greatest weight is 1.

    1 / K' is concave and rises with t, and K' >= x at t = 1 / x: Newton's steps from there come to the root from one
    side and need no bracket, however small x is.
    """
    t = 1.0 / x
    for _ in range(NEWTON_STEPS):
        tilted = weights / ((1.0 - weights) + weights * t[..., None])
        greatest = tilted.max(axis=-1)
        ratio = tilted / greatest[..., None]
        total = ratio.sum(axis=-1)
        step = total / (ratio**2).sum(axis=-1) * (total / x - 1.0 / greatest)
        t = t + step
        if np.all(np.abs(step) <= TOLERANCE * t):
            break
    return t
