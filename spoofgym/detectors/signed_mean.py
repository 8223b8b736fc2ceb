"""Chi-square test of the mean of the last whitened horizontal innovations, which keeps their signs."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.detectors.chi_square import quantile
from spoofgym.detectors.ring import MovingSum
from spoofgym.navigation.interface import Epoch

DEFAULT_WINDOW = 5
HORIZONTAL = 2
"""Degrees of freedom: east and north."""


class SignedMean(ThresholdDetector):
    """Alarm where the last n whitened horizontal innovations lean to one side: statistic |Σ w|² / n = n |mean w|².

    The whitening factor L is lower triangular, so the first two components of w = L⁻¹ z are the east and north
    innovation whitened by their own covariance, whatever the height and the velocity do. Under a matched filter
    Σ w / √n is standard normal in two dimensions: the statistic is chi-square with 2 degrees of freedom at every epoch,
    for any n. A constant bias b of w has the noncentrality n |b|² here, as in the sum of n nis, whose noise has m n
    degrees of freedom instead of 2: that is why a slow drag-off shows here first. A bias that changes its sign within
    the window cancels.

    Epochs that have not come, and those without a fix, count as zero, so that the statistic is then smaller.

    Windows overlap, so ARL0 is not 1 / P_FA: it is calibrated. With nothing given it is 1e3, a sensitive alarm for a
    response that uses GNSS again as soon as it agrees; give ``arl0`` to compare with other detectors.

    Args:
        n: terms of the sum, epochs.
        threshold: compared with the statistic, no unit.
        p_fa: probability that the statistic of one epoch exceeds the threshold; ``arl0`` then stays unknown.
        arl0: average run length between false alarms, epochs.

    Raises:
        ValueError: more than one of the last three is given, or a value is out of range.
    """

    kind = "signed-mean"
    in_position = True
    default_arl0 = 1e3

    def __init__(
        self,
        n: int = DEFAULT_WINDOW,
        threshold: float | None = None,
        p_fa: float | None = None,
        arl0: float | None = None,
    ) -> None:
        self.n = validation.epochs(self.kind, "n", n, 1)
        self.memory = self.n - 1
        validation.at_most_one(self.kind, threshold=threshold, p_fa=p_fa, arl0=arl0)
        p_exceeds = None if p_fa is None else validation.probability(self.kind, "p_fa", p_fa)
        self.set_up(threshold, arl0, n=self.n, p_fa=p_exceeds)
        if p_exceeds is not None:
            self.threshold = quantile(p_exceeds, HORIZONTAL)
            self.target_arl0 = None

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the window."""
        self._sum = MovingSum(num_runs, self.n, HORIZONTAL)

    def reset(self, runs: Runs) -> None:
        """Empty the windows of these runs."""
        self._sum.reset(runs)

    def update(self, epoch: Epoch) -> Floats:
        """|Σ w|² / n, (N,)."""
        total = self._sum.push(epoch.innovation.whitened[:, :HORIZONTAL])
        return np.asarray((total[:, 0] ** 2 + total[:, 1] ** 2) / self.n)
