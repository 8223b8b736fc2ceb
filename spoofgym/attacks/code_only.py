"""An attack that moves the codes but not the carriers; it wraps another attack."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags
from spoofgym.attacks.around import AroundAttack
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock
from spoofgym.specification import nest, spell


class CodeOnly(AroundAttack):
    """An attack whose Doppler does not follow: it moves the codes, while carriers and range rates stay the true ones.

    Such is a spoofer who delays the codes of its signals and keeps their frequencies, or a receiver whose carrier loops
    stay with the authentic signals. Position and clock of the attack inside show in the codes alone. All other attacks
    on ranges move the carrier as the code. The filter must take ranges.

    Args:
        attack: the attack inside.

    Raises:
        ValueError: the attack inside leaves the carriers true already.
    """

    kind = "code-only"

    def __init__(self, attack: Attack) -> None:
        if isinstance(attack, CodeOnly):
            raise ValueError(f"code-only: attack must not leave the carriers true itself, got {attack.name!r}")
        super().__init__(attack)
        self.needs_ranges = True

    @property
    def name(self) -> str:
        """The specification that builds this attack, where one builds the attack inside."""
        return spell("code-only", nest(self.attack.name))

    def carrier(self, clock: Clock) -> Flags:
        """In no run does the carrier follow, (N,)."""
        return np.zeros(self._num_runs, dtype=bool)
