"""Exponentially weighted moving averages of the whitened innovations, axis by axis and of all axes together."""

from __future__ import annotations

import math
from functools import reduce

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.detectors.cusum import LEAST_MEMORY, POSITION, TIME_CONSTANTS
from spoofgym.navigation.interface import Epoch

DEFAULT_WEIGHT = 0.05
LEAST_WEIGHT, MOST_WEIGHT = 3e-4, 1.0 - 1e-9
"""A smaller one forgets its start in no less than 10,000 epochs, a weight of 1 has no memory."""


def forgetting(weight: float) -> int:
    """Epochs in which a moving average forgets its start: three time constants 1 / weight, at least 60."""
    return max(LEAST_MEMORY, math.ceil(TIME_CONSTANTS / weight))


def steady_variance(weight: float) -> float:
    """Variance of the moving average of unit white noise, long after its start: λ / (2 − λ)."""
    return weight / (2.0 - weight)


class _ExponentialAverage(ThresholdDetector):
    """What both tests share: e_i = (1 − λ) e_{i-1} + λ w_i of each axis."""

    def __init__(
        self, weight: float = DEFAULT_WEIGHT, threshold: float | None = None, arl0: float | None = None
    ) -> None:
        share = validation.probability(self.kind, "weight", weight)
        self.weight = validation.between(self.kind, "weight", share, LEAST_WEIGHT, MOST_WEIGHT)
        self.memory = forgetting(self.weight)
        self._variance = steady_variance(self.weight)
        self.set_up(threshold, arl0, weight=self.weight)

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the averages of as many axes."""
        self._mean = np.zeros((num_runs, dimension))

    def reset(self, runs: Runs) -> None:
        """Start the averages of these runs anew, at 0."""
        self._mean[runs] = 0.0

    def _average(self, epoch: Epoch) -> Floats:
        """e, (N, axes), of as many components of w as there are in it."""
        change = self.weight * (epoch.innovation.whitened[:, : self._mean.shape[1]] - self._mean)
        self._mean += change if epoch.available is None else np.where(epoch.available[:, None], change, 0.0)
        return self._mean


class Ewma(_ExponentialAverage):
    """Alarm where the moving average of a whitened position innovation leaves zero, axis by axis (Roberts 1959).

        e_i = (1 − λ) e_{i-1} + λ w_i,      statistic = max over the three axes of |e| / √(λ / (2 − λ))

    Under a matched filter the statistic of an axis is, in the steady state, the modulus of a standard normal number. A
    constant bias b of w shows as |b| √((2 − λ) / λ) in the end: λ = 0.05 remembers about as much as a mean of 39
    epochs, and needs no window. Axes as in `SignedCusum`; a bias that changes its sign faster than it forgets cancels.

    The average starts at 0, and an epoch without a fix leaves it as it is. ARL0 is calibrated. Three axes and the
    default weight are ours.

    Args:
        weight: λ of the newest innovation, between 0 and 1.
        threshold: compared with the statistic, standard deviations.
        arl0: average run length between false alarms, epochs; 1e5 with nothing given.

    Raises:
        ValueError: both of the last two are given, or a value is out of range.
    """

    kind = "ewma"
    in_position = True

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the averages of the position."""
        super().bind(num_runs, POSITION)

    def update(self, epoch: Epoch) -> Floats:
        """The largest average over its standard deviation, (N,)."""
        largest = reduce(np.maximum, np.abs(self._average(epoch)).T)
        return np.asarray(largest / math.sqrt(self._variance))


class Mewma(_ExponentialAverage):
    """Alarm where the moving average of all whitened innovations is long: the multivariate test of Lowry et al. 1992.

        e_i = (1 − λ) e_{i-1} + λ w_i,      statistic = e' Σ⁻¹ e = |e|² (2 − λ) / λ

    Under a matched filter chi-square with m degrees of freedom in the steady state. It depends on the length of a bias
    only, not on its direction, which `Ewma` does not attain; where the bias lies along one axis, the other axes bring
    noise. Start, epochs without a fix and arguments as for `Ewma`.
    """

    kind = "mewma"

    def update(self, epoch: Epoch) -> Floats:
        """|e|² over its variance, (N,)."""
        mean = self._average(epoch)
        return np.asarray(reduce(np.add, (mean * mean).T) / self._variance)
