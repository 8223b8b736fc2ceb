"""A finite moving average of log-likelihood ratios, for changes that last for a while."""

from __future__ import annotations

import math

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.detectors.ring import MovingSum
from spoofgym.kernels import njit
from spoofgym.navigation.interface import Epoch

DEFAULT_WINDOW = 20
DEFAULT_SHIFT = 1.0
ASYMPTOTIC = 30.0
"""Argument above which the Bessel function is expanded in its inverse: 12 terms leave no error there."""
TERMS = 12


class FiniteMovingAverage(ThresholdDetector):
    """Alarm where the log-likelihood ratio of the last n epochs is high: a shift against none (Egea-Roca et al. 2018).

    The shift moves the mean of w by a vector of length δ, of unknown direction, drawn anew in every epoch and evenly
    over the sphere. The ratio of the densities of one epoch is then

        exp(−δ²/2) ₀F₁(m/2; δ² nis / 4),      for m = 3: exp(−δ²/2) sinh(x) / x with x = δ √nis,

    and the statistic is Σ log ₀F₁ over the window: the log-likelihood ratio plus n δ²/2, a constant that decides
    nothing and keeps the statistic from being negative. It depends on the sizes of the innovations and not on their
    signs; it grows with √nis where nis is large, so that a single outlier counts for less than in the sum of the nis,
    and is like that sum for small δ. Its distribution is none that has a name, and ARL0 is calibrated.

    A window of fixed length suits a change that ends: what came before it does not delay the alarm, and an alarm ends n
    epochs after its cause. Epochs that have not come, and those without a fix, count as zero.

    Args:
        n: epochs of the window.
        shift: δ, standard deviations; greater than 0.
        threshold: compared with Σ log ₀F₁, no unit.
        arl0: average run length between false alarms, epochs; 1e5 with nothing given.

    Raises:
        ValueError: both of the last two are given, or a value is out of range.
    """

    kind = "fma"

    def __init__(
        self,
        n: int = DEFAULT_WINDOW,
        shift: float = DEFAULT_SHIFT,
        threshold: float | None = None,
        arl0: float | None = None,
    ) -> None:
        self.n = validation.epochs(self.kind, "n", n, 1)
        self.memory = self.n - 1
        self.shift = validation.above(self.kind, "shift", shift)
        self.set_up(threshold, arl0, n=self.n, shift=self.shift)

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the window."""
        self._sum = MovingSum(num_runs, self.n)
        self._ratio = np.empty(num_runs)
        self._dimension = dimension

    def reset(self, runs: Runs) -> None:
        """Empty the windows of these runs."""
        self._sum.reset(runs)

    def update(self, epoch: Epoch) -> Floats:
        """Σ log ₀F₁ over the window, (N,)."""
        log_mean_ratio(self._dimension, self.shift, epoch.innovation.nis, self._ratio)
        return self._sum.push(self._ratio).copy()


@njit(cache=True, nogil=True, error_model="numpy")
def log_mean_ratio(dimension: int, shift: float, nis: Floats, ratio: Floats) -> None:
    """log ₀F₁(m/2; δ² nis / 4): log of the mean of exp(δ u'w) over all directions u; to `ratio`, (N,).

    With ν = m/2 − 1 and x = δ √nis it is log(Γ(ν + 1) (2/x)^ν I_ν(x)). All terms of its series are positive, so that
    small arguments lose no digits; large ones take the expansion of I_ν in 1/x (Abramowitz and Stegun 9.6.10, 9.7.1).
    """
    order = 0.5 * dimension - 1.0
    constant = math.lgamma(order + 1.0) + order * math.log(2.0) - 0.5 * math.log(2.0 * math.pi)
    for run in range(len(nis)):
        square = shift * shift * nis[run]
        if square < ASYMPTOTIC**2:
            term, total, j = 1.0, 1.0, 1.0
            while term > 1e-17 * total:
                term *= 0.25 * square / (j * (j + order))
                total += term
                j += 1.0
            ratio[run] = math.log(total)
        else:
            x = math.sqrt(square)
            term, total = 1.0, 1.0
            for j in range(1, TERMS):
                term *= ((2.0 * j - 1.0) ** 2 - 4.0 * order**2) / (8.0 * j * x)
                total += term
            ratio[run] = constant + x - (order + 0.5) * math.log(x) + math.log(total)
