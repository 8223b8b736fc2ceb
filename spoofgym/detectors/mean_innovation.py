"""Liu's test of the mean innovation, axis by axis."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import Detector
from spoofgym.detectors.ring import Ring
from spoofgym.navigation.interface import Epoch
from spoofgym.specification import spell

DEFAULT_WINDOW = 20
DEFAULT_ARL0 = 1e5


class MeanInnovation(Detector):
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

    def __init__(self, n: int = DEFAULT_WINDOW, threshold: float | None = None, arl0: float | None = None) -> None:
        self.n = validation.whole("mean-innovation", "n", n, 1)
        self.memory = self.n - 1
        validation.at_most_one("mean-innovation", threshold=threshold, arl0=arl0)
        if threshold is not None:
            self.threshold = validation.above("mean-innovation", "threshold", threshold)
        else:
            self.target_arl0 = validation.above("mean-innovation", "arl0", DEFAULT_ARL0 if arl0 is None else arl0, 1.0)
        self._name = spell(
            "mean-innovation",
            n=None if self.n == DEFAULT_WINDOW else self.n,
            threshold=self.threshold,
            arl0=None if self.target_arl0 == DEFAULT_ARL0 else self.target_arl0,
        )

    @property
    def name(self) -> str:
        """The specification that builds this detector."""
        return self._name

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the windows of innovations and of their variances."""
        self._residual = Ring(num_runs, self.n, dimension)
        self._variance = Ring(num_runs, self.n, dimension)

    def reset(self, runs: Runs) -> None:
        """Empty the windows of these runs."""
        self._residual.reset(runs)
        self._variance.reset(runs)

    def update(self, epoch: Epoch) -> Floats:
        """The largest mean over its standard deviation, (N,); 0 where the window has no fix."""
        residual = epoch.innovation.residual
        variance = np.diagonal(epoch.innovation.covariance, axis1=1, axis2=2)
        if epoch.available is not None:
            residual = np.where(epoch.available[:, None], residual, 0.0)
            variance = np.where(epoch.available[:, None], variance, 0.0)
        self._residual.push(residual)
        self._variance.push(variance)
        total = np.abs(np.add.reduce(self._residual.values, axis=1))
        spread = np.sqrt(np.add.reduce(self._variance.values, axis=1))
        ratio = np.divide(total, spread, out=np.zeros_like(total), where=spread > 0.0)
        return np.asarray(np.maximum.reduce(ratio, axis=1))
