"""An estimate of the onset of spoofing: the epoch at which the innovations began to lean to one side."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs, take_runs
from spoofgym.kernels import njit

WINDOW = 50
"""Epochs among which the onset is looked for."""


class OnsetEstimator:
    """The change point of the mean of the whitened horizontal innovations, in N runs.

    If the last n innovations are white with an unknown common mean and those before them have none, the logarithm of
    the likelihood ratio is |s_n|²/(2 n), where s_n is the sum of the last n (Willsky and Jones 1976). The
    estimate is the n that maximises |s_n|²/n. An epoch without a fix counts with a zero.
    """

    def __init__(self, num_runs: int, window: int = WINDOW) -> None:
        """Allocate the last ``window`` innovations of ``num_runs`` runs.

        Raises:
            ValueError: a window of less than one epoch.
        """
        self.window = validation.epochs("onset estimate", "window", window, 1)
        self._ring = np.zeros((num_runs, self.window, 2))
        self._place = np.zeros(num_runs, dtype=np.int64)

    def reset(self, runs: Runs) -> None:
        """Forget the innovations of these runs."""
        self._ring[runs] = 0.0
        self._place[runs] = 0

    def push(self, whitened: Floats, runs: Runs | None = None) -> None:
        """See the innovation of an epoch.

        Args:
            whitened: of every run, (N, 2) or more columns, of which the first two are the horizontal ones.
            runs: the runs that see it; None = all.
        """
        rows = slice(None) if runs is None else runs
        place = self._place[rows]
        self._ring[np.arange(len(self._ring)) if runs is None else runs, place] = whitened[rows, :2]
        self._place[rows] = (place + 1) % self.window

    def estimate(self) -> tuple[Runs, Floats]:
        """The onset as the newest innovations tell it.

        Returns:
            How many epochs back the mean changed, the present one counted, (N,), 0 where every innovation is zero; and
            |s_n|²/n there, (N,), which is chi-square with 2 degrees of freedom for a fixed n without spoofing.
        """
        depth, score = np.empty(len(self._ring), dtype=np.int64), np.empty(len(self._ring))
        _estimate(self._ring, self._place, depth, score)
        return depth, score

    def take(self, runs: Runs, other: OnsetEstimator) -> None:
        """Copy what an estimator of fewer runs holds: its run j becomes run ``runs[j]`` here."""
        take_runs(self, runs, other)


@njit(cache=True, nogil=True, error_model="numpy")
def _estimate(ring: Floats, place: Runs, depth: Runs, score: Floats) -> None:
    """The n <= window that maximises |s_n|²/n; the smallest of equal ones."""
    window = ring.shape[1]
    for run in range(len(ring)):
        depth[run], score[run] = 0, 0.0
        east = north = 0.0
        slot = place[run]
        for n in range(1, window + 1):
            slot = slot - 1 if slot > 0 else window - 1
            east += ring[run, slot, 0]
            north += ring[run, slot, 1]
            value = (east * east + north * north) / n
            if value > score[run]:
                depth[run], score[run] = n, value
