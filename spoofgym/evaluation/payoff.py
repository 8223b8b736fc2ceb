"""Payoff matrices of a zero-sum game: who should play what, what it is worth, and how exploitable a mixture is.

Rows are spoofers and want the payoff large; columns are defenders and want it small. Everything here is exact for the
matrix. The matrix itself is a mean over games, and `value_interval` says what that leaves open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from spoofgym import validation
from spoofgym.arrays import Floats

OWNER = "payoff matrix"
RESAMPLES = 1000
NEGLIGIBLE = 1e-9
"""A probability below this is rounding of the linear programme."""


@dataclass(frozen=True)
class Mixtures:
    """How both sides mix their players.

    Attributes:
        spoofers: probability of each row, (S,).
        defenders: probability of each column, (D,).
        value: payoff of the two mixtures against each other.
    """

    spoofers: Floats
    defenders: Floats
    value: float


def check_matrix(matrix: object) -> Floats:
    """A payoff matrix as finite numbers, (S, D).

    Raises:
        ValueError: it has no row or no column, rows of unlike lengths, or an entry that is not finite.
    """
    try:
        numbers = np.asarray(matrix, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{OWNER}: it must be numbers in rows of equal lengths") from error
    if numbers.ndim != 2 or 0 in numbers.shape:
        raise ValueError(f"{OWNER}: it needs at least one row and one column, got shape {numbers.shape}")
    if not np.isfinite(numbers).all():
        row, column = np.argwhere(~np.isfinite(numbers))[0]
        raise ValueError(f"{OWNER}: row {row} has no number in column {column}, got {numbers[row, column]}")
    return numbers


def nash(matrix: object) -> Mixtures:
    """An equilibrium: neither side gains by changing its mixture alone.

    Each side's mixture is a linear programme (von Neumann): the spoofer maximises its worst case over the columns, the
    defender minimises its worst case over the rows.

    Args:
        matrix: payoffs, (S, D).

    Raises:
        ValueError: as `check_matrix`.
    """
    payoffs = check_matrix(matrix)
    spoofers = _safest(payoffs)
    defenders = _safest(-payoffs.T)
    return Mixtures(spoofers, defenders, float(spoofers @ payoffs @ defenders))


def uniform(matrix: object) -> Mixtures:
    """Every player as often as every other of its side.

    Raises:
        ValueError: as `check_matrix`.
    """
    payoffs = check_matrix(matrix)
    rows, columns = payoffs.shape
    return Mixtures(np.full(rows, 1.0 / rows), np.full(columns, 1.0 / columns), float(payoffs.mean()))


def stackelberg(matrix: object) -> Mixtures:
    """The defender commits first, to a single player, and the spoofer answers it.

    This is the order in the field: a monitor is fielded, then attacked.

    Raises:
        ValueError: as `check_matrix`.
    """
    payoffs = check_matrix(matrix)
    committed = int(payoffs.max(axis=0).argmin())
    answer = int(payoffs[:, committed].argmax())
    spoofers, defenders = (np.zeros(n) for n in payoffs.shape)
    spoofers[answer], defenders[committed] = 1.0, 1.0
    return Mixtures(spoofers, defenders, float(payoffs[answer, committed]))


META_STRATEGIES = {"nash": nash, "uniform": uniform, "stackelberg": stackelberg}


def nash_conv(matrix: object, spoofers: Floats, defenders: Floats) -> float:
    """How much both sides together could gain by their best answers within the matrix; 0 at an equilibrium.

    Args:
        matrix: payoffs, (S, D).
        spoofers: probabilities of the rows, (S,).
        defenders: probabilities of the columns, (D,).

    Raises:
        ValueError: as `check_matrix`, or probabilities that are none or of another number.
    """
    payoffs = check_matrix(matrix)
    rows = check_probabilities("spoofers", spoofers, payoffs.shape[0])
    columns = check_probabilities("defenders", defenders, payoffs.shape[1])
    return float((payoffs @ columns).max() - (rows @ payoffs).min())


def exploitability(matrix: object) -> Floats:
    """The largest payoff against each defender within the matrix, (D,).

    Raises:
        ValueError: as `check_matrix`.
    """
    worst: Floats = check_matrix(matrix).max(axis=0)
    return worst


def check_probabilities(name: str, values: object, count: int) -> Floats:
    """Probabilities that sum to 1, (count,).

    Raises:
        ValueError: they are none.
    """
    numbers = validation.floats(OWNER, name, values)
    if numbers.shape != (count,) or (numbers < 0.0).any() or abs(numbers.sum() - 1.0) > 1e-9:
        raise ValueError(f"{OWNER}: {name} must be {count} probabilities that sum to 1, got {validation.shown(values)}")
    return numbers


def _safest(payoffs: Floats) -> Floats:
    """The mixture of rows whose smallest payoff over the columns is largest, (S,)."""
    rows, columns = payoffs.shape
    # the payoffs of a game may be tiny shares or hundreds of metres: the solver's tolerance is absolute
    low, high = payoffs.min(), payoffs.max()
    scaled = (payoffs - low) / (high - low) if high > low else np.zeros_like(payoffs)
    found = linprog(
        np.append(np.zeros(rows), -1.0),
        A_ub=np.hstack([-scaled.T, np.ones((columns, 1))]),
        b_ub=np.zeros(columns),
        A_eq=np.append(np.ones(rows), 0.0)[None],
        b_eq=[1.0],
        bounds=[(0.0, None)] * rows + [(None, None)],
        method="highs",
    )
    if not found.success:
        raise RuntimeError(f"{OWNER}: the linear programme found no equilibrium: {found.message}")
    mixture = np.where(found.x[:rows] < NEGLIGIBLE, 0.0, found.x[:rows])
    return mixture / mixture.sum()


def value_interval(harms: Floats, seed: int = 0, resamples: int = RESAMPLES) -> tuple[float, float]:
    """95 % bootstrap interval of the value of the game, over the games that the matrix is a mean of.

    Game i of every cell has the same random numbers, so games are drawn for all cells together.

    Args:
        harms: of every game, (S, D, G); NaN after the games of a cell that has fewer than others.
        seed: of the resampling.
        resamples: how often.

    Raises:
        ValueError: a cell of fewer than two games, or as `check_matrix`.
    """
    games = np.asarray(harms, dtype=np.float64)
    there = ~np.isnan(games)
    if games.ndim != 3 or not (there.sum(axis=-1) >= 2).all():
        raise ValueError(f"{OWNER}: an interval needs harms (S, D, G) of two games or more, got shape {games.shape}")
    rng = np.random.default_rng(seed)
    count = games.shape[2]
    played, present = np.where(there, games, 0.0), there.astype(np.float64)
    values = []
    for _ in range(validation.whole(OWNER, "resamples", resamples, 1)):
        drawn = rng.multinomial(count, np.full(count, 1.0 / count)).astype(np.float64)
        values.append(nash((played @ drawn) / (present @ drawn)).value)
    low, high = np.percentile(values, (2.5, 97.5))
    return float(low), float(high)
