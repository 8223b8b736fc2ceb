"""An attack that moves the position of the fix but not its velocity; it wraps another attack."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.attacks.around import AroundAttack
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock
from spoofgym.specification import nest, spell


class PositionOnly(AroundAttack):
    """An attack that is inconsistent: its offset moves the position of the fix, and the velocity stays the true one.

    Such is a spoofer who delays the codes and leaves the Doppler shifts as they are. The velocity of the fix then
    contradicts its position, so that the filter follows the offset less. The receiver must give velocity (m = 6):
    without it the attack would be the one inside.

    Args:
        attack: the attack inside.

    Raises:
        ValueError: the attack inside leaves the velocity true already.
    """

    kind = "position-only"

    def __init__(self, attack: Attack) -> None:
        if isinstance(attack, PositionOnly):
            raise ValueError(f"position-only: attack must not leave the velocity true itself, got {attack.name!r}")
        super().__init__(attack)
        self.needs_velocity = True

    @property
    def name(self) -> str:
        """The specification that builds this attack, where one builds the attack inside."""
        return spell("position-only", nest(self.attack.name))

    def velocity(self, clock: Clock, rate: Floats) -> Floats:
        """Nothing is added to the velocity of the fix, (N, 3), m/s ENU."""
        return np.zeros_like(rate)
