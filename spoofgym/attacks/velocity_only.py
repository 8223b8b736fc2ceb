"""An attack that moves the velocity of the fix but not its position; it wraps another attack."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.attacks.around import AroundAttack
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock
from spoofgym.specification import nest, spell
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline


class VelocityOnly(AroundAttack):
    """An attack that is inconsistent: the velocity of the fix moves at the rate of its offset, the position stays true.

    Such is a spoofer who shifts the Doppler and leaves the codes as they are. The position of the fix then contradicts
    its velocity, so that the filter follows the velocity less. An offset that jumps shows in one fix alone. The
    receiver must give velocity (m = 6): without it nothing would be spoofed.

    Args:
        attack: the attack inside, whose offsets are known in advance.

    Raises:
        ValueError: the attack inside plays in closed loop, does not move the position, or leaves the velocity true.
    """

    kind = "velocity-only"

    def __init__(self, attack: Attack) -> None:
        super().__init__(attack)
        if attack.closed_loop or attack.needs_velocity or not attack.moves_position:
            raise ValueError(
                "velocity-only: attack must be one whose offsets are known in advance and move position and velocity, "
                f"got {attack.name!r}"
            )
        self.moves_position = False
        self.needs_velocity = True

    @property
    def name(self) -> str:
        """The specification that builds this attack, where one builds the attack inside."""
        return spell("velocity-only", nest(self.attack.name))

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Fit the attack to a game and allocate the rates of its episodes.

        Raises:
            ValueError: the attack inside does not fit the game.
        """
        super().bind(timeline, num_runs)
        self._rates = np.zeros((num_runs, timeline.num_epochs + 1, 3))
        self._runs = np.arange(num_runs)

    def reset(self, runs: Runs, streams: RunStreams) -> None:
        """Start new episodes of the attack inside, and take the rates of all its offsets."""
        offsets, intervals = self.attack.episode(runs, streams), np.diff(self._timeline.times)
        self._rates[runs, 1:] = np.diff(offsets, axis=1) / intervals[:, None]

    def offset(self, clock: Clock) -> Floats:
        """The position stays true, (N, 3), m ENU."""
        return np.zeros((self._num_runs, 3))

    def velocity(self, clock: Clock, rate: Floats) -> Floats:
        """The rate of the attack inside, (N, 3), m/s ENU."""
        return np.asarray(self._rates[self._runs, np.maximum(clock.index, 0)])
