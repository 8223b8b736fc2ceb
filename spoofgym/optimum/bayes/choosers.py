"""Defenders who know what the Bayesian knows, but may only choose among the solutions of the vehicle's filter.

`Chooser` can be played: it decides by what is known at the time. The best such defender loses at most as much.
`Hindsight` cannot: it knows all fixes of the game when it decides on the first. No defender that uses fixes or leaves
them out loses less.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.optimum.bayes.estimates import Fixes
from spoofgym.optimum.bayes.median import rice
from spoofgym.optimum.bayes.reach import Solutions, Victim, View, charge, choose, coast, error_now, split, use
from spoofgym.optimum.play import HORIZONTAL

LIKELY = 1e-4
"""Least weight of a part of the posterior that a choice takes account of."""
LONGEST = 12
"""Epochs of a game whose decisions are enumerated."""


def victim_of(model: LinearModel) -> Victim:
    """What a filter believes."""
    return Victim(model.transition, model.process_noise, model.observation, model.measurement_covariance)


def _room(model: LinearModel, places: int) -> Solutions:
    """So many solutions at the beginning of a game."""
    return Solutions(np.zeros((places, model.num_states)), np.tile(model.prior_covariance, (places, 1, 1)))


class Chooser:
    """One game of a defender who takes at each epoch the solution whose expected error now and a while later is least.

    Attributes:
        moved: horizontal position of the filter minus that of the unaided solution after each decision, (E, 2), m.
        expected: horizontal error of the solution that the posterior expects, (E,), m.
        used: whether the fix is used, (E,).
        backtracked: epochs that are taken back, (E,).
    """

    def __init__(self, model: LinearModel, fixes: Fixes, depth: int = 0) -> None:
        """Begin.

        Args:
            model: of the vehicle's filter.
            fixes: of the game.
            depth: epochs that can be taken back where the present fix is left out.
        """
        self._victim, self._fixes, self._depth = victim_of(model), fixes, depth
        # solution n is the filter's without the fixes of the last n epochs; the last place is that with the present one
        self._solutions = _room(model, depth + 2)
        epochs = len(fixes.residual)
        self.moved: Floats = np.zeros((epochs, 2))
        self.expected: Floats = np.zeros(epochs)
        self.used: Flags = np.zeros(epochs, dtype=bool)
        self.backtracked: Runs = np.zeros(epochs, dtype=np.int64)

    def see(self, epoch: int, view: View) -> None:
        """Decide on an epoch."""
        solutions, reach = self._solutions, min(self._depth, epoch) + 1
        likely = view._replace(parts=np.ascontiguousarray(view.parts[:, view.parts[0, :, 0] > LIKELY]))
        coast(epoch, self._victim, solutions, reach)
        available = bool(self._fixes.available[epoch])
        if available:
            use(epoch, self._fixes.residual[epoch], self._victim, solutions, 0, reach)
        chosen = choose(likely, solutions, reach + available, rice())
        self.used[epoch] = chosen == reach
        self.backtracked[epoch] = 0 if chosen == reach else chosen
        self._take(chosen, reach)
        self.moved[epoch] = solutions.moved[0, HORIZONTAL]
        self.expected[epoch] = error_now(view, solutions.moved[0], rice())

    def _take(self, chosen: int, reach: int) -> None:
        """The solution chosen stands first; behind it those that take back the fixes before this one."""
        order = np.arange(-1, self._depth)
        order[0] = chosen
        if chosen < reach:  # what was taken back is gone
            order = np.maximum(order, chosen)
        for part in self._solutions:
            part[: self._depth + 1] = part[order]


class Hindsight:
    """One short game of all who use fixes or leave them out: every sequence of decisions.

    A sequence costs the errors that are expected of it, at each epoch by what is known then. On average over games that
    is what it loses, whoever decides on it, and nobody finds a better one in time than the best in hindsight.
    """

    def __init__(self, model: LinearModel, fixes: Fixes) -> None:
        """Begin.

        Raises:
            ValueError: the game has too many epochs.
        """
        epochs = len(fixes.residual)
        if epochs > LONGEST:
            raise ValueError(f"decisions are enumerated in games of at most {LONGEST} epochs, got {epochs}")
        self._victim, self._fixes = victim_of(model), fixes
        self._solutions, self._costs, self._count = _room(model, 1 << epochs), np.zeros(1 << epochs), 1

    @property
    def costs(self) -> Floats:
        """Sum over the epochs of the expected errors, of each sequence, (C,), m."""
        return self._costs[: self._count]

    def see(self, epoch: int, view: View) -> None:
        """Let every sequence go on with the fix and without it."""
        residual, available = self._fixes.residual[epoch], bool(self._fixes.available[epoch])
        coast(epoch, self._victim, self._solutions, self._count)
        self._count = split(epoch, residual, available, self._victim, self._solutions, self._costs, self._count)
        charge(view, self._solutions, self._costs, self._count, rice())
