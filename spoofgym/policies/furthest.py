"""The spoofer that is furthest away at the end of the game for its noncentrality: the closed form."""

from __future__ import annotations

from spoofgym.arrays import Floats
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.optimum.closed_form import noncentrality_optimum
from spoofgym.policies.budgeted import BudgetedAttack

NAME = "closed-form"


class Furthest(BudgetedAttack):
    """Offsets that move the position furthest at the end of the game, for Σ|u|² = budget.

    `spoofgym.policies.unseen` plays for the error over the whole game, this attack for the last one. It knows no limit
    of the drag-off rate (`spoofgym.optimum.closed_form`).

    Args:
        budget: Σ|u|² over the game.

    Raises:
        ValueError: a budget that is negative or too large.
    """

    kind = NAME

    def best_offsets(self, model: LinearModel, budget: float) -> Floats:
        """The offsets of epochs 1..K, (K, 3), m ENU.

        Raises:
            ValueError: the receiver gives more than positions.
        """
        return noncentrality_optimum(model, model.num_epochs, budget).offsets
