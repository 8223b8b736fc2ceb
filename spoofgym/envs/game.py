"""One game on N lanes: a simulation, its two seats, and the loop of an epoch."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spoofgym.arrays import Floats, Runs
from spoofgym.envs.defender_seat import DefenderSeat
from spoofgym.envs.harm import Harm
from spoofgym.envs.spoofer_seat import SpooferSeat
from spoofgym.envs.standing import Standing
from spoofgym.simulation import Simulation


class Game:
    """N lanes of a game between a spoofer and a defender.

    A seat that is given is filled from outside: its player's actions come with every step. A seat that is None is
    filled within the simulation: by its attack, by its response, or by nobody.

    Attributes:
        simulation: the shared world.
        scenario: what is played on.
        num_lanes: N.
        spoofer: the spoofer's seat, if filled from outside.
        defender: the defender's seat, if filled from outside.
        harm: what the game is worth, where it is counted.
    """

    def __init__(
        self,
        simulation: Simulation,
        *,
        spoofer: SpooferSeat | None = None,
        defender: DefenderSeat | None = None,
        harm: Harm | None = None,
        ends_on_alarm: bool = False,
    ) -> None:
        """Put players around a simulation.

        Args:
            simulation: the shared world.
            spoofer: over this simulation; None = its attack plays, if it has one.
            defender: over this simulation; None = its response decides, if it has one.
            harm: counts what the game is worth; None = nothing is counted.
            ends_on_alarm: whether an alarm of any detector ends the game.
        """
        self.simulation, self.scenario, self.num_lanes = simulation, simulation.scenario, simulation.num_runs
        self.spoofer, self.defender, self.harm = spoofer, defender, harm
        self._watching = tuple(part for part in (spoofer, defender, harm) if part is not None)
        self._ends_on_alarm = ends_on_alarm
        self._horizon = simulation.scenario.timeline.num_epochs
        self._nobody = np.zeros(simulation.num_runs, dtype=bool)

    @property
    def index(self) -> Runs:
        """Epoch of each lane, (N,)."""
        return self.simulation.epoch.index

    def reset(self, lanes: Runs) -> None:
        """Start new games up to the clean epoch 0."""
        self.simulation.reset(lanes)
        if self.spoofer is not None:
            self.spoofer.draw(lanes)
        for part in self._watching:
            part.begin(lanes)

    def advance(
        self,
        rates: NDArray[Any] | None = None,
        decisions: NDArray[Any] | None = None,
        restarting: Runs | None = None,
    ) -> None:
        """Play one epoch of every lane: resolve the present one by the defender, observe the next with the spoofer.

        Args:
            rates: actions of the spoofer, if it sits outside, (N, 3) or (N, 4).
            decisions: actions of the defender, if it sits outside, (N, 2 + S).
            restarting: indices of lanes that begin a new game instead, whatever their actions.

        Raises:
            ValueError: an action that its seat refuses; nothing has been played then.
        """
        simulation, spoofer, defender = self.simulation, self.spoofer, self.defender
        moves = None if spoofer is None else spoofer.read(_given("spoofer", rates))
        choices = None if defender is None else defender.read(_given("defender", decisions))
        simulation.resolve(None if defender is None or choices is None else defender.act(choices))
        for part in self._watching:
            part.resolved()
        sent = None if spoofer is None or moves is None else spoofer.act(moves, restarting)
        if restarting is not None and len(restarting):
            simulation.restart(restarting)
            if spoofer is not None:
                spoofer.draw(restarting)
        self._observe(sent)
        for part in self._watching:
            part.observed(restarting)
        standing = self._close()
        for part in self._watching:
            part.score(standing)

    def _observe(self, sent: Floats | None) -> None:
        """Let the next epoch come, with what a spoofer outside sends, (N, 3) or (N, 4); None = the attack's."""
        self.simulation.observe(sent)

    def _decides_on_last_fix(self) -> bool:
        """Whether the fix of the last epoch is resolved.

        A defender within the simulation decides on it. One outside does not: its game ends with the observation of
        that epoch.
        """
        return self.defender is None

    def _close(self) -> Standing:
        """End the games that are over."""
        simulation = self.simulation
        alarm = simulation.alarm & (self.index > 0)
        caught = alarm if self._ends_on_alarm else self._nobody
        at_end = self.index == self._horizon
        last = at_end & ~caught & ~simulation.navigator.diverged
        if self._decides_on_last_fix() and last.any():
            lanes = np.flatnonzero(last)
            simulation.resolve(runs=lanes)
            if self.spoofer is not None:
                self.spoofer.resolved(lanes)
        diverged = simulation.navigator.diverged.copy()  # the last fix of a game, too, can make its filter diverge
        return Standing(alarm, caught, diverged, caught | at_end | diverged)


def _given(player: str, actions: NDArray[Any] | None) -> NDArray[Any]:
    """The actions of a player outside.

    Raises:
        ValueError: there are none.
    """
    if actions is None:
        raise ValueError(f"the {player}'s seat is filled from outside, and the step has no actions for it")
    return actions
