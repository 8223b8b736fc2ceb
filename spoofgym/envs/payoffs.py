"""What a duel is played for: payoffs of one epoch's error, which the spoofer gains and the defender loses."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.scenario import Scenario
from spoofgym.specification import build, spell

LARGEST_LIMIT = 1e6
"""Of an error that a payoff is clipped at or asks for, m."""


class Payoff(ABC):
    """What the error of one epoch is worth. A game's payoff, its harm, is the mean over its epochs.

    Attributes:
        name: the specification that builds it.
        unit: of the harm.
        largest: that one epoch can be worth; each epoch of a filter that has diverged is.
    """

    name: str
    unit: str
    largest: float

    @abstractmethod
    def of(self, error: Floats) -> Floats:
        """What horizontal errors (N,), m, are worth, (N,)."""


class ClippedError(Payoff):
    """The error itself, m, at most ``cap``."""

    unit = "m"

    def __init__(self, cap: float) -> None:
        """Clip errors at ``cap``, m.

        Raises:
            ValueError: it is not positive, or too large.
        """
        self.largest = validation.above("payoff error", "cap", cap, largest=LARGEST_LIMIT)
        self.name = spell("error", self.largest)

    def of(self, error: Floats) -> Floats:
        """The smaller of error and cap, (N,), m."""
        return np.minimum(error, self.largest)


class Beyond(Payoff):
    """Whether the error exceeds ``limit``, m: the harm is a share of epochs."""

    unit = "share of epochs"
    largest = 1.0

    def __init__(self, limit: float) -> None:
        """Count errors above ``limit``, m.

        Raises:
            ValueError: it is negative, or too large.
        """
        self.limit = validation.non_negative("payoff beyond", "limit", limit, LARGEST_LIMIT)
        self.name = spell("beyond", self.limit)

    def of(self, error: Floats) -> Floats:
        """1 where the error exceeds the limit, else 0, (N,)."""
        return np.where(error > self.limit, 1.0, 0.0)


def make_payoff(specification: str, scenario: Scenario) -> Payoff:
    """The payoff that a specification names.

    Args:
        specification: ``error`` (clipped at the scenario's ``harm_cap``), ``error:CAP`` or ``beyond:LIMIT``, m.
        scenario: of the game.

    Raises:
        ValueError: it is unknown, or its number is out of range.
    """

    def error(cap: float = scenario.harm_cap) -> Payoff:
        return ClippedError(cap)

    def beyond(limit: float) -> Payoff:
        return Beyond(limit)

    registry: dict[str, Callable[..., Payoff]] = {"error": error, "beyond": beyond}
    return build(validation.text("duel", "payoff", specification), registry, "payoff")
