"""Tests that are linear in the whitened innovations, as rows of a linear programme.

Every statistic here has variance 1 on clean white innovations, so that a limit is a number of standard deviations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.geodesy import AXIS_LETTERS

FORGOTTEN = 1e-12
"""Share of its first weight below which an EWMA has forgotten an epoch."""


@dataclass(frozen=True, eq=False)
class LinearTest:
    """Alarm where |Σ_j weights_j · u_{k-j}| exceeds a limit.

    Attributes:
        name: what it is called where it binds.
        weights: of the epoch j epochs ago on each axis, (n, m).
        limit: of the statistic.

    Raises:
        ValueError: weights that are not finite or of another shape, or a limit that is not positive.
    """

    name: str
    weights: Floats
    limit: float

    def __post_init__(self) -> None:
        weights = validation.real_array(self.weights)
        if weights is None or weights.ndim != 2 or not weights.size or not np.isfinite(weights).all():
            given = validation.shown(self.weights)
            raise ValueError(f"linear test {self.name!r}: weights must be finite and of shape (n, m), got {given}")
        object.__setattr__(self, "weights", weights)
        validation.above(f"linear test {self.name!r}", "limit", self.limit)

    def rows(self, num_epochs: int, dimension: int) -> sparse.csr_matrix:
        """The statistic of epochs 1..K on u (K * m,), with nothing but noise before epoch 1, (K, K * m).

        Raises:
            ValueError: the test has another dimension.
        """
        if self.weights.shape[1] != dimension:
            raise ValueError(
                f"linear test {self.name!r} has weights for m = {self.weights.shape[1]}, the fixes have m = {dimension}"
            )
        epoch, source = np.nonzero(np.tri(num_epochs, dtype=bool))
        recent = epoch - source < len(self.weights)
        epoch, source = epoch[recent], source[recent]
        values = self.weights[epoch - source]
        columns = source[:, None] * dimension + np.arange(dimension)
        rows = sparse.csr_matrix(
            (values.reshape(-1), (np.repeat(epoch, dimension), columns.reshape(-1))),
            shape=(num_epochs, num_epochs * dimension),
        )
        rows.eliminate_zeros()
        return rows


def gate(limit: float) -> list[LinearTest]:
    """|u| of each axis of a position fix against a limit, standard deviations."""
    return per_axis("gate", np.ones(1), limit)


def window_mean(n: int, limit: float) -> list[LinearTest]:
    """√n |mean of the last n| of each axis against a limit, standard deviations of the mean.

    Raises:
        ValueError: a window of less than one epoch.
    """
    n = validation.epochs("window_mean", "n", n)
    return per_axis(f"window-mean:{n}", np.full(n, 1.0 / math.sqrt(n)), limit)


LEAST_WEIGHT = 3e-4
"""Of λ: a smaller one remembers more epochs than games have."""


def ewma(weight: float, limit: float) -> list[LinearTest]:
    """The exponentially weighted mean w <- (1 - λ) w + λ u of each axis against a limit in its standard deviations.

    The standard deviation is that of the steady state, √(λ / (2 - λ)) (Roberts 1959).

    Args:
        weight: λ, above 0 and at most 1.
        limit: standard deviations.

    Raises:
        ValueError: a weight out of range.
    """
    weight = validation.above("ewma", "weight", weight)
    if weight < LEAST_WEIGHT:
        raise ValueError(f"ewma: weight must be {LEAST_WEIGHT} or more, got {weight!r}")
    if weight > 1.0:
        raise ValueError(f"ewma: weight must be at most 1, got {weight!r}")
    length = 1 if weight == 1.0 else math.ceil(math.log(FORGOTTEN) / math.log1p(-weight))
    weights: Floats = math.sqrt(weight * (2.0 - weight)) * np.power(1.0 - weight, np.arange(length), dtype=np.float64)
    return per_axis(f"ewma:{validation.written(weight)}", weights, limit)


def per_axis(name: str, weights: Floats, limit: float) -> list[LinearTest]:
    """The same weights (n,) on each axis of a position fix by itself: one test per axis."""
    return [
        LinearTest(f"{name} {letter}", weights[:, None] * np.eye(3)[axis], limit)
        for axis, letter in enumerate(AXIS_LETTERS)
    ]
