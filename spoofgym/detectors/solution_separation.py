"""A test of the filter's solution against a solution without the last fixes (Kujur 2024)."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.kernels import njit
from spoofgym.navigation.facts import LINEAR_MODEL, FilterFacts
from spoofgym.navigation.interface import Epoch
from spoofgym.navigation.linear_model import LinearModel

DEFAULT_WINDOW = 30
EAST = 6
"""Place of the position's east error in the state; north follows."""
HORIZONTAL = 2


class SolutionSeparation(ThresholdDetector):
    """Alarm where the last n fixes have moved the horizontal position too far from where inertia alone leads.

    With d = x_KF - x_INS of east and north, where x_INS is the filter of n epochs ago carried on without a fix,

        statistic = d' V⁻¹ d,      V = P_INS - P_KF,

    chi-square with 2 degrees of freedom under a matched filter, at every epoch and for any n. d obeys d⁺ = Φ d - K z
    and is thus a linear function of the last n innovations (`separation_map`), which is how it is computed: no second
    filter runs. The innovations projected onto the position are the same test.

    One window only: an attack that is longer than n epochs contaminates the solution it is compared with. Kujur's bank
    of windows, one opened at every epoch, is `separation-bank`, on ranges. The map is that of a filter that uses every
    fix, computed once along the scenario's linear model; fixes that have not come, or that the receiver does not give,
    count as zero. Epochs before epoch 0 are as epoch 0.

    Kujur (2024) projects onto the vertical and sums over windows; the horizontal form is ours.

    Args:
        n: fixes that the second solution leaves out.
        threshold: compared with the statistic, no unit.
        arl0: average run length between false alarms, epochs; calibrated, and 1e5 with nothing given.

    Raises:
        ValueError: both of the last two are given, or a value is out of range.
    """

    kind = "solution-separation"
    needs = (LINEAR_MODEL,)

    def __init__(self, n: int = DEFAULT_WINDOW, threshold: float | None = None, arl0: float | None = None) -> None:
        self.n = validation.epochs(self.kind, "n", n, 1, validation.LONGEST_TABLE)
        self.memory = self.n - 1
        self.set_up(threshold, arl0, n=self.n)

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the innovations of the window, by their age."""
        self._window = np.zeros((num_runs, self.n, dimension))

    def know(self, facts: FilterFacts) -> None:
        """Compute the map from the innovations to the whitened separation, along the scenario."""
        gain = separation_map(facts.model(0), self.n)
        variance = np.einsum("knam,knbm->kab", gain, gain)
        self._map = np.einsum("kab,knbm->knam", np.linalg.inv(np.linalg.cholesky(variance)), gain)

    def reset(self, runs: Runs) -> None:
        """Forget the innovations of these runs."""
        self._window[runs] = 0.0

    def update(self, epoch: Epoch) -> Floats:
        """d' V⁻¹ d, (N,)."""
        statistic = np.empty(len(epoch.index))
        _separate(np.maximum(epoch.index, 0), epoch.innovation.whitened, self._map, self._window, statistic)
        return statistic


def separation_map(model: LinearModel, n: int) -> Floats:
    """B with d = Σ_a B_a w_(k-a): what the last n whitened innovations have done to the position, (K+1, n, 2, m), m.

    B_a is minus the two rows of Φ_k ... Φ_(k-a+1) U_(k-a) that belong to east and north. Epochs before epoch 0 are as
    epoch 0.
    """
    epochs = np.arange(len(model.time))
    gain = np.empty((len(epochs), n, HORIZONTAL, model.dimension))
    carried = np.zeros((len(epochs), HORIZONTAL, model.num_states))
    carried[:, range(HORIZONTAL), range(EAST, EAST + HORIZONTAL)] = 1.0
    for age in range(n):
        row = np.maximum(epochs - age, 0)
        gain[:, age] = -carried @ model.whitened_gain[row].transpose(0, 2, 1)
        carried = carried @ model.transition[row]
    return gain


@njit(cache=True, nogil=True, error_model="numpy")
def _separate(row: Runs, whitened: Floats, gain: Floats, window: Floats, statistic: Floats) -> None:
    """Put the new innovation into the window, and add up what all of it does.

    Args:
        row: epoch of each run in the map, (N,).
        whitened: w, (N, m).
        gain: C⁻¹ B with V = C C', (K+1, n, 2, m).
        window: the last n of w, the present one first, (N, n, m), in place.
        statistic: |Σ C⁻¹ B w|², (N,), result.
    """
    n, m = window.shape[1:]
    for i in range(len(row)):
        for age in range(n - 1, 0, -1):
            for j in range(m):
                window[i, age, j] = window[i, age - 1, j]
        window[i, 0] = whitened[i]
        first = second = 0.0
        for age in range(n):
            for j in range(m):
                first += gain[row[i], age, 0, j] * window[i, age, j]
                second += gain[row[i], age, 1, j] * window[i, age, j]
        statistic[i] = first * first + second * second
