"""What no attack can exceed against the snapshot test, whatever its offsets: the upper bound without limits.

Aim at a direction d. Only the part of u_k along the gain g_k = |d' G_k| helps, so an epoch spends x_k >= 0 and the
problem separates:

    maximise  log Σ_k g_k x_k + Σ_k h(x_k),      h(x) = log P(χ²_m(x²) <= threshold), concave (see `survival`).

The logarithm lies below its tangents: log y <= log E - 1 + y / E for every E > 0. So for every E

    log-score <= log E - 1 + Σ_k max_x [g_k x / E + h(x)]                                                    (the dual),

where each maximum is a search of one variable, and h'(x) = -g_k / E there. At the E for which Σ g_k x_k = E the attack
x attains the right-hand side: the bound is sharp. It is what a dynamic programme over the accumulated error converges
to (`dynamic_programme`, which checks it and does not use concavity), without a grid of errors. Directions form a grid
of spacing δ; the direction of any error lies within δ/2 of one, so dividing by cos(δ/2) covers all others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.optimum.response import error_response, horizontal_unit
from spoofgym.optimum.survival import check_threshold, log_survival_and_slope

NUM_DIRECTIONS = 180
NUM_SPENDINGS = 20001


@dataclass(frozen=True)
class UpperBound:
    """The upper bound, and how near an attack comes to it.

    Attributes:
        score: no attack without limits has a larger error times survival, m.
        attained: score of the best attack found, m; for position fixes offsets can provoke it, with velocity (m = 6)
            perhaps not.
        azimuth: direction of its error, degrees clockwise from north, in [0, 180).
        spending: |u_k| of that attack, (K,).
    """

    score: float
    attained: float
    azimuth: float
    spending: Floats


def upper_bound(model: LinearModel, threshold: float) -> UpperBound:
    """The largest error times survival of any sequence of offsets against the snapshot test.

    Args:
        model: the filter along the scenario.
        threshold: of the snapshot test.

    Raises:
        ValueError: a threshold that is not positive.
    """
    threshold = check_threshold(threshold)
    response = error_response(model, model.num_epochs)
    azimuth: Floats = np.linspace(0.0, 180.0, NUM_DIRECTIONS, endpoint=False)
    gain = aimed_gain(response, azimuth)
    spending, log_attained, log_bound = separable_optimum(gain, model.dimension, threshold)
    best = int(np.argmax(log_attained))
    slack = 1.0 / math.cos(0.5 * math.pi / NUM_DIRECTIONS)
    return UpperBound(
        score=slack * math.exp(log_bound.max()),
        attained=math.exp(log_attained[best]),
        azimuth=float(azimuth[best]),
        spending=spending[best],
    )


def aimed_gain(response: Floats, azimuth: Floats) -> Floats:
    """Error along a direction per unit of |u_k| spent along its gain, g_k = |d' G_k|.

    Args:
        response: G_k, (2, K, m), m.
        azimuth: (A,), degrees clockwise from north.

    Returns:
        (A, K), m.
    """
    return np.linalg.norm(np.einsum("aj,jkm->akm", horizontal_unit(azimuth), response), axis=-1)


def separable_optimum(gain: Floats, dimension: int, threshold: float) -> tuple[Floats, Floats, Floats]:
    """Solve the separable problem of every direction.

    The inverse of -h' comes from a table; E by bisection, since Σ g x(g/E) falls and E rises. Since x h'(x) >= -1 at a
    solution and -h'(x) >= x - √threshold, no epoch spends more than √threshold + 1. The bound allows for the error of
    the table: by concavity g x / E + h(x) exceeds its value at the tabulated x by at most |g/E + h'| times the length
    of the interval where the maximum lies.

    Args:
        gain: g_k of each direction, (A, K), m.
        dimension: m of the fix.
        threshold: of the snapshot test.

    Returns:
        spending x (A, K), log-score attained (A,), upper bound of the log-score (A,).
    """
    reach = math.sqrt(threshold) + 1.0
    grid = np.linspace(0.0, reach, NUM_SPENDINGS)
    pull = _pull(grid, dimension, threshold)
    low, high = np.zeros(len(gain)), reach * gain.sum(axis=1)
    for _ in range(60):
        middle = 0.5 * (low + high)
        spending = np.interp(gain / middle[:, None], pull, grid)
        short = (gain * spending).sum(axis=1) < middle
        low, high = np.where(short, low, middle), np.where(short, middle, high)
    spending = np.interp(gain / high[:, None], pull, grid)
    error = (gain * spending).sum(axis=1)
    log_survival = log_survival_and_slope(spending, dimension, threshold)[0].sum(axis=1)
    price = gain / error[:, None]
    missed = np.abs(price - _pull(spending, dimension, threshold)) * (math.sqrt(threshold) + price)
    log_attained = np.log(error) + log_survival
    return spending, log_attained, log_attained + missed.sum(axis=1)


def _pull(spending: Floats, dimension: int, threshold: float) -> Floats:
    """-h'(x), the fall of the log-survival per unit of |u|, same shape as x."""
    slope: Floats = log_survival_and_slope(spending, dimension, threshold)[1]
    return -2.0 * spending * slope
