"""Cumulative sums: of the normalised innovation squared, and of the whitened innovations with their signs."""

from __future__ import annotations

import math
from functools import reduce

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.navigation.interface import Epoch

DEFAULT_SCALE = 1.5
DEFAULT_SHIFT = 0.25
LEAST_SCALE, LEAST_SHIFT = 1.02, 0.025
"""Of k of the two tests: with a smaller one they forget their start in no less than 10,000 epochs."""
POSITION = 3
"""Axes of a position."""
LEAST_MEMORY = 60
TIME_CONSTANTS = 3.0
"""Clean epochs before a game, at least, and in time constants of a memory that fades."""


def forgetting(drift: float, variance: float) -> int:
    """Epochs in which a cumulative sum of this mean (below 0) and variance per epoch forgets its start, at least 60.

    The relaxation time of a random walk that is reflected at 0 is 2 variance / drift² (Brownian approximation).
    """
    return max(LEAST_MEMORY, math.ceil(TIME_CONSTANTS * 2.0 * variance / drift**2))


class Cusum(ThresholdDetector):
    """Alarm where the nis have been too large since some epoch: Page's cumulative sum (Page 1954).

        S_i = max(0, S_{i-1} + nis_i − k m),      statistic = S_i

    Under a matched filter nis is chi-square with mean m, so that the sum drifts down by (k − 1) m per epoch and starts
    anew at 0; under attack it rises as soon as the mean nis per degree of freedom exceeds k. It is the sequential
    likelihood-ratio test against innovations whose variance is r times too large, for which k = r ln r / (r − 1):
    k = 1.5 is for r = 2.4. No window has to be chosen. After an attack S comes down by (k − 1) m per epoch only: a
    large jump keeps it alarmed for long.

    An epoch without a fix leaves S as it is. ARL0 is calibrated.

    Args:
        k: reference value per degree of freedom, greater than 1.
        threshold: compared with S, no unit.
        arl0: average run length between false alarms, epochs; 1e5 with nothing given.

    Raises:
        ValueError: both of the last two are given, or a value is out of range.
    """

    kind = "cusum"

    def __init__(self, k: float = DEFAULT_SCALE, threshold: float | None = None, arl0: float | None = None) -> None:
        scale = validation.above(self.kind, "k", k, 1.0)
        self.k = validation.between(self.kind, "k", scale, LEAST_SCALE, validation.LARGEST)
        self.memory = forgetting(POSITION * (self.k - 1.0), 2.0 * POSITION)
        self.set_up(threshold, arl0, k=self.k)

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the sums."""
        self._sum = np.zeros(num_runs)

    def reset(self, runs: Runs) -> None:
        """Start the sums of these runs anew."""
        self._sum[runs] = 0.0

    def update(self, epoch: Epoch) -> Floats:
        """S, (N,)."""
        grown = np.maximum(self._sum + epoch.innovation.nis - self.k * epoch.innovation.degrees, 0.0)
        self._sum = grown if epoch.available is None else np.where(epoch.available, grown, self._sum)
        return self._sum.copy()


class SignedCusum(ThresholdDetector):
    """Alarm where a whitened position innovation has leaned to one side since some epoch: a cumulative sum per side.

        S±_i = max(0, S±_{i-1} ± w_i − k),      statistic = the largest of both sides of the three axes

    Under a matched filter every w is standard normal. Each sum is the sequential likelihood-ratio test against a shift
    of the mean by 2 k (Page 1954), and the fastest one to find that shift among the tests of its ARL0 by Lorden's
    criterion, the worst mean delay (Moustakides 1986). The whitening factor is lower triangular, so that the first
    three components are the position whitened by its own covariance; a velocity in the fix is left out, since a
    drag-off shows in the position first and each axis more costs sensitivity.

    The axes are those of w and not those of the vehicle: a shift between axes is seen less well than by a test that
    turns with it, at worst as 1/√3 of its length. After an attack S comes down by k per epoch only.

    An epoch without a fix leaves S as it is. ARL0 is calibrated. Three axes and the default k are ours.

    Args:
        k: reference value, half the shift to be found, standard deviations; greater than 0.
        threshold: compared with the largest S, standard deviations.
        arl0: average run length between false alarms, epochs; 1e5 with nothing given.

    Raises:
        ValueError: both of the last two are given, or a value is out of range.
    """

    kind = "signed-cusum"
    in_position = True

    def __init__(self, k: float = DEFAULT_SHIFT, threshold: float | None = None, arl0: float | None = None) -> None:
        self.k = validation.between(self.kind, "k", k, LEAST_SHIFT, validation.LARGEST)
        self.memory = forgetting(self.k, 1.0)
        self.set_up(threshold, arl0, k=self.k)

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the sums of both sides."""
        self._sums = np.zeros((num_runs, 2 * POSITION))

    def reset(self, runs: Runs) -> None:
        """Start the sums of these runs anew."""
        self._sums[runs] = 0.0

    def update(self, epoch: Epoch) -> Floats:
        """The largest S, (N,)."""
        position = epoch.innovation.whitened[:, :POSITION]
        grown = np.maximum(self._sums + np.concatenate([position, -position], axis=1) - self.k, 0.0)
        self._sums = grown if epoch.available is None else np.where(epoch.available[:, None], grown, self._sums)
        return np.asarray(reduce(np.maximum, self._sums.T))
