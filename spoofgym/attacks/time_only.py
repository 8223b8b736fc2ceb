"""An attack on the receiver's time alone: its clock is pushed away and held there, its position stays true."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock
from spoofgym.specification import spell_changed


class TimeOnly(Attack):
    """A push of the receiver's clock: its rate grows evenly, holds and falls evenly, and the clock stays where it is.

    All ranges grow alike, and range rates with them, so that a fix neither moves nor shows it. The defaults are what
    the second scenario of TEXBAT does to a captured receiver: 0.1 m/s² up to 5 m/s and back, 614 m (2 µs) in all.

    Args:
        size: of the push, m; c times the time. Negative = the clock runs ahead.
        rate: the largest, m/s.
        acceleration: with which it grows and falls, m/s².
        onset: scenario time, s; None = the start of the game.

    Raises:
        ValueError: a number is not finite, or rate or acceleration is not above 0.
    """

    kind = "time-only"
    needs_ranges = True
    moves_position = False

    def __init__(
        self, size: float = 614.0, rate: float = 5.0, acceleration: float = 0.1, onset: float | None = None
    ) -> None:
        self.size = validation.finite(self.kind, "size", size)
        self.rate = validation.above(self.kind, "rate", rate)
        self.acceleration = validation.above(self.kind, "acceleration", acceleration)
        self.onset = None if onset is None else validation.time(self.kind, "onset", onset)

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return spell_changed(
            self.kind, TimeOnly, size=self.size, rate=self.rate, acceleration=self.acceleration, onset=self.onset
        )

    def offset(self, clock: Clock) -> Floats:
        """The position stays true, (N, 3), m ENU."""
        return np.zeros((self._num_runs, 3))

    def clock_offset(self, clock: Clock) -> Floats:
        """The clock, (N,), m: s = a t²/2 while the rate grows, then v t, then the mirror image of the beginning."""
        size, top = abs(self.size), min(self.rate, float(np.sqrt(abs(self.size) * self.acceleration)))
        grows = top / self.acceleration
        lasts = 0.0 if size == 0.0 else size / top + grows
        time = np.minimum(self.elapsed(clock), lasts)
        rising, falling = np.minimum(time, grows), np.maximum(time - (lasts - grows), 0.0)
        pushed = 0.5 * self.acceleration * (rising**2 - falling**2) + top * np.maximum(time - grows, 0.0)
        return np.asarray(np.sign(self.size) * pushed)

    def active(self, clock: Clock) -> Flags:
        """Whether the receiver follows the spoofer, (N,): from the onset to the end of the game."""
        return self.started(clock)
