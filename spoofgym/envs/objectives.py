"""What a spoofer wants: a large error of the estimate, a large deviation of the vehicle, or the vehicle at a place."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.envs.standing import horizontal_error
from spoofgym.guidance import Steering
from spoofgym.scenario import Scenario
from spoofgym.simulation import Simulation
from spoofgym.specification import build
from spoofgym.validation import shown, written

SPELLINGS = "error, deviation or target:EAST/NORTH"
FURTHEST = 1e6
"""Of a target from the path along each axis, m."""


class Objective(ABC):
    """What is read of N games after every epoch, m.

    Attributes:
        name: the specification that builds it.
        drives: whether it is of the vehicle, which has moved when the next epoch is observed; else it is of the
            estimate, which has changed when the present fix is resolved.
    """

    name: str
    drives: bool

    @abstractmethod
    def of(self, simulation: Simulation) -> Floats:
        """What it is now, (N,), m."""


class ErrorObjective(Objective):
    """The horizontal error of the estimate."""

    name, drives = "error", False

    def of(self, simulation: Simulation) -> Floats:
        """Norm of estimate minus truth, east and north, (N,), m."""
        return horizontal_error(simulation)


class DeviationObjective(Objective):
    """The distance of the vehicle from its path."""

    name, drives = "deviation", True

    def of(self, simulation: Simulation) -> Floats:
        """Distance from the path, (N,), m."""
        return steering_of(simulation).distance


class TargetObjective(Objective):
    """By how much the vehicle is nearer to a place beside its path than the path is."""

    drives = True

    def __init__(self, target: str = "") -> None:
        """Lead the vehicle to ``target``, ``EAST/NORTH`` of where it ought to be, m.

        Raises:
            ValueError: it is not two finite numbers, or it is the path itself.
        """
        owner = "objective target"
        parts = str(target).split("/")
        try:
            east, north = (float(part) for part in parts)
        except ValueError as error:
            raise ValueError(f"{owner}: needs EAST/NORTH in m, e.g. target:10/-5, got {shown(target)}") from error
        self._place = np.array([[validation.finite(owner, "east", east, FURTHEST),
                                 validation.finite(owner, "north", north, FURTHEST)]])
        self.distance = float(np.hypot(*self._place[0]))
        if not self.distance:
            raise ValueError(f"{owner}: must lie beside the path, got {shown(target)}")
        self.name = f"target:{written(east)}/{written(north)}"

    def of(self, simulation: Simulation) -> Floats:
        """Distance of the target from the path minus that from the vehicle, (N,), m; negative where it is led away."""
        left = self._place - steering_of(simulation).deviation[:, :2]
        return self.distance - np.sqrt(left[:, 0] ** 2 + left[:, 1] ** 2)


OBJECTIVES: dict[str, Callable[..., Objective]] = {
    "error": ErrorObjective,
    "deviation": DeviationObjective,
    "target": TargetObjective,
}


def make_objective(specification: str, scenario: Scenario) -> Objective:
    """The objective that a specification names.

    Args:
        specification: ``error``, ``deviation`` or ``target:EAST/NORTH``, m.
        scenario: of the game.

    Raises:
        ValueError: it is unknown or wrongly spelled, or it is of a vehicle that keeps its path whatever it estimates.
    """
    made = build(specification, OBJECTIVES, "objective")
    require_guidance(f"objective {made.name!r}", made, scenario)
    return made


def require_guidance(what: str, objective: Objective, scenario: Scenario) -> None:
    """Refuse what is of the vehicle where it is not steered by its estimate.

    Raises:
        ValueError: naming ``what``.
    """
    if objective.drives and scenario.guidance is None:
        raise ValueError(
            f"{what} is of a vehicle that is steered by its estimate, scenario {scenario.name!r} has none: add "
            "guidance=first-order:2 to the scenario"
        )


def steering_of(simulation: Simulation) -> Steering:
    """How far the vehicles of a simulation with guidance are from their paths."""
    assert simulation.steering is not None
    return simulation.steering


def deviation_values(simulation: Simulation) -> dict[str, Floats]:
    """Infos about the vehicle where it is steered by its estimate: its distance from the path, (N,), m."""
    return {} if simulation.steering is None else {"deviation": simulation.steering.distance}
