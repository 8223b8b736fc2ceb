"""First alarms of clean runs, for every threshold at once."""

from __future__ import annotations

import math

import numpy as np

from spoofgym.arrays import Floats, Runs


class FirstAlarms:
    """First alarms and epochs at risk of clean runs, for every threshold at once.

    A statistic that exceeds all earlier ones of its run is a record. With a threshold from the record before it up to
    this one the run's first alarm is at this epoch: the records tell what any threshold would have done.

    Attributes:
        floor: thresholds below are no longer told apart.
    """

    def __init__(self) -> None:
        self.floor = -math.inf
        self._runs = self._length = 0
        self._burn_in = np.empty(0)
        self._before = np.empty(0)
        self._record = np.empty(0)
        self._epoch: Runs = np.empty(0, dtype=np.int64)

    def add(self, burn_in: Floats, statistics: Floats) -> None:
        """Count new runs.

        Args:
            burn_in: statistic in the burn-in, (n, B).
            statistics: in the K epochs at risk, (n, K), of the same K at every call.

        Raises:
            ValueError: there is no epoch, another K than before, or a statistic that is not a number.
        """
        runs, length = statistics.shape
        if length == 0 or (self._runs and length != self._length):
            raise ValueError(f"clean runs have {length} epochs at risk, those before them {self._length}")
        if np.isnan(statistics).any() or np.isnan(burn_in).any():
            raise ValueError("a statistic of a clean run is not a number")
        highest = np.empty((runs, length + 1))
        highest[:, 0] = burn_in.max(axis=1, initial=self.floor)
        np.maximum.accumulate(statistics, axis=1, out=highest[:, 1:])
        np.maximum(highest[:, 1:], highest[:, :1], out=highest[:, 1:])
        run, epoch = np.nonzero(highest[:, 1:] > highest[:, :-1])
        self._runs, self._length = self._runs + runs, length
        self._burn_in = np.concatenate([self._burn_in, highest[highest[:, 0] > self.floor, 0]])
        self._before = np.concatenate([self._before, highest[run, epoch]])
        self._record = np.concatenate([self._record, highest[run, epoch + 1]])
        self._epoch = np.concatenate([self._epoch, epoch + 1])

    def at(self, threshold: float) -> tuple[int, int]:
        """First alarms and epochs at risk with this threshold, not below the floor.

        The epoch of the alarm counts as at risk; a run that alarms in its burn-in does not count.
        """
        alarmed = (self._before <= threshold) & (threshold < self._record)
        alarms = int(np.count_nonzero(alarmed))
        quiet = self._runs - int(np.count_nonzero(self._burn_in > threshold)) - alarms
        return alarms, int(self._epoch[alarmed].sum()) + self._length * quiet

    def threshold(self, arl0: float) -> float:
        """The least threshold, to rounding, whose ARL₀ is not below ``arl0``."""
        low, high = max(float(self._before.min()), self.floor), float(self._record.max())
        low = float(self._record.min()) - 1.0 if low == -math.inf else low
        while True:
            middle = 0.5 * (low + high)
            if not low < middle < high:
                return high
            alarms, at_risk = self.at(middle)
            low, high = (middle, high) if at_risk < arl0 * alarms else (low, middle)

    def forget_below(self, floor: float) -> None:
        """Drop what only thresholds below ``floor`` need; later runs are kept from there on only."""
        self.floor = floor
        self._burn_in = self._burn_in[self._burn_in > floor]
        kept = self._record > floor
        self._before, self._record, self._epoch = self._before[kept], self._record[kept], self._epoch[kept]
