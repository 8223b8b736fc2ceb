"""The spoofed position leaves the true one along a tangent and runs round a circle beside it."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.attacks.base import Attack
from spoofgym.attacks.profiles import EAST, heading
from spoofgym.navigation.interface import Clock
from spoofgym.specification import spell

PERIOD = 60.0


class Circle(Attack):
    """The offset runs clockwise round a circle, whose centre lies at the radius along the heading (ours).

    With h the heading and n the horizontal unit vector 90° to its left, s(t) = R [(1 - cos ωt) h + sin ωt n], ω = 2π /
    period. So it starts at zero, along n, at the speed 2πR / period, and never lies further away than 2R.

    Args:
        radius: R, m.
        period: of one turn, s.
        direction: azimuth of the centre, degrees clockwise from north.
        onset: scenario time, s; None = the start of the game.

    Raises:
        ValueError: the radius is negative, the period is not positive, or a value is not finite.
    """

    def __init__(
        self, radius: float, period: float = PERIOD, direction: float = EAST, onset: float | None = None
    ) -> None:
        self.radius = validation.non_negative("circle", "radius", radius)
        self.period = validation.above("circle", "period", period)
        self.direction = validation.finite("circle", "direction", direction)
        self.onset = None if onset is None else validation.time("circle", "onset", onset)
        self._centre = self.radius * heading(self.direction)
        self._ahead = self.radius * heading(self.direction - 90.0)

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return spell(
            "circle",
            self.radius,
            period=None if self.period == PERIOD else self.period,
            direction=None if self.direction == EAST else self.direction,
            onset=self.onset,
        )

    def offset(self, clock: Clock) -> Floats:
        """R [(1 - cos ωt) h + sin ωt n], (N, 3), m ENU."""
        angle = 2.0 * np.pi * self.elapsed(clock)[:, None] / self.period
        return (1.0 - np.cos(angle)) * self._centre + np.sin(angle) * self._ahead
