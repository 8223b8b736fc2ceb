"""A ramp whose rate grows exponentially."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.attacks.base import Attack
from spoofgym.attacks.profiles import EAST, heading
from spoofgym.navigation.interface import Clock
from spoofgym.specification import spell
from spoofgym.timeline import Timeline
from spoofgym.validation import written

GROWTH_TIME = 30.0
MOST_GROWTH = 100.0
"""Time constants that a game may hold: e^100 m is no position, and e^710 no number."""


class Exponential(Attack):
    """The offset starts along the heading at ``rate`` and grows as rate · T · (exp(t / T) - 1) (ours).

    It stands for a spoofer that gains confidence: the first seconds are those of a synchronised ramp, and the rate is
    rate · exp(t / T).

    Args:
        rate: at the onset, m/s.
        time: constant T in which the rate grows e-fold, s.
        direction: azimuth, degrees clockwise from north.
        onset: scenario time, s; None = the start of the game.

    Raises:
        ValueError: the rate is negative, the time is not positive, or a value is not finite.
    """

    def __init__(
        self, rate: float, time: float = GROWTH_TIME, direction: float = EAST, onset: float | None = None
    ) -> None:
        self.rate = validation.non_negative("exponential", "rate", rate)
        self.time = validation.above("exponential", "time", time)
        self.direction = validation.finite("exponential", "direction", direction)
        self.onset = None if onset is None else validation.time("exponential", "onset", onset)
        self._heading = heading(self.direction)

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return spell(
            "exponential",
            self.rate,
            time=None if self.time == GROWTH_TIME else self.time,
            direction=None if self.direction == EAST else self.direction,
            onset=self.onset,
        )

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Fit the attack to a game.

        Raises:
            ValueError: the attack starts before the game or after its end, or its time is far too short for the game.
        """
        super().bind(timeline, num_runs)
        longest = timeline.end - self._onset
        if longest > MOST_GROWTH * self.time:
            raise ValueError(
                f"attack {self.name!r}: time must be {written(longest / MOST_GROWTH)} s or more in a game that goes "
                f"on for {written(longest)} s, got {self.time!r}"
            )

    def offset(self, clock: Clock) -> Floats:
        """Rate · T · (exp(t / T) - 1) along the direction, (N, 3), m ENU."""
        distance = self.rate * self.time * np.expm1(self.elapsed(clock) / self.time)
        return distance[:, None] * self._heading
