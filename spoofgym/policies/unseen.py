"""The spoofer that no test sees for its budget: the largest error over the game for a noncentrality."""

from __future__ import annotations

import math

from spoofgym.arrays import Floats
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.optimum.gain import game_gain
from spoofgym.policies.budgeted import BudgetedAttack

NAME = "unseen"


class Unseen(BudgetedAttack):
    """Offsets that move the position furthest, on average over the game, for Σ|u|² = budget.

    This attack is optimal where every fix is used and all that matters is the noncentrality (`spoofgym.optimum.gain`).

    Args:
        budget: Σ|u|² over the game; 1 is no evidence for any test, the threshold of a test is.

    Raises:
        ValueError: a budget that is negative or too large.
    """

    kind = NAME

    def best_offsets(self, model: LinearModel, budget: float) -> Floats:
        """The offsets of epochs 1..K, (K, 3), m ENU.

        Raises:
            ValueError: the receiver gives more than positions.
        """
        return math.sqrt(budget) * game_gain(model).offsets
