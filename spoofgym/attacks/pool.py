"""Populations of attacks, from which every run draws its opponent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.attacks.base import KNOWLEDGE, Attack
from spoofgym.attacks.families import (
    DEFAULT_MANOEUVRE,
    ClimbingSpiral,
    DecayingJump,
    RandomGrowth,
    RandomJump,
    RandomRamp,
    SignChangingRamp,
    TwoStageRamp,
    spoofed_stretch,
)
from spoofgym.navigation.interface import Clock
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.specification import spell
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline

CLEAN = -1
"""Member of a run without an attack."""
DEFAULT_CLEAN = 0.5


class AttackPool(Attack):
    """A weighted pool: at its reset each run draws an attack from it, or none.

    Attributes:
        names: of the members.
        clean: share of runs without an attack.
        offsets: of the present episodes, (N, K+1, 3), m ENU.
        member: index of each run's opponent, (N,); -1 = none.
        first: first epoch with an offset, (N,); K + 1 where there is none. An attack in closed loop begins at epoch 1.
        last: last epoch with an offset, (N,); 0 where there is none. An attack in closed loop ends with the game.
    """

    def __init__(
        self, members: Sequence[tuple[Attack, float]], clean: float = DEFAULT_CLEAN, name: str | None = None
    ) -> None:
        """Draw from ``members``, attacks with their weights.

        Raises:
            ValueError: no member, two of one name, a weight that is not positive, or a share that is none.
        """
        if not members:
            raise ValueError("a pool of attacks needs at least one member")
        self.clean = validation.share("pool of attacks", "clean", clean)
        self._members = [member for member, _ in members]
        self.closed_loop = any(member.closed_loop for member in self._members)
        self.knowledge = max((member.knowledge for member in self._members), key=KNOWLEDGE.index)
        self.has_tracking_error = any(member.has_tracking_error for member in self._members)
        self.needs_model = any(member.needs_model for member in self._members)
        self.needs_velocity = any(member.needs_velocity for member in self._members)
        self.needs_ranges = any(member.needs_ranges for member in self._members)
        self.moves_position = all(member.moves_position for member in self._members)
        self.names = tuple(member.name for member in self._members)
        if len(set(self.names)) < len(self.names):
            raise ValueError(f"each attack can be in a pool once only, got {', '.join(self.names)}")
        weights = np.array([validation.above("pool of attacks", "weight", weight) for _, weight in members])
        self._bounds = np.cumsum(weights) / weights.sum()
        self._name = " + ".join(self.names) if name is None else name

    @property
    def members(self) -> tuple[Attack, ...]:
        """The attacks, in the order of their names."""
        return tuple(self._members)

    @property
    def name(self) -> str:
        """The specification that builds this pool, or its members' names where none does."""
        return self._name

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Fit every member to a game and allocate the episodes.

        Raises:
            ValueError: an attack does not fit the game.
        """
        super().bind(timeline, num_runs)
        for member in self._members:
            member.bind(timeline, num_runs)
        self.offsets: Floats = np.zeros((num_runs, timeline.num_epochs + 1, 3))
        self.member: Runs = np.full(num_runs, CLEAN)
        self.first, self.last = spoofed_stretch(self.offsets)
        self._runs = np.arange(num_runs)

    def follow(self, velocity: Floats) -> None:
        """Tell every member the vehicle's true velocity at the moments of the game's steps, (M+1, 3), ENU, m/s."""
        for member in self._members:
            member.follow(velocity)

    def study(self, model: LinearModel) -> None:
        """Show the victim's linear model to every member that needs it."""
        for member in self._members:
            if member.needs_model:
                member.study(model)

    def meet(self, satellites: Runs) -> None:
        """Tell every member the numbers of the satellites in the game."""
        for member in self._members:
            member.meet(satellites)

    def join(self, simulation: Any) -> None:
        """Give every member the simulation that it plays in."""
        for member in self._members:
            member.join(simulation)

    def reset(self, runs: Runs, streams: RunStreams) -> None:
        """Draw the opponents of new episodes and, of those in open loop, all that they will do."""
        draws = np.array([streams(run, "opponent").random(2) for run in runs.tolist()])
        member = np.minimum(np.searchsorted(self._bounds, draws[:, 1], side="right"), len(self._members) - 1)
        self.member[runs] = np.where(draws[:, 0] < self.clean, CLEAN, member)
        self.offsets[runs] = 0.0
        for place, attack in enumerate(self._members):
            chosen = runs[self.member[runs] == place]
            if not len(chosen):
                continue
            if attack.closed_loop:
                attack.reset(chosen, streams)
            else:
                self.offsets[chosen] = attack.episode(chosen, streams)
        self.first[runs], self.last[runs] = spoofed_stretch(self.offsets[runs])
        for place, attack in enumerate(self._members):
            chosen = runs[self.member[runs] == place]
            if attack.closed_loop:
                self.first[chosen], self.last[chosen] = 1, self._timeline.num_epochs
            elif not attack.moves_position:
                self.first[chosen], self.last[chosen] = spoofed_stretch(self._activity(attack)[chosen])

    def _activity(self, attack: Attack) -> Floats:
        """Whether the receiver follows the spoofer at epochs 0..K, (N, K+1, 1)."""
        everyone = np.ones(self._num_runs, dtype=np.int64)
        times = enumerate(self._timeline.times.tolist())
        active = [attack.active(Clock(k * everyone, time * everyone)) for k, time in times]
        return np.stack(active, axis=1)[:, :, None].astype(np.float64)

    def active(self, clock: Clock) -> Flags:
        """Whether the receiver follows the spoofer, (N,): from the first offset of the episode to the last."""
        return (self.first <= clock.index) & (clock.index <= self.last)

    def offset(self, clock: Clock) -> Floats:
        """This epoch's offset, (N, 3), m ENU."""
        index = np.maximum(clock.index, 0)
        for place, attack in enumerate(self._members):
            playing = np.flatnonzero(self.member == place) if attack.closed_loop else self._runs[:0]
            if len(playing):
                self.offsets[playing, index[playing]] = attack.offset(clock)[playing]
        return self.offsets[self._runs, index]

    def velocity(self, clock: Clock, rate: Floats) -> Floats:
        """What each run's opponent adds to the velocity of the fix, (N, 3), m/s ENU."""
        added = rate
        for place, attack in enumerate(self._members):
            if attack.needs_velocity:
                added = np.where((self.member == place)[:, None], attack.velocity(clock, rate), added)
        return added

    def clock_offset(self, clock: Clock) -> Floats:
        """How far each run's opponent pulls the receiver's clock away, (N,), m."""
        moved = np.zeros(self._num_runs)
        for place, attack in enumerate(self._members):
            moved = np.where(self.member == place, attack.clock_offset(clock), moved)
        return moved

    def captured(self, clock: Clock, satellites: Runs) -> Flags | None:
        """Which satellites each run's opponent captures, (N, S); None = all in every run."""
        taken: Flags | None = None
        for place, attack in enumerate(self._members):
            part = attack.captured(clock, satellites)
            if part is not None:
                everything = np.ones(part.shape, dtype=bool) if taken is None else taken
                taken = np.where((self.member == place)[:, None], part, everything)
        return taken

    def carrier(self, clock: Clock) -> Flags | None:
        """Whether carrier and range rate follow the code of each run's opponent, (N,); None = in every run."""
        follows: Flags | None = None
        for place, attack in enumerate(self._members):
            part = attack.carrier(clock)
            if part is not None:
                everything = np.ones(self._num_runs, dtype=bool) if follows is None else follows
                follows = np.where(self.member == place, part, everything)
        return follows

    def ranges(self, clock: Clock) -> Floats | None:
        """What each run's opponent adds to the ranges as they are, (N, m), m and m/s; None = nothing in any run."""
        added: Floats | None = None
        for place, attack in enumerate(self._members):
            part = attack.ranges(clock)
            if part is not None:
                nothing = np.zeros(part.shape) if added is None else added
                added = np.where((self.member == place)[:, None], part, nothing)
        return added


