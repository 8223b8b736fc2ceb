"""Attacks side by side: every run of a simulation has one of its own, which begins and ends when it is told to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline


@dataclass(frozen=True)
class Stretch:
    """An attack and the epochs of the game in which it acts.

    Attributes:
        attack: no two stretches share the object.
        first: epoch of the game that is the attack's epoch 0, the last clean one.
        last: epoch of the game after which fixes are true again.
    """

    attack: Attack
    first: int
    last: int


class Staggered(Attack):
    """One attack for each run, so that one pass over a log plays all of them.

    Each attack takes its stretch for the whole game: it begins after the first epoch, and after the last one the fixes
    are true again, and so is their velocity.

    Args:
        stretches: one for each run.
    """

    def __init__(self, stretches: Sequence[Stretch]) -> None:
        self._stretches = list(stretches)
        attacks = [stretch.attack for stretch in stretches]
        self.needs_velocity = any(attack.needs_velocity for attack in attacks)
        self.needs_ranges = any(attack.needs_ranges for attack in attacks)
        self.needs_model = any(attack.needs_model for attack in attacks)
        self.moves_position = False  # so that `active` tells when a run is attacked

    @property
    def name(self) -> str:
        """The names of the attacks, once each."""
        return " + ".join(dict.fromkeys(stretch.attack.name for stretch in self._stretches))

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Fit every attack to its stretch of the game.

        Raises:
            ValueError: there are more or fewer runs than attacks, or an attack does not fit its stretch.
        """
        super().bind(timeline, num_runs)
        if num_runs != len(self._stretches):
            raise ValueError(f"staggered attacks: {len(self._stretches)} attacks cannot be those of {num_runs} runs")
        for stretch in self._stretches:
            part = Timeline(timeline.times[stretch.first : stretch.last + 1], timeline.interval)
            stretch.attack.bind(part, 1)

    def follow(self, velocity: Floats) -> None:
        """Tell each attack the vehicle's velocity in its stretch; ``velocity`` is that in the whole game, (M+1, 3)."""
        _, _, epochs = self._timeline.steps
        for stretch in self._stretches:
            stretch.attack.follow(velocity[epochs[stretch.first] : epochs[stretch.last] + 1])

    def meet(self, satellites: Runs) -> None:
        """Tell every attack the numbers of the satellites in the game."""
        for stretch in self._stretches:
            stretch.attack.meet(satellites)

    def join(self, simulation: Any) -> None:
        """Give every attack the simulation that it plays in."""
        for stretch in self._stretches:
            stretch.attack.join(simulation)
        self.on_ranges = any(stretch.attack.on_ranges for stretch in self._stretches)

    def reset(self, runs: Runs, streams: RunStreams) -> None:
        """Start new episodes of these runs; run i draws from a stream of its own, whatever the others do."""
        for run in runs.tolist():
            own = RunStreams.from_seed(int(streams(run, "opponent").integers(2**31)) + run, 1)
            self._stretches[run].attack.reset(np.array([0]), own)

    def _acting(self, clock: Clock) -> list[tuple[int, Attack, Clock]]:
        """Runs in whose stretch the epoch lies, their attacks, and the epoch as each counts it."""
        found = []
        for run, stretch in enumerate(self._stretches):
            index = int(clock.index[run])
            if stretch.first < index <= stretch.last:
                one = slice(run, run + 1)
                found.append((run, stretch.attack, Clock(clock.index[one] - stretch.first, clock.time[one])))
        return found

    def offset(self, clock: Clock) -> Floats:
        """That of each run's attack, (N, 3), m ENU."""
        offset = np.zeros((self._num_runs, 3))
        for run, attack, own in self._acting(clock):
            offset[run] = attack.offset(own)[0]
        return offset

    def velocity(self, clock: Clock, rate: Floats) -> Floats:
        """That of each run's attack, (N, 3), m/s ENU."""
        velocity = np.zeros((self._num_runs, 3))
        for run, attack, own in self._acting(clock):
            velocity[run] = attack.velocity(own, rate[run : run + 1])[0]
        return velocity

    def clock_offset(self, clock: Clock) -> Floats:
        """That of each run's attack, (N,), m."""
        moved = np.zeros(self._num_runs)
        for run, attack, own in self._acting(clock):
            moved[run] = attack.clock_offset(own)[0]
        return moved

    def active(self, clock: Clock) -> Flags:
        """Whether each run's attack acts, (N,)."""
        active = np.zeros(self._num_runs, dtype=bool)
        for run, attack, own in self._acting(clock):
            active[run] = attack.active(own)[0]
        return active

    def captured(self, clock: Clock, satellites: Runs) -> Flags | None:
        """Which satellites each run takes from the spoofer, (N, S); None = all of all runs."""
        taken: Flags | None = None
        for run, attack, own in self._acting(clock):
            given = attack.captured(own, satellites[run : run + 1])
            if given is not None:
                taken = np.ones(satellites.shape, dtype=bool) if taken is None else taken
                taken[run] = given[0]
        return taken

    def carrier(self, clock: Clock) -> Flags | None:
        """Whether carrier and range rate follow the code of each run, (N,); None = those of all runs do."""
        follows: Flags | None = None
        for run, attack, own in self._acting(clock):
            given = attack.carrier(own)
            if given is not None:
                follows = np.ones(self._num_runs, dtype=bool) if follows is None else follows
                follows[run] = given[0]
        return follows

    def ranges(self, clock: Clock) -> Floats | None:
        """What is added to the ranges of each run beside, (N, m), m and m/s; None = nothing to any."""
        added: Floats | None = None
        for run, attack, own in self._acting(clock):
            given = attack.ranges(own)
            if given is not None:
                added = np.zeros((self._num_runs, given.shape[1])) if added is None else added
                added[run] = given[0]
        return added
