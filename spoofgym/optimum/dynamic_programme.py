"""The upper bound approached from below, by a dynamic programme over the accumulated error of one direction.

W_k(n) is the largest log-survival of epochs 1..k with which the error along the direction reaches n steps of a lattice:

    W_k(n) = max_i [W_{k-1}(n - i) + h(i step / g_k)],        score = max_n n step exp(W_K(n)).

Every play on the lattice can be played, so the value never exceeds the upper bound; it falls short of it by something
of second order in the step, which halving the step measures. It does not use the concavity on which `upper_bound`
rests, and so checks it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.kernels import njit
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.optimum.response import error_response
from spoofgym.optimum.survival import check_threshold, log_survival
from spoofgym.optimum.upper_bound import aimed_gain

MAX_HALVINGS = 8


@dataclass(frozen=True)
class Lattice:
    """Value of the dynamic programme.

    Attributes:
        score: best error times survival on the lattice, m.
        azimuth: the direction, degrees clockwise from north.
        step: of the lattice, m.
        change: relative change of the score at the last halving of the step.
    """

    score: float
    azimuth: float
    step: float
    change: float


def dynamic_programme(model: LinearModel, threshold: float, azimuth: float, tolerance: float = 1e-3) -> Lattice:
    """The best attack without limits in one direction, on a lattice of errors fine enough.

    The step starts at the error of an epoch that spends one whitened sigma, and is halved until the score changes by
    less than ``tolerance`` of itself.

    Args:
        model: the filter along the scenario.
        threshold: of the snapshot test.
        azimuth: direction, degrees clockwise from north.
        tolerance: largest relative change at the last halving.

    Raises:
        ValueError: a threshold or tolerance that is not positive.
        RuntimeError: the score still changes after eight halvings.
    """
    threshold = check_threshold(threshold)
    tolerance = validation.above("dynamic_programme", "tolerance", tolerance)
    azimuth = validation.finite("dynamic_programme", "azimuth", azimuth)
    gain = aimed_gain(error_response(model, model.num_epochs), np.array([azimuth]))[0]
    step = float(np.median(gain))
    coarse = _lattice_score(gain, step, model.dimension, threshold)
    for _ in range(MAX_HALVINGS):
        step *= 0.5
        fine = _lattice_score(gain, step, model.dimension, threshold)
        change = fine / coarse - 1.0 if coarse > 0.0 else math.inf
        if change < tolerance:
            return Lattice(fine, azimuth, step, change)
        coarse = fine
    raise RuntimeError(f"dynamic_programme: the score still changes by {change:.2g} after {MAX_HALVINGS} halvings")


def _lattice_score(gain: Floats, step: float, dimension: int, threshold: float) -> float:
    """Best score on the lattice of one step, for gains (K,), m.

    No epoch spends more than √threshold + 1 at an optimum (see `upper_bound.separable_optimum`).
    """
    reach = np.floor((math.sqrt(threshold) + 1.0) * gain / step).astype(np.int64)
    most = int(reach.max())
    spending = np.arange(most + 1) * step / np.maximum(gain, 1e-300)[:, None]
    cost = log_survival(np.minimum(spending, math.sqrt(threshold) + 1.0), dimension, threshold)
    worth = _accumulate(reach, cost)
    errors = step * np.arange(1, worth.size)
    return math.exp(float(np.max(np.log(errors) + worth[1:]))) if errors.size else 0.0


@njit(cache=True, nogil=True)
def _accumulate(reach: np.ndarray, cost: Floats) -> Floats:
    """W_K, (Σ reach + 1,): reach of each epoch in steps, (K,); cost of i steps in epoch k, (K, max reach + 1)."""
    worth = np.full(reach.sum() + 1, -np.inf)
    worth[0] = 0.0
    top = 0
    for k in range(reach.size):
        following = np.full(worth.size, -np.inf)
        for n in range(top + reach[k] + 1):
            for i in range(max(0, n - top), min(n, reach[k]) + 1):
                following[n] = max(following[n], worth[n - i] + cost[k, i])
        worth = following
        top += reach[k]
    return worth
