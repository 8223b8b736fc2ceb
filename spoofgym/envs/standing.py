"""How the games of N lanes stand after an epoch: what every seat is scored by."""

from __future__ import annotations

from dataclasses import dataclass

from spoofgym.arrays import Flags, Floats
from spoofgym.geodesy import horizontal
from spoofgym.simulation import Simulation


@dataclass(frozen=True)
class Standing:
    """How the games of N lanes stand after an epoch.

    Attributes:
        alarm: whether a detector alarms in this epoch of the game, (N,); never at epoch 0.
        caught: whether this alarm ends the game, (N,).
        diverged: whether the filter has diverged, (N,).
        terminated: the game is over, (N,).
    """

    alarm: Flags
    caught: Flags
    diverged: Flags
    terminated: Flags


def horizontal_error(simulation: Simulation) -> Floats:
    """Horizontal error of the estimate, (N,), m."""
    return horizontal(simulation.error)
