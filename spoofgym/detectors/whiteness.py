"""A portmanteau test of whether the whitened innovations are white in time."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.kernels import njit
from spoofgym.navigation.interface import Epoch

DEFAULT_WINDOW = 60
DEFAULT_LAGS = 5


class Whiteness(ThresholdDetector):
    """Alarm where innovations of the last n epochs are correlated in time: a portmanteau test (Hosking 1980).

    A matched filter's whitened innovations are white and of unit covariance, which needs no estimate. With the lagged
    products of the window

        C_l = Σ_j w_j w_{j-l}'  (n − l terms),      statistic = Σ_{l=1..lags} Σ_{a,b} C_l,ab² / (n − l).

    Each C_l,ab / √(n − l) has zero mean and unit variance and is uncorrelated with the others: the statistic has the
    mean m² lags, exactly, and is chi-square with m² lags degrees of freedom for long windows. Shorter ones have a
    heavier tail. ARL0 is calibrated.

    It sees what is slow or periodic in the innovations, of any sign and direction. A constant bias b of w adds
    |b|⁴ Σ (n − l) to its mean, the fourth power of what is small in a slow drag-off, against the noise of m² lags
    degrees of freedom: a test of the mean is better at that.

    Epochs that have not come, and those without a fix, count as zero.

    Args:
        n: epochs of the window.
        lags: the greatest lag, less than n.
        threshold: compared with the statistic, no unit.
        arl0: average run length between false alarms, epochs; 1e5 with nothing given.

    Raises:
        ValueError: both of the last two are given, or a value is out of range.
    """

    kind = "whiteness"

    def __init__(
        self,
        n: int = DEFAULT_WINDOW,
        lags: int = DEFAULT_LAGS,
        threshold: float | None = None,
        arl0: float | None = None,
    ) -> None:
        self.n = validation.epochs(self.kind, "n", n, 2)
        self.lags = validation.epochs(self.kind, "lags", lags, 1)
        if self.lags >= self.n:
            raise ValueError(f"{self.kind}: lags must be less than n = {self.n}, got {lags!r}")
        self.memory = self.n - 1
        self.set_up(threshold, arl0, n=self.n, lags=self.lags)

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the window and its lagged products."""
        self._past = np.zeros((num_runs, self.n, dimension))
        self._products = np.zeros((num_runs, self.lags, dimension, dimension))
        self._count = np.zeros(num_runs, dtype=np.int64)

    def reset(self, runs: Runs) -> None:
        """Empty the windows of these runs."""
        self._past[runs] = self._products[runs] = 0.0
        self._count[runs] = 0

    def update(self, epoch: Epoch) -> Floats:
        """The sum of the squared correlations, (N,)."""
        statistic = np.empty(len(self._count))
        _slide(epoch.innovation.whitened, self._past, self._products, self._count, statistic)
        return statistic


@njit(cache=True, nogil=True, error_model="numpy")
def _slide(whitened: Floats, past: Floats, products: Floats, count: Runs, statistic: Floats) -> None:
    """Move the window of every run by one epoch; shapes as in `Whiteness`.

    A pair leaves the window with its older half, so that the products that leave are all those of the oldest epoch.
    """
    n, lags, m = past.shape[1], products.shape[1], past.shape[2]
    for run in range(len(whitened)):
        place = count[run] % n
        newest, oldest = whitened[run], past[run, place]
        total = 0.0
        for lag in range(1, lags + 1):
            before, after = past[run, (place - lag) % n], past[run, (place + lag) % n]
            squares = 0.0
            for a in range(m):
                for b in range(m):
                    products[run, lag - 1, a, b] += newest[a] * before[b] - after[a] * oldest[b]
                    squares += products[run, lag - 1, a, b] ** 2
            total += squares / (n - lag)
        statistic[run] = total
        for a in range(m):
            oldest[a] = newest[a]
        count[run] += 1
