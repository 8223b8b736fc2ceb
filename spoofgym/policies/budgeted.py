"""Attacks that spend a budget of noncentrality: a row of offsets, computed once for the victim's linear model."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.specification import spell

LARGEST_BUDGET = 1e9


class BudgetedAttack(Attack):
    """Offsets that do not depend on chance, whose mean whitened innovations u have Σ|u|² = budget over the game.

    Args:
        budget: Σ|u|²; 1 is no evidence for any test, the threshold of a test is.

    Attributes:
        kind: how the attack is spelled.

    Raises:
        ValueError: a budget that is negative or too large.
    """

    kind: str
    needs_model = True
    knowledge = "shadow"

    def __init__(self, budget: float) -> None:
        self._budget = validation.non_negative(self.kind, "budget", budget, LARGEST_BUDGET)

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return spell(self.kind, self._budget)

    @abstractmethod
    def best_offsets(self, model: LinearModel, budget: float) -> Floats:
        """The offsets of epochs 1..K, (K, 3), m ENU.

        Raises:
            ValueError: the receiver gives more than positions.
        """

    def study(self, model: LinearModel) -> None:
        """Compute the offsets for the victim's linear model.

        Raises:
            ValueError: the receiver gives more than positions.
        """
        self._offsets = np.concatenate([np.zeros((1, 3)), self.best_offsets(model, self._budget)])

    def offset(self, clock: Clock) -> Floats:
        """The offset of each run's epoch, (N, 3), m ENU."""
        offsets: Floats = self._offsets[np.maximum(clock.index, 0)]
        return offsets
