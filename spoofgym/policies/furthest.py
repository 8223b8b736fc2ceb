"""The spoofer that is furthest away at the end of the game for its noncentrality: the closed form."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.optimum.closed_form import noncentrality_optimum
from spoofgym.policies.unseen import LARGEST_BUDGET
from spoofgym.specification import spell

NAME = "closed-form"


class Furthest(Attack):
    """Offsets whose mean whitened innovations move the position furthest at the end of the game, for Σ|u|² = budget.

    `spoofgym.policies.unseen` plays for the error over the whole game, this attack for the last one. It knows no limit
    of the drag-off rate (`spoofgym.optimum.closed_form`).

    Args:
        budget: Σ|u|² over the game.

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
        best = noncentrality_optimum(model, model.num_epochs, self._budget)
        self._offsets = np.concatenate([np.zeros((1, 3)), best.offsets])

    def offset(self, clock: Clock) -> Floats:
        """The offset of each run's epoch, (N, 3), m ENU."""
        offsets: Floats = self._offsets[np.maximum(clock.index, 0)]
        return offsets
