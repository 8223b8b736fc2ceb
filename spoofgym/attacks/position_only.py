"""Another attack by a spoofer who moves the position of the fix and not its velocity."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock, Timeline
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.specification import nest, spell
from spoofgym.streams import RunStreams


class PositionOnly(Attack):
    """An attack that is inconsistent: its offset moves the position of the fix, and the velocity stays the true one.

    Such is a spoofer who delays the codes and leaves the Doppler shifts as they are. The velocity of the fix then
    contradicts its position, so that the filter follows the offset less. The receiver must give velocity (m = 6):
    without it the attack would be the one inside.

    Args:
        attack: the attack inside.

    Raises:
        ValueError: the attack inside leaves the velocity true already.
    """

    needs_velocity = True

    def __init__(self, attack: Attack) -> None:
        if isinstance(attack, PositionOnly):
            raise ValueError(f"position-only: attack must not leave the velocity true itself, got {attack.name!r}")
        self.attack = attack
        self.onset = attack.onset
        self.needs_model = attack.needs_model

    @property
    def name(self) -> str:
        """The specification that builds this attack, where one builds the attack inside."""
        return spell("position-only", nest(self.attack.name))

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Fit the attack inside to a game.

        Raises:
            ValueError: the attack inside does not fit the game.
        """
        self.attack.bind(timeline, num_runs)
        super().bind(timeline, num_runs)

    def follow(self, velocity: Floats) -> None:
        """Tell the attack inside the vehicle's true velocity at epochs 0..K, (K+1, 3), ENU, m/s."""
        self.attack.follow(velocity)

    def study(self, model: LinearModel) -> None:
        """Show the attack inside the victim's linear model."""
        self.attack.study(model)

    def reset(self, runs: Runs, streams: RunStreams) -> None:
        """Start new episodes of the attack inside."""
        self.attack.reset(runs, streams)

    def active(self, clock: Clock) -> Flags:
        """Whether the receiver follows the spoofer, (N,)."""
        return self.attack.active(clock)

    def offset(self, clock: Clock) -> Floats:
        """The offset of the attack inside, (N, 3), m ENU."""
        return self.attack.offset(clock)

    def velocity(self, clock: Clock, rate: Floats) -> Floats:
        """Nothing is added to the velocity of the fix, (N, 3), m/s ENU."""
        return np.zeros_like(rate)
