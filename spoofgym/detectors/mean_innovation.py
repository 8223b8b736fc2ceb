"""Liu's test of the mean innovation, axis by axis."""

from __future__ import annotations

from functools import reduce

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.detectors.ring import MovingSum
from spoofgym.navigation.interface import Epoch

DEFAULT_WINDOW = 20


class MeanInnovation(ThresholdDetector):
    """Alarm where the mean innovation of any axis is too large for its standard deviation (Liu 2018, sections 4.2, 5).

    Liu gives the principle, a test of each component's mean, because a spoofed component then shows by itself; window
    and threshold are ours. The innovations z_j of a matched filter are white with covariance S_j, so that the mean of n
    has the variance Σ S_j / n² per axis, and

        statistic = max over axes a of |Σ z_j,a| / √(Σ S_j,aa),

    in which the n has dropped out. Each axis by itself is then the modulus of a standard normal number; axes are
    correlated as S is. A fix with velocity (m = 6) has six axes.

    Epochs that have not come, and those without a fix, count neither in the mean nor in its variance.

    Args:
        n: epochs of the mean.
        threshold: compared with the statistic, standard deviations.
        arl0: average run length between false alarms, epochs; calibrated, and 1e5 with nothing given.

    Raises:
        ValueError: both of the last two are given, or a value is out of range.
    """

    kind = "mean-innovation"
    in_position = True

    def __init__(self, n: int = DEFAULT_WINDOW, threshold: float | None = None, arl0: float | None = None) -> None:
        self.n = validation.epochs(self.kind, "n", n, 1)
        self.memory = self.n - 1
        self.set_up(threshold, arl0, n=self.n)

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the window of innovations, their variances, and the number of fixes."""
        self._sum = MovingSum(num_runs, self.n, 2 * dimension + 1)
        self._newest = np.empty((num_runs, 2 * dimension + 1))

    def reset(self, runs: Runs) -> None:
        """Empty the windows of these runs."""
        self._sum.reset(runs)

    def update(self, epoch: Epoch) -> Floats:
        """The largest mean over its standard deviation, (N,); 0 where the window has no fix."""
        m, newest = epoch.innovation.residual.shape[1], self._newest
        newest[:, :m] = epoch.innovation.residual
        newest[:, m:-1] = np.diagonal(epoch.innovation.covariance, axis1=1, axis2=2)
        newest[:, -1] = 1.0
        if epoch.available is not None:
            newest[~epoch.available] = 0.0
        sums = self._sum.push(newest)
        # without a fix the sums are rounding errors: only the number of fixes is exact
        fixes = sums[:, -1:] > 0.0
        deviation = np.sqrt(np.where(fixes, sums[:, m:-1], np.inf))
        return np.asarray(reduce(np.maximum, (np.abs(sums[:, :m]) / deviation).T))
