"""A frozen fix: the receiver goes on showing where the vehicle was, at rest."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.attacks.fixed_offsets import FixedOffsets
from spoofgym.attacks.meaconing import path
from spoofgym.navigation.interface import Clock
from spoofgym.specification import spell


class Frozen(FixedOffsets):
    """The position of the onset and a velocity of zero, whatever the vehicle does: s(t) = p(onset) - p(t).

    Faulty receivers do this, and so did the attack that was injected into the octocopter's autopilot in flight. A
    vehicle at rest notices nothing. Within `position-only:` the velocity of the fix stays the true one.

    Args:
        onset: scenario time, s; None = the start of the game.

    Raises:
        ValueError: the onset is no time.
    """

    def __init__(self, onset: float | None = None) -> None:
        self.onset = None if onset is None else validation.time("frozen", "onset", onset)

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return spell("frozen", onset=self.onset)

    def follow(self, velocity: Floats) -> None:
        """Take the vehicle's true velocity at the moments of the game's steps, (M+1, 3), ENU, m/s."""
        times = self._timeline.times
        stays = path(velocity, self._timeline, np.full(len(times), self._onset))
        self._lay(stays - path(velocity, self._timeline, times))
        _, _, epochs = self._timeline.steps
        self._true = velocity[epochs]

    def velocity(self, clock: Clock, rate: Floats) -> Floats:
        """The opposite of the true velocity after the onset, (N, 3), m/s ENU."""
        return np.where(self.started(clock)[:, None], -self._true[np.maximum(clock.index, 0)], 0.0)
