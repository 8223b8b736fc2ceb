"""A test of the receiver's clock against the model of its oscillator, on the innovations of a filter on ranges.

Let h be what a step in the drift of the clock does to the measurements of one epoch: 1 in every range rate, or, where
the carrier is measured, 1 in every code and carrier, for the offset that it makes until the next epoch. With the
innovation z and its covariance S, which holds all that the filter believes of position, velocity and oscillator,

    t = h'S⁻¹z / √(h'S⁻¹h)

is standard normal under a matched filter and independent from epoch to epoch, and of all tests of one epoch the most
powerful one against such a step. With a = L⁻¹ h it is a'w / |a|.
"""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs, read_only
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.detectors.chi_square import quantile
from spoofgym.detectors.raim import code_present
from spoofgym.detectors.ring import MovingSum
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.facts import RANGES, FilterFacts
from spoofgym.navigation.interface import Epoch, Innovation

DEFAULT_WINDOW = 20


class ClockDrift(ThresholdDetector):
    """Alarm where the receiver's clock leans to one side of what its oscillator can do: statistic (Σ t)² / n.

    t is that of this module; the sum is over the last n epochs. It is chi-square with 1 degree of freedom under a
    matched filter, for any n. A spoofer who pulls the time of all satellites alike moves no position, so that tests of
    the position do not see it; the drift of the clock has to change for it. As the filter learns a drift, only its
    changes show: a pull is seen while it grows, is not while it is steady, and is seen again when it stops.

    What an oscillator can do is what the filter believes of it (h0 and h₋₂ of the scenario). A threshold that is
    calibrated on clean epochs of a log takes the real one into account.

    Epochs that have not come, and those without ranges, count as zero. The score of one epoch follows from the
    innovation's normal distribution; the window and its length are ours.

    Args:
        n: terms of the sum, epochs.
        threshold: compared with the statistic, no unit.
        p_fa: probability that the statistic of one epoch exceeds the threshold; ``arl0`` then stays unknown.
        arl0: average run length between false alarms, epochs; 1e5 with nothing given.

    Raises:
        ValueError: more than one of the last three is given, or a value is out of range.
    """

    kind = "clock-drift"
    needs = (RANGES,)

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
            self.threshold = quantile(p_exceeds, 1)
            self.target_arl0 = None

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the window."""
        self._sum = MovingSum(num_runs, self.n)

    def know(self, facts: FilterFacts) -> None:
        """Learn whether range rates are measured, or the carrier."""
        self._carrier = facts.observable == "carrier"

    def reset(self, runs: Runs) -> None:
        """Empty the windows of these runs."""
        self._sum.reset(runs)

    def update(self, epoch: Epoch) -> Floats:
        """(Σ t)² / n, (N,)."""
        score = drift_score(epoch.innovation, self._carrier)
        if epoch.available is not None:
            score = np.where(epoch.available, score, 0.0)
        return np.asarray(self._sum.push(score) ** 2 / self.n)


def drift_score(innovation: Innovation, carrier: bool) -> Floats:
    """t, (N,); 0 without a measurement.

    Args:
        innovation: of ranges.
        carrier: whether the second observable is the carrier, not the range rate.

    Raises:
        ValueError: the innovation is that of fixes.
    """
    present = code_present(innovation)
    step = np.concatenate([present & carrier, present], axis=1).astype(np.float64)
    covariance = innovation.covariance
    shared = covariance.strides[0] == 0 and bool((present == present[:1]).all())
    score = np.empty(len(present))
    _score(read_only(covariance[:1] if shared else covariance), step, innovation.whitened, shared, score)
    return score


@njit(cache=True, nogil=True, error_model="numpy")
def _score(covariance: Floats, step: Floats, whitened: Floats, shared: bool, score: Floats) -> None:
    """a'w / |a| with a = L⁻¹ h of each run.

    Args:
        covariance: S, (N, m, m), or (1, m, m) where it is shared.
        step: h, (N, m).
        whitened: w, (N, m).
        shared: one S and one h for all runs.
        score: (N,), overwritten.
    """
    m = step.shape[1]
    factor, response = np.empty((m, m)), np.empty(m)
    length = 0.0
    for run in range(len(score)):
        if run == 0 or not shared:
            kalman.cholesky(covariance[run], factor)
            length = np.sqrt(kalman.whiten(factor, step[run], response))
        total = 0.0
        for i in range(m):
            total += response[i] * whitened[run, i]
        score[run] = total / length if length > 0.0 else 0.0
