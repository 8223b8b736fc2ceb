"""Which differences of payoffs decide who is mixed in: one contest for each player of a solved matrix.

A contest is a weighted sum of cells. Its mean over games of common random numbers says whether a player belongs to a
support, and the interval of that mean whether the games played decide it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.evaluation.metrics import mean_interval
from spoofgym.evaluation.payoff import Mixtures, nash

ROUNDING = 1e-9
"""A difference below this share of the largest payoff is none: sums in another order."""


@dataclass(frozen=True)
class Contest:
    """Whether a player belongs to the support of its side.

    Attributes:
        weights: of every cell in the sum, (S, D). The player belongs there if the sum is positive.
        mixed: whether the mixtures at hand mix it in; None = they do not know it yet.
    """

    weights: Floats
    mixed: bool | None

    def tied(self, gained: Floats, largest: float) -> bool:
        """Whether every game is worth the same to both: then more of them would decide nothing.

        Args:
            gained: the weighted sum of every game, (G,).
            largest: payoff of the matrix.
        """
        return bool((np.abs(gained) <= ROUNDING * largest).all())

    def decided(self, gained: Floats, largest: float) -> bool:
        """Whether the interval of the sum excludes zero, on the side that the mixtures have it.

        Args:
            gained: the weighted sum of every game, (G,).
            largest: payoff of the matrix.
        """
        low, high = mean_interval(gained)
        belongs, does_not = low > ROUNDING * largest, high < -ROUNDING * largest
        return (belongs and self.mixed is not False) or (does_not and self.mixed is not True)


def nash_contests(matrix: Floats, mixtures: Mixtures) -> list[Contest]:
    """Every player against the equilibrium of the game without it: if it gains there, it belongs to the support.

    The equilibrium of a game does not change when somebody leaves who is not mixed in. The mixtures are held as they
    are found; the interval of a gain is over the games alone.

    Args:
        matrix: payoffs, (S, D).
        mixtures: its equilibrium.
    """
    found = []
    spoofers, defenders = mixtures.spoofers, mixtures.defenders
    rows, columns = matrix.shape
    for row in range(rows if rows > 1 else 0):
        own, other = spoofers, defenders
        if spoofers[row] > 0.0:
            rest = nash(np.delete(matrix, row, axis=0))
            own, other = np.insert(rest.spoofers, row, 0.0), rest.defenders
        found.append(Contest(np.outer(_only(row, rows) - own, other), bool(spoofers[row] > 0.0)))
    for column in range(columns if columns > 1 else 0):
        own, other = defenders, spoofers
        if defenders[column] > 0.0:
            rest = nash(np.delete(matrix, column, axis=1))
            own, other = np.insert(rest.defenders, column, 0.0), rest.spoofers
        found.append(Contest(np.outer(other, own - _only(column, columns)), bool(defenders[column] > 0.0)))
    return found


def stackelberg_contests(matrix: Floats, mixtures: Mixtures) -> list[Contest]:
    """Every spoofer against the answer to the defender that commits, and every defender's worst case against its own.

    Args:
        matrix: payoffs, (S, D).
        mixtures: the defender that commits, and the spoofer that answers it.
    """
    rows, columns = matrix.shape
    answer, committed = int(mixtures.spoofers.argmax()), int(mixtures.defenders.argmax())
    value = np.outer(_only(answer, rows), _only(committed, columns))
    found = [
        Contest(np.outer(_only(row, rows), _only(committed, columns)) - value, False)
        for row in range(rows)
        if row != answer
    ]
    for column in range(columns):
        if column != committed:
            worst = np.outer(_only(int(matrix[:, column].argmax()), rows), _only(column, columns))
            found.append(Contest(value - worst, False))
    return found


def uniform_contests(matrix: Floats, mixtures: Mixtures) -> list[Contest]:
    """None: everybody is mixed in, whatever the payoffs are."""
    return []


CONTESTS: dict[str, Callable[[Floats, Mixtures], list[Contest]]] = {
    "nash": nash_contests,
    "uniform": uniform_contests,
    "stackelberg": stackelberg_contests,
}
"""Of every meta-strategy of `spoofgym.evaluation.payoff`."""


def _only(place: int, count: int) -> Floats:
    """All weight on one player."""
    return np.eye(count)[place]
