"""A test of what the aids of a filter say: they contradict a filter that a spoofer has moved."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.detectors.ring import MovingSum
from spoofgym.navigation.facts import AIDS, FilterFacts
from spoofgym.navigation.interface import Epoch

DEFAULT_WINDOW = 20


class AidInnovation(ThresholdDetector):
    """Alarm where the mean innovation of the aids over a window is too large: barometer, wheels, heading.

    A spoofer who pulls the filter makes it disagree with what GNSS does not own. Under a matched filter the whitened
    innovations of an aid are white with unit variance, and so is, for each of its rows, their sum over the window
    divided by the root of the number of epochs with a reading; with w_j of the last n epochs,

        statistic = Σ over rows (Σ_j w_j)² / (epochs with a reading),

    chi-square with as many degrees of freedom as there are rows at any one epoch. Readings that a gate left out count,
    too: they are those that disagree most. The test is ours. Before the game, where innovations are drawn without a
    filter, no aid has been heard.

    Args:
        aid: name of the aid; None = all that the filter has.
        n: epochs of the window.
        threshold: compared with the statistic, no unit.
        arl0: average run length between false alarms, epochs; calibrated on simulated clean runs, and 1e5 with nothing
            given.

    Raises:
        ValueError: both of the last two are given, or a value is out of range.
    """

    kind = "aid-innovation"
    needs = (AIDS,)
    needs_view = True

    def __init__(
        self,
        aid: str | None = None,
        n: int = DEFAULT_WINDOW,
        threshold: float | None = None,
        arl0: float | None = None,
    ) -> None:
        self.aid = None if aid is None else validation.text(self.kind, "aid", aid)
        self.n = validation.epochs(self.kind, "n", n, 1)
        self.memory = self.n - 1
        self.set_up(threshold, arl0, self.aid, n=self.n)
        self._owner = np.zeros(0, dtype=np.int64)
        self._chosen = np.zeros(0, dtype=bool)

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the window: of each row its innovations, and whether there was one."""
        self._num_runs = num_runs
        self._sum = MovingSum(num_runs, self.n, max(2 * len(self._owner), 1))

    def know(self, facts: FilterFacts) -> None:
        """Learn which aids there are, and how many rows each has.

        Raises:
            ValueError: the filter does not have the aid that is named.
        """
        names = tuple(name for name, _ in facts.aids)
        if self.aid is not None and self.aid not in names:
            raise ValueError(
                f"detector {self.name!r}: scenario {facts.scenario!r} has no aid {self.aid!r}; it has: "
                f"{', '.join(names)}"
            )
        self._owner = np.repeat(np.arange(len(names)), [rows for _, rows in facts.aids])
        self._chosen = np.array([self.aid in (None, names[place]) for place in self._owner])
        self.bind(self._num_runs, 0)

    def reset(self, runs: Runs) -> None:
        """Empty the windows of these runs."""
        self._sum.reset(runs)

    def update(self, epoch: Epoch) -> Floats:
        """The squared mean over its variance, summed over the rows, (N,); 0 where no aid has been heard."""
        rows = len(self._owner)
        newest = np.zeros((len(epoch.index), max(2 * rows, 1)))
        if epoch.view is not None and rows:
            told = epoch.view.aid_innovations
            newest[:, :rows] = told.whitened * self._chosen
            newest[:, rows:] = (told.count[:, self._owner] > 0) & self._chosen
        sums = self._sum.push(newest)
        heard = sums[:, rows : 2 * rows]
        square = np.where(heard > 0.0, sums[:, :rows] ** 2, 0.0) / np.maximum(heard, 1.0)
        return np.asarray(np.add.reduce(square, axis=1))
