"""A game as one player sees it: what the single and the vector environments are built on."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from spoofgym.arrays import Flags, Floats
from spoofgym.envs.defender_seat import DefenderSeat
from spoofgym.envs.game import Game
from spoofgym.envs.observation import Field
from spoofgym.envs.spoofer_seat import SpooferSeat


class OneSeatGame(Game):
    """A game whose agent takes one of the seats.

    Attributes:
        seat: the agent's.
    """

    seat: SpooferSeat | DefenderSeat

    @property
    def fields(self) -> tuple[Field, ...]:
        """The entries of the agent's observation, in order."""
        return self.seat.fields

    @property
    def observation_space(self) -> spaces.Box:
        """Of one lane."""
        return self.seat.observation_space

    @property
    def action_space(self) -> spaces.Space[Any]:
        """Of one lane."""
        return self.seat.space

    @property
    def error(self) -> Floats:
        """Horizontal error of the estimate when last resolved, (N,), m."""
        return self.seat.error

    @property
    def attacked(self) -> Flags:
        """Whether the present fix is spoofed, (N,)."""
        return self.simulation.attacked

    def observation(self) -> NDArray[np.float32]:
        """What each lane's agent sees, (N, D)."""
        return self.seat.observation()

    def reset_values(self) -> dict[str, Any]:
        """Infos after a reset, of all lanes."""
        return self.seat.reset_values()

    def step_values(self, outcome: Any) -> dict[str, Any]:
        """Infos after a step, of all lanes."""
        return self.seat.step_values(outcome)

    def end_values(self, outcome: Any) -> dict[str, Any]:
        """Infos of games that are over, of all lanes, beside those of their last step."""
        return self.seat.end_values(outcome)
