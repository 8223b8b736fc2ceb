"""How many games each cell of a payoff matrix gets: more of them where an interval decides a support.

Every cell begins with as many games. As long as the paired interval of a contest leaves open who is mixed in, the cells
of that contest get twice the games that all of them have, up to a largest number. Game i is the same in every cell,
whatever number of games it has, so what is compared stays paired. What is played depends on results alone, never on
who computes them or on what lay on disk: a program that was stopped goes on with the same games.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.evaluation.cell_store import CellStore
from spoofgym.evaluation.contests import Contest
from spoofgym.evaluation.duels import Cell
from spoofgym.evaluation.engine import Engine, Notify


class Allotment:
    """Cells of a growing payoff matrix, and the games that each of them has been given."""

    def __init__(self, store: CellStore, most: int, engine: Engine) -> None:
        """Begin with no cell.

        Args:
            store: where games are kept; it knows with how many a cell begins.
            most: games of a cell.
            engine: plays them.
        """
        self._store, self._most, self._engine = store, most, engine
        self._given: dict[tuple[str, str], int] = {}

    def cells(self, spoofers: Sequence[str], defenders: Sequence[str], notify: Notify) -> list[list[Cell]]:
        """The cells of every spoofer (a row each) against every defender (a column each), with the games they have.

        Args:
            spoofers: specifications.
            defenders: specifications.
            notify: told each cell that is played.

        Raises:
            ValueError: a player that is unknown or does not fit, or a damaged file.
            RuntimeError: a failure of the engine.
        """
        pairs = [(one, two) for one in spoofers for two in defenders]
        for pair in pairs:
            self._given.setdefault(pair, self._store.games)
        self._store.fill({pair: self._given[pair] for pair in pairs}, self._engine, notify)
        return [[self._store.cell(one, two, self._given[one, two]) for two in defenders] for one in spoofers]

    def settle(
        self,
        spoofers: Sequence[str],
        defenders: Sequence[str],
        contests: Callable[[Floats], Sequence[Contest]],
        notify: Notify,
    ) -> list[list[Cell]]:
        """The cells with as many games as decide who is mixed in, or the most.

        Args:
            spoofers: specifications of the rows.
            defenders: specifications of the columns.
            contests: of a matrix of mean payoffs, (S, D); asked again whenever games have been played.
            notify: told each cell that is played.

        Raises:
            ValueError: as `cells`.
            RuntimeError: as `cells`.
        """
        while True:
            cells = self.cells(spoofers, defenders, notify)
            mean = np.array([[cell.mean for cell in row] for row in cells])
            largest = float(np.abs(mean).max())
            wanted = [(contest, self._wanted(cells, contest, largest)) for contest in contests(mean)]
            if not any([self._give(cells, contest, games) for contest, games in wanted]):
                return cells

    def _wanted(self, cells: Sequence[Sequence[Cell]], contest: Contest, largest: float) -> int:
        """How many games each cell of a contest is to have at least.

        Those of a tie have equally many, so that a luckier half of the games of one of them tells nobody apart.
        """
        gained = paired(cells, contest.weights)
        if contest.tied(gained, largest):
            return max((len(harm) for harm, _ in _met(cells, contest.weights)), default=0)
        return 0 if contest.decided(gained, largest) else min(2 * len(gained), self._most)

    def _give(self, cells: Sequence[Sequence[Cell]], contest: Contest, games: int) -> bool:
        """Let the cells of a contest have so many games; whether any gets more."""
        more = False
        for row, column in np.argwhere(contest.weights):
            pair = cells[row][column].spoofer, cells[row][column].defender
            if self._given[pair] < games:
                self._given[pair], more = games, True
        return more


def _met(cells: Sequence[Sequence[Cell]], weights: Floats) -> list[tuple[Floats, float]]:
    """The harm of every game of the cells in a sum, and their weights."""
    return [(cells[row][column].harm, float(weights[row, column])) for row, column in np.argwhere(weights)]


def paired(cells: Sequence[Sequence[Cell]], weights: Floats) -> Floats:
    """The weighted sum of cells in every game that all of them have, (G,).

    Args:
        cells: rows of cells.
        weights: of each, (S, D); cells of weight 0 are left out.
    """
    met = _met(cells, weights)
    if not met:
        return np.zeros(min(len(cell.harm) for row in cells for cell in row))
    games = min(len(harm) for harm, _ in met)
    summed: Floats = np.sum([weight * harm[:games] for harm, weight in met], axis=0)
    return summed
