"""The last n values of each run, and their sum."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs


class Ring:
    """The last n values of N runs, each a number or a vector of ``width`` numbers; ``empty`` where fewer have come.

    Every run writes at its own place, which a reset takes back to the start: what a run holds, and in which order,
    depends on its own episode alone. Reduce ``values`` along axis 1, of fixed length: the result of a run is then
    bit-identical for any N.
    """

    def __init__(self, num_runs: int, length: int, width: int | None = None, empty: float = 0.0) -> None:
        shape = () if width is None else (width,)
        self._empty = empty
        self._shape = (num_runs, length, *shape)
        self._flat: Floats = np.full((num_runs * length, *shape), empty)
        self._start = np.arange(num_runs) * length
        self._place = self._start.copy()
        self._next = np.arange(1, num_runs * length + 1)
        self._next[length - 1 :: length] -= length

    @property
    def values(self) -> Floats:
        """What each run holds, (N, n) or (N, n, width), in no particular order; write to it to change it.

        Formed anew at each call: an attribute that is a view of another one would part from it in a copy of the ring.
        """
        return self._flat.reshape(self._shape)

    @property
    def oldest(self) -> Floats:
        """The value that each run would overwrite next, (N,) or (N, width): after a push, n - 1 pushes old."""
        return np.asarray(self._flat[self._place])

    def reset(self, runs: Runs) -> None:
        """Forget the values of these runs."""
        self.values[runs] = self._empty
        self._place[runs] = self._start[runs]

    def push(self, value: Floats) -> None:
        """Write each run's value, (N,) or (N, width), over its oldest one."""
        self._flat[self._place] = value
        self._place = self._next.take(self._place)

    def push_where(self, given: Flags, value: Floats) -> None:
        """As `push`, in the runs that ``given`` (N,) marks; the others keep what they hold."""
        places = self._place[given]
        self._flat[places] = value[given]
        self._place[given] = self._next.take(places)

    def take(self, runs: Runs, other: Ring) -> None:
        """Copy what a ring of fewer runs holds: its run j becomes run ``runs[j]`` here."""
        self.values[runs] = other.values
        self._place[runs] = self._start[runs] + other._place - other._start


class MovingSum:
    """The sum of the last n values of N runs, each a number or a vector of ``width``; of fewer where fewer have come.

    The newest value is added and the oldest taken away, whatever n: rounding errors stay in ``total`` until the reset
    of the run. They are of the size of 1e-16 times the largest value since then; a test that must be exact adds up a
    `Ring` anew.

    Attributes:
        total: (N,) or (N, width).
    """

    def __init__(self, num_runs: int, length: int, width: int | None = None) -> None:
        self._ring = Ring(num_runs, length, width)
        self.total: Floats = np.zeros(num_runs if width is None else (num_runs, width))

    def reset(self, runs: Runs) -> None:
        """Forget the values of these runs."""
        self._ring.reset(runs)
        self.total[runs] = 0.0

    def push(self, value: Floats) -> Floats:
        """Add each run's value, (N,) or (N, width), in place of its oldest one; the sums."""
        self.total += value - self._ring.oldest
        self._ring.push(value)
        return self.total

    def take(self, runs: Runs, other: MovingSum) -> None:
        """Copy what a sum of fewer runs holds: its run j becomes run ``runs[j]`` here."""
        self._ring.take(runs, other._ring)
        self.total[runs] = other.total