def training_population(clean: float = DEFAULT_CLEAN, manoeuvre: float = DEFAULT_MANOEUVRE) -> AttackPool:
    """The attacks that a defender is trained on: ramps, jumps, and FOI-R-5687's growth with a run in parallel.

    Args:
        clean: share of runs without an attack.
        manoeuvre: share of attacks that begin in view of a manoeuvre.
    """
    clean = validation.share("training", "clean", clean)
    families = (RandomRamp(manoeuvre), RandomJump(manoeuvre), RandomGrowth(manoeuvre))
    return AttackPool([(family, 1.0) for family in families], clean, _spell("training", clean, manoeuvre))


def held_out_population(clean: float = DEFAULT_CLEAN, manoeuvre: float = DEFAULT_MANOEUVRE) -> AttackPool:
    """Attacks of other shapes, rates and directions, which no defender is trained on.

    Args:
        clean: share of runs without an attack.
        manoeuvre: share of attacks that begin in view of a manoeuvre.
    """
    clean = validation.share("held-out", "clean", clean)
    families = (
        TwoStageRamp(manoeuvre),
        SignChangingRamp(manoeuvre),
        DecayingJump(manoeuvre),
        ClimbingSpiral(manoeuvre),
    )
    return AttackPool([(family, 1.0) for family in families], clean, _spell("held-out", clean, manoeuvre))


def _spell(name: str, clean: float, manoeuvre: float) -> str:
    return spell(
        name,
        clean=None if clean == DEFAULT_CLEAN else clean,
        manoeuvre=None if manoeuvre == DEFAULT_MANOEUVRE else manoeuvre,
    )


POPULATIONS = {"training": training_population, "held-out": held_out_population}
