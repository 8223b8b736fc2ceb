"""How far vehicles that are steered by their estimates leave their paths: of one game epoch by epoch, and of many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.simulation import Simulation


@dataclass(frozen=True, eq=False)
class Departure:
    """Of one game of T epochs.

    Attributes:
        deviation: distance of the vehicle from its path, (T,), m.
        corridor: whole width of what it may use, m.
    """

    deviation: Floats
    corridor: float

    @property
    def outside(self) -> Flags:
        """Whether the vehicle is outside its corridor, (T,)."""
        return self.deviation > 0.5 * self.corridor


@dataclass(frozen=True, eq=False)
class Departures:
    """Of n games.

    Attributes:
        largest: distance from the path, (n,), m.
        time_outside: spent outside the corridor, (n,), s.
        corridor: its whole width, m.
    """

    largest: Floats
    time_outside: Floats
    corridor: float

    def of(self, games: Any) -> Departures:
        """Some of the games."""
        return Departures(self.largest[games], self.time_outside[games], self.corridor)

    def where(self, games: Flags, others: Departures) -> Departures:
        """These in some games, (n,), and ``others`` in the rest."""
        largest = np.where(games, self.largest, others.largest)
        return Departures(largest, np.where(games, self.time_outside, others.time_outside), self.corridor)

    @property
    def left(self) -> Flags:
        """Whether the vehicle has left its corridor, (n,)."""
        return self.largest > 0.5 * self.corridor


def departures_of(simulation: Simulation) -> Departures | None:
    """What the present games of a simulation have come to; None where the vehicles keep their paths."""
    steering, guidance = simulation.steering, simulation.scenario.guidance
    if steering is None or guidance is None:
        return None
    return Departures(steering.largest.copy(), steering.time_outside.copy(), guidance.width)


def joined(parts: Sequence[Departures | None], axis: int = 0) -> Departures | None:
    """Those of several batches in a row; None where the vehicles keep their paths."""
    found = [part for part in parts if part is not None]
    if not found:
        return None
    largest = np.concatenate([part.largest for part in found], axis=axis)
    return Departures(largest, np.concatenate([part.time_outside for part in found], axis=axis), found[0].corridor)
