"""The base class of every attack."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.navigation.interface import Clock
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline
from spoofgym.validation import written

KNOWLEDGE = ("blind", "shadow", "full")
"""What a spoofer may see while it plays: its own offsets; a shadow filter; the victim's innovations and statistics."""


class Attack(ABC):
    """What a spoofer adds to the fixes of N runs.

    A subclass computes its `offset`; a random one draws an episode's numbers in `reset`.

    Attributes:
        onset: scenario time from which the offset grows, s; None = the start of the game (its epoch 0, the last clean
            one).
        end: scenario time of its last spoofed fix, s; None = it lasts to the end of the game, or does not say.
        needs_model: whether it must `study` the victim's filter.
        needs_velocity: whether the receiver must give velocity, too.
        needs_ranges: whether the filter must take ranges.
        moves_position: whether it moves the position of a fix; otherwise it moves its velocity or its time alone.
        closed_loop: whether its offsets depend on what happens in the game, so that they cannot be told in advance.
        knowledge: what it sees while it plays, one of `KNOWLEDGE`.
        on_ranges: whether it acts on ranges as they are (`ranges`), or was recorded in them, so that `active` alone
            tells when.
        has_tracking_error: whether its offsets hold the error with which its spoofer tracks the vehicle.
    """

    onset: float | None = None
    end: float | None = None
    needs_model: bool = False
    needs_velocity: bool = False
    needs_ranges: bool = False
    moves_position: bool = True
    closed_loop: bool = False
    knowledge: str = "blind"
    on_ranges: bool = False
    has_tracking_error: bool = False

    @property
    @abstractmethod
    def name(self) -> str:
        """The specification that builds this attack."""

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Fit the attack to a game.

        Raises:
            ValueError: the attack starts before the game or after its end.
        """
        onset = timeline.start if self.onset is None else self.onset
        if not timeline.start <= onset < timeline.end:
            raise ValueError(
                f"attack {self.name!r}: onset {written(onset)} s lies outside the game, "
                f"which runs from {written(timeline.start)} s to {written(timeline.end)} s"
            )
        self._onset = onset
        self._timeline = timeline
        self._num_runs = num_runs

    def reset(self, runs: Runs, streams: RunStreams) -> None:  # noqa: B027 - a profile without noise draws nothing
        """Start new episodes; a random attack draws here, a block per run from the stream "opponent"."""

    def follow(self, velocity: Floats) -> None:  # noqa: B027 - most attacks do not care where the vehicle goes
        """Take the vehicle's true velocity, which a spoofer tracks; after `bind`.

        Args:
            velocity: at the moments of the timeline's steps, (M+1, 3), ENU, m/s: at epochs 0..K where none is missing.
        """

    def study(self, model: LinearModel) -> None:  # noqa: B027 - most attacks are blind to the filter
        """Take the victim's linear model, epochs 0..K, every fix used; after `follow`, and only where it is needed."""

    def meet(self, satellites: Runs) -> None:  # noqa: B027 - most attacks take all satellites
        """See the numbers of the satellites in the game, in increasing order, where the filter takes ranges."""

    def join(self, simulation: Any) -> None:  # noqa: B027 - most attacks do not look at the game that they play in
        """Take the `Simulation` that the attack plays in, when it has been set up; after all of the above."""

    def episode(self, runs: Runs, streams: RunStreams) -> Floats:
        """Start new episodes of some runs and look at all that they will send, (n, K+1, 3), m ENU."""
        self.reset(runs, streams)
        timeline, everyone = self._timeline, np.ones(self._num_runs, dtype=np.int64)
        offsets = [
            self.offset(Clock(k * everyone, time * everyone))[runs] for k, time in enumerate(timeline.times.tolist())
        ]
        return np.stack(offsets, axis=1)

    def elapsed(self, clock: Clock) -> Floats:
        """Time since the onset, (N,), s; zero before it."""
        return np.maximum(clock.time - self._onset, 0.0)

    def started(self, clock: Clock) -> Flags:
        """Whether the epoch lies after the onset, (N,); rounding of its time does not count."""
        return clock.time - self._onset > 1e-6 * self._timeline.interval

    def active(self, clock: Clock) -> Flags:
        """Whether the receiver follows the spoofer at the epoch, (N,), though the offset be zero."""
        return self.started(clock)

    def velocity(self, clock: Clock, rate: Floats) -> Floats:
        """What is added to the velocity of the fix, where the receiver gives one, (N, 3), m/s ENU.

        Args:
            clock: of the epoch.
            rate: of the offset, since the epoch before, (N, 3), m/s ENU: what a consistent spoofer adds.
        """
        return rate

    def clock_offset(self, clock: Clock) -> Floats:
        """How far the receiver's clock is pulled away at the epoch, (N,), m; only a filter on ranges sees it."""
        return np.zeros(len(clock.index))

    def captured(self, clock: Clock, satellites: Runs) -> Flags | None:
        """Which satellites' signals the receiver takes from the spoofer at the epoch, (N, S); None = all.

        Args:
            clock: of the epoch.
            satellites: number of the satellite in each slot, (N, S); -1 = none.
        """
        return None

    def carrier(self, clock: Clock) -> Flags | None:
        """Whether carrier and range rate follow the spoofed code at the epoch, (N,); None = they do."""
        return None

    def ranges(self, clock: Clock) -> Floats | None:
        """What is added to the ranges of the epoch beside, as they are, (N, m), m and m/s; None = nothing.

        Only an attack that was recorded tells it; its offsets are then zero.
        """
        return None

    @abstractmethod
    def offset(self, clock: Clock) -> Floats:
        """The offset added to the fix of the epoch at ``clock``, (N, 3), m ENU; zero until the onset."""
