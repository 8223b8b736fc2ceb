"""The geometric median of a mixture of Gaussians in the plane: the estimate whose expected error is least.

For a round Gaussian with standard deviation σ per axis, E|x - N(m, σ² I)| = σ g(|x - m| / σ), the mean of a Rice
distribution: g(q) = √(π/2) 1F1(-1/2; 1; -q²/2). It is concave in q², so each step to the weighted mean with weights
g'(q) / (q σ) lessens the expected error, as Weiszfeld's does for points.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import hyp1f1

from spoofgym.arrays import Floats
from spoofgym.kernels import njit

STEPS = 30
CLOSE = 1e-3
"""A step shorter than this is the last, m."""
FAR = 8.0
"""Distance in standard deviations from which g is a series."""
PER_UNIT = 128.0


class Rice(NamedTuple):
    """Tables over q = 0..FAR in steps of 1 / 128.

    Attributes:
        mean: g(q).
        pull: g'(q) / q.
    """

    mean: Floats
    pull: Floats


@cache
def rice() -> Rice:
    """The tables."""
    q = np.arange(int(FAR * PER_UNIT) + 2) / PER_UNIT
    scale = math.sqrt(0.5 * math.pi)
    return Rice(scale * hyp1f1(-0.5, 1.0, -0.5 * q**2), 0.5 * scale * hyp1f1(0.5, 2.0, -0.5 * q**2))


@njit(cache=True, nogil=True, error_model="numpy")
def _looked_up(table: Floats, q: float) -> float:
    place = q * PER_UNIT
    below = int(place)
    part = place - below
    return (1.0 - part) * table[below] + part * table[below + 1]


@njit(cache=True, nogil=True, error_model="numpy")
def expected_distance(parts: Floats, x: float, y: float, tables: Rice) -> float:
    """Expected distance of a point from a mixture.

    Args:
        parts: weight, mean (2) and standard deviation per axis of each Gaussian, (M, 4); the weights sum to 1.
        x: of the point.
        y: of the point.
        tables: of `rice`.
    """
    total = 0.0
    for i in range(len(parts)):
        deviation = parts[i, 3]
        q = math.hypot(x - parts[i, 1], y - parts[i, 2]) / deviation
        mean = _looked_up(tables.mean, q) if q < FAR else q + (0.5 + 0.125 / (q * q)) / q
        total += parts[i, 0] * deviation * mean
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def geometric_median(parts: Floats, start: tuple[float, float], tables: Rice) -> tuple[float, float]:
    """The point whose expected distance from a mixture is least.

    Args:
        parts: of the mixture, (M, 4), as for `expected_distance`.
        start: where the search begins.
        tables: of `rice`.
    """
    x, y = start
    for _ in range(STEPS):
        total = right = up = 0.0
        for i in range(len(parts)):
            q = math.hypot(x - parts[i, 1], y - parts[i, 2]) / parts[i, 3]
            pull = _looked_up(tables.pull, q) if q < FAR else (1.0 - 0.5 / (q * q)) / q
            pull *= parts[i, 0] / parts[i, 3]
            total += pull
            right += pull * parts[i, 1]
            up += pull * parts[i, 2]
        moved = math.hypot(right / total - x, up / total - y)
        x, y = right / total, up / total
        if moved < CLOSE:
            break
    return x, y
