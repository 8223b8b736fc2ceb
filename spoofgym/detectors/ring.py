"""The last n values of each run."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs


class Ring:
    """The last n values of N runs, zero where fewer have come.

    Every run writes at its own place, which a reset takes back to the start: what a run holds, and in which order,
    depends on its own episode alone. Reduce ``values`` along axis 1, of fixed length: the result of a run is then
    bit-identical for any N.

    Attributes:
        values: (N, n), in no particular order.
    """

    def __init__(self, num_runs: int, length: int) -> None:
        self.values: Floats = np.zeros((num_runs, length))
        self._flat = self.values.reshape(-1)
        self._start = np.arange(num_runs) * length
        self._place = self._start.copy()
        self._next = np.arange(1, num_runs * length + 1)
        self._next[length - 1 :: length] -= length

    def reset(self, runs: Runs) -> None:
        """Forget the values of these runs."""
        self.values[runs] = 0.0
        self._place[runs] = self._start[runs]

    def push(self, value: Floats) -> None:
        """Write each run's value (N,) over its oldest one."""
        self._flat[self._place] = value
        self._place = self._next.take(self._place)

    def take(self, runs: Runs, other: Ring) -> None:
        """Copy what a ring of fewer runs holds: its run j becomes run ``runs[j]`` here."""
        self.values[runs] = other.values
        self._place[runs] = self._start[runs] + other._place - other._start
