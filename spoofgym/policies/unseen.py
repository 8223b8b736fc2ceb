"""The spoofer that no test sees for its budget: the largest error over the game for a noncentrality."""

from __future__ import annotations

import math

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.optimum.gain import game_gain
from spoofgym.specification import spell

NAME = "unseen"
LARGEST_BUDGET = 1e9


class Unseen(Attack):
    """Offsets whose mean whitened innovations move the position furthest, on average over the game, for Σ|u|² = budget.

    It is optimal where every fix is used and all that matters is the noncentrality (`spoofgym.optimum.gain`).

    Args:
        budget: Σ|u|² over the game; 1 is no evidence for any test, the threshold of a test is.

    Raises:
        ValueError: a budget that is negative or too large.
    """

    needs_model = True
    knowledge = "shadow"

    def __init__(self, budget: float) -> None:
        self._budget = validation.non_negative(NAME, "budget", budget, LARGEST_BUDGET)

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return spell(NAME, self._budget)

    def study(self, model: LinearModel) -> None:
        """Compute the offsets for the victim's linear model.

        Raises:
            ValueError: the receiver gives more than positions.
        """
        self._offsets = np.concatenate([np.zeros((1, 3)), math.sqrt(self._budget) * game_gain(model).offsets])

    def offset(self, clock: Clock) -> Floats:
        """The offset of each run's epoch, (N, 3), m ENU."""
        offsets: Floats = self._offsets[np.maximum(clock.index, 0)]
        return offsets
