"""The times of a game's epochs, and when the vehicle manoeuvres between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from spoofgym.arrays import Floats, Runs

MANOEUVRE = 0.3
"""Horizontal acceleration between epochs above which a vehicle manoeuvres, m/s²."""
QUIET = 2.0
"""Time without any before a manoeuvre counts as a new one, s."""
ROUNDING = 1e-6
"""By which times of epochs may miss a multiple of the interval, s."""


@dataclass(frozen=True, eq=False)
class Timeline:
    """The epochs of a game, at the times at which they are: a recorded log may have none for a while.

    Attributes:
        times: scenario time of epochs 0..K, (K+1,), s; epoch 0 is the last clean epoch before the game.
        interval: usual time between epochs, s.
    """

    times: Floats
    interval: float

    @classmethod
    def steady(cls, start: float, interval: float, num_epochs: int) -> Timeline:
        """The epochs of a receiver that misses none.

        Args:
            start: scenario time of epoch 0, s.
            interval: time between epochs, s.
            num_epochs: epochs after epoch 0.
        """
        return cls(np.asarray(start + interval * np.arange(num_epochs + 1), dtype=np.float64), interval)

    def __eq__(self, other: object) -> bool:
        """Whether both have the same epochs."""
        if not isinstance(other, Timeline):
            return NotImplemented
        return self.interval == other.interval and np.array_equal(self.times, other.times)

    def __hash__(self) -> int:
        """Equal for equal timelines."""
        return hash((self.interval, self.times.tobytes()))

    @property
    def num_epochs(self) -> int:
        """K, the epochs of the game after epoch 0."""
        return len(self.times) - 1

    @property
    def start(self) -> float:
        """Scenario time of epoch 0, s."""
        return float(self.times[0])

    @property
    def end(self) -> float:
        """Scenario time of the last epoch, s."""
        return float(self.times[-1])

    def between(self, first: Runs, last: Runs) -> Floats:
        """Time from epochs to others, s; a multiple of the interval where it differs from one by rounding alone.

        Args:
            first: epochs, of any shape; those before epoch 0 count as the interval apart.
            last: epochs, of a shape that fits.
        """
        usual, real = (last - first) * self.interval, self._time_of(last) - self._time_of(first)
        return np.where(np.abs(real - usual) <= ROUNDING, usual, real)

    def _time_of(self, epoch: Runs) -> Floats:
        return np.asarray(self.times[np.maximum(epoch, 0)] + np.minimum(epoch, 0) * self.interval)

    @cached_property
    def intervals(self) -> Floats:
        """Time from the epoch before to each of epochs 1..K, (K,), s."""
        following = np.arange(1, len(self.times))
        return self.between(following - 1, following)

    @cached_property
    def steps(self) -> tuple[Floats, Floats, Runs]:
        """The time from epoch 0 to K in steps of about the interval: a longer time between epochs is cut evenly.

        Returns:
            Moments (M+1,), s, which are the epochs where none is missing; lengths of the steps between them (M,), s;
            which moments are epochs, (K+1,).
        """
        number = np.maximum(np.round(self.intervals / self.interval), 1.0).astype(np.int64)
        epochs = np.concatenate([[0], np.cumsum(number)])
        moments = np.interp(np.arange(epochs[-1] + 1), epochs, self.times)
        return moments, np.repeat(self.intervals / number, number), epochs


def manoeuvre_times(velocity: Floats, timeline: Timeline) -> tuple[float, ...]:
    """Times at which an acceleration begins after a quiet stretch, s; one that is under way at epoch 0 is left out.

    Args:
        velocity: at the moments of the timeline's steps, (M+1, 3), ENU, m/s.
        timeline: of the game.
    """
    moments, lengths, _ = timeline.steps
    step = np.hypot(*np.diff(velocity[:, :2], axis=0).T) / lengths > MANOEUVRE
    # the first step that reaches into the quiet time before each
    first = np.searchsorted(moments[1:], moments[:-1] - QUIET + 0.5 * timeline.interval, side="right")
    quiet = [k > 0 and not step[min(first[k], k - 1) : k].any() for k in range(len(step))]
    return tuple(moments[np.flatnonzero(step & np.array(quiet))].tolist())
