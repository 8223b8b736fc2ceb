"""A jump, then a slow change, with clean fixes between and after them (Song 2021, data set 4)."""

from __future__ import annotations

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.attacks.base import Attack
from spoofgym.attacks.profiles import Jump, SlowChange
from spoofgym.navigation.interface import Clock
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline

JUMP, SLOW_CHANGE = (50.0, 100.0), (150.0, 200.0)
"""Onset and end of each part, scenario time, s (Song 2021, section 4.2)."""


class SongMix(Attack):
    """Eq 28 from 50 to 100 s and eq 29 from 150 to 200 s (Song 2021, section 4.2, data set Ψ̃4).

    The paper does not say where the slow change goes at 200 s: here the fixes are clean again at once.
    """

    onset = JUMP[0]

    def __init__(self) -> None:
        self._parts = Jump(onset=JUMP[0], end=JUMP[1]), SlowChange(onset=SLOW_CHANGE[0], end=SLOW_CHANGE[1])

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return "song-mix"

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Fit both parts to a game.

        Raises:
            ValueError: one starts before the game or after its end.
        """
        super().bind(timeline, num_runs)
        for part in self._parts:
            part.bind(timeline, num_runs)

    def reset(self, runs: Runs, streams: RunStreams) -> None:
        """Draw the offsets of new episodes, those of the jump first."""
        for part in self._parts:
            part.reset(runs, streams)

    def active(self, clock: Clock) -> Flags:
        """While either part is, (N,)."""
        jump, slow_change = self._parts
        return jump.active(clock) | slow_change.active(clock)

    def offset(self, clock: Clock) -> Floats:
        """That of the part that is active, (N, 3), m ENU."""
        jump, slow_change = self._parts
        return jump.offset(clock) + slow_change.offset(clock)
