"""Harm: what the games of N lanes are worth, counted from the estimates and the vehicles themselves."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.envs.payoffs import Payoff
from spoofgym.envs.standing import Standing
from spoofgym.simulation import Simulation


class Harm:
    """The mean payoff over a game's epochs, by the error of the real-time output after each decision.

    Where the payoff is of the vehicle, it is where the decision has let it drive until the next epoch.

    It watches a game as a seat does, and nobody's actions, observations or training rewards enter it.

    Attributes:
        payoff: what an epoch is worth.
        step: part of the harm that the last step has added, (N,).
        total: harm of each lane's game so far, (N,). At the end of a game it is the mean over all its epochs.
    """

    def __init__(self, simulation: Simulation, payoff: Payoff) -> None:
        """Watch a simulation."""
        self.payoff = payoff
        self._simulation = simulation
        self._horizon = simulation.scenario.timeline.num_epochs
        self.step: Floats = np.zeros(simulation.num_runs)
        self.total: Floats = np.zeros(simulation.num_runs)

    def begin(self, lanes: Runs) -> None:
        """Begin new games."""
        self.total[lanes] = 0.0

    def resolved(self) -> None:
        """Note what the estimates became: the present fix of every lane has been resolved."""
        if not self.payoff.objective.drives:
            self._worth = self._read()

    def observed(self, restarting: Runs | None = None) -> None:
        """Note where the vehicles are, and begin new games in ``restarting`` lanes."""
        if self.payoff.objective.drives:
            self._worth = self._read()
        if restarting is not None and len(restarting):
            self.total[restarting] = 0.0
            self._worth[restarting] = 0.0

    def _read(self) -> Floats:
        """What the epoch is worth, (N,)."""
        return self.payoff.of(self.payoff.objective.of(self._simulation))

    def score(self, standing: Standing) -> None:
        """Count the step; if the filter has diverged, the step and all epochs left are worth the largest payoff."""
        worth = self._worth
        if standing.diverged.any():
            left = self._horizon - self._simulation.epoch.index + 1
            worth = np.where(standing.diverged, left * self.payoff.largest, worth)
        self.step = worth / self._horizon
        self.total += self.step
