"""What a duel is played for: payoffs of one epoch, which the spoofer gains and the defender loses."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.envs.objectives import (
    DeviationObjective,
    ErrorObjective,
    Objective,
    TargetObjective,
    require_guidance,
)
from spoofgym.scenario import Scenario
from spoofgym.specification import build, spell

PAYOFFS = "error[:CAP], beyond:LIMIT, deviation[:CAP] or target:EAST/NORTH"
"""How they are spelled; those of the deviation need a scenario with guidance."""
LARGEST_LIMIT = 1e6
"""Of an error that a payoff is clipped at or asks for, m."""


class Payoff(ABC):
    """What one epoch is worth. A game's payoff, its harm, is the mean over its epochs.

    Attributes:
        name: the specification that builds it.
        unit: of the harm.
        objective: what is read of an epoch.
        largest: that one epoch can be worth; each epoch of a filter that has diverged is.
    """

    name: str
    unit: str
    objective: Objective
    largest: float

    @abstractmethod
    def of(self, values: Floats) -> Floats:
        """What values (N,) of the objective, m, are worth, (N,)."""


class Clipped(Payoff):
    """The objective itself, m, at most ``cap``."""

    unit = "m"

    def __init__(self, objective: Objective, cap: float) -> None:
        """Clip an objective at ``cap``, m.

        Raises:
            ValueError: it is not positive, or too large.
        """
        self.objective = objective
        self.largest = validation.above(f"payoff {objective.name}", "cap", cap, largest=LARGEST_LIMIT)
        self.name = spell(objective.name, self.largest)

    def of(self, values: Floats) -> Floats:
        """The smaller of value and cap, (N,), m."""
        return np.minimum(values, self.largest)


class Beyond(Payoff):
    """Whether the error exceeds ``limit``, m: the harm is a share of epochs."""

    unit = "share of epochs"
    largest = 1.0

    def __init__(self, limit: float) -> None:
        """Count errors above ``limit``, m.

        Raises:
            ValueError: it is negative, or too large.
        """
        self.objective = ErrorObjective()
        self.limit = validation.non_negative("payoff beyond", "limit", limit, LARGEST_LIMIT)
        self.name = spell("beyond", self.limit)

    def of(self, values: Floats) -> Floats:
        """1 where the error exceeds the limit, else 0, (N,)."""
        return np.where(values > self.limit, 1.0, 0.0)


class Nearer(Payoff):
    """By how much the vehicle is nearer to a target than its path is, m."""

    unit = "m"

    def __init__(self, target: str) -> None:
        """Lead the vehicle to ``target``; spelling and errors as of `TargetObjective`."""
        objective = TargetObjective(target)
        self.objective, self.name, self.largest = objective, objective.name, objective.distance

    def of(self, values: Floats) -> Floats:
        """The objective itself, (N,), m."""
        return values


def make_payoff(specification: str, scenario: Scenario) -> Payoff:
    """The payoff that a specification names.

    Args:
        specification: ``error`` (clipped at the scenario's ``harm_cap``), ``error:CAP`` or ``beyond:LIMIT``, m; where
            the vehicle is steered by its estimate ``deviation``, ``deviation:CAP`` and ``target:EAST/NORTH``, too.
        scenario: of the game.

    Raises:
        ValueError: it is unknown, its number is out of range, or it is of a vehicle that keeps its path whatever it
            estimates.
    """

    def error(cap: float = scenario.harm_cap) -> Payoff:
        return Clipped(ErrorObjective(), cap)

    def deviation(cap: float = scenario.harm_cap) -> Payoff:
        return Clipped(DeviationObjective(), cap)

    def beyond(limit: float) -> Payoff:
        return Beyond(limit)

    def target(target: str = "") -> Payoff:
        return Nearer(target)

    registry: dict[str, Callable[..., Payoff]] = {
        "error": error, "beyond": beyond, "deviation": deviation, "target": target
    }
    made = build(validation.text("duel", "payoff", specification), registry, "payoff")
    require_guidance(f"payoff {made.name!r}", made.objective, scenario)
    return made
