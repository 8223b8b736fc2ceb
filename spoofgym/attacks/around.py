"""The base class of attacks that wrap another attack and change part of it."""

from __future__ import annotations

from typing import Any

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline


class AroundAttack(Attack):
    """An attack that wraps another attack. It forwards every call to it; a subclass overrides what it changes.

    Attributes:
        kind: the registered name.
        attack: the wrapped attack.
    """

    kind: str

    def __init__(self, attack: Attack) -> None:
        validation.instance(self.kind, "attack", attack, Attack, "an attack")
        self.attack = attack
        self.onset = attack.onset
        self.needs_model = attack.needs_model
        self.needs_velocity = attack.needs_velocity
        self.needs_ranges = attack.needs_ranges
        self.moves_position = attack.moves_position
        self.closed_loop = attack.closed_loop
        self.knowledge = attack.knowledge
        self.has_tracking_error = attack.has_tracking_error
        self.on_ranges = attack.on_ranges

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Fit the attack inside to a game.

        Raises:
            ValueError: the attack inside does not fit the game.
        """
        with validation.argument(self.kind, "attack"):
            self.attack.bind(timeline, num_runs)
        super().bind(timeline, num_runs)

    def follow(self, velocity: Floats) -> None:
        """Tell the attack inside the vehicle's true velocity at the moments of the game's steps, (M+1, 3), ENU, m/s."""
        self.attack.follow(velocity)

    def study(self, model: LinearModel) -> None:
        """Show the attack inside the victim's linear model."""
        self.attack.study(model)

    def meet(self, satellites: Runs) -> None:
        """Tell the attack inside the numbers of the satellites in the game.

        Raises:
            ValueError: it is to capture one that is not among them.
        """
        self.attack.meet(satellites)

    def join(self, simulation: Any) -> None:
        """Give the attack inside the simulation that it plays in.

        Raises:
            ValueError: it needs what the simulation does not offer.
        """
        self.attack.join(simulation)
        self.on_ranges = self.attack.on_ranges

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
        """What the attack inside adds to the velocity of the fix at the rate of the whole offset, (N, 3), m/s ENU."""
        return self.attack.velocity(clock, rate)

    def clock_offset(self, clock: Clock) -> Floats:
        """How far the attack inside pulls the receiver's clock away, (N,), m."""
        return self.attack.clock_offset(clock)

    def captured(self, clock: Clock, satellites: Runs) -> Flags | None:
        """Which satellites' signals the receiver takes from the spoofer inside, (N, S); None = all."""
        return self.attack.captured(clock, satellites)

    def carrier(self, clock: Clock) -> Flags | None:
        """Whether carrier and range rate follow the code of the attack inside, (N,); None = they do."""
        return self.attack.carrier(clock)

    def ranges(self, clock: Clock) -> Floats | None:
        """What the attack inside adds to the ranges as they are, (N, m), m and m/s; None = nothing."""
        return self.attack.ranges(clock)
