"""Payoff matrices: closed forms, enumeration, duality, and bad input."""

import itertools
import re

import numpy as np
import pytest

from spoofgym.evaluation.payoff import (
    META_STRATEGIES,
    exploitability,
    nash,
    nash_conv,
    stackelberg,
    uniform,
    value_interval,
)

ROCK = np.array([[0.0, -1.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 1.0, 0.0]])


def test_rock_paper_scissors() -> None:
    found = nash(ROCK)
    np.testing.assert_allclose(found.spoofers, 1 / 3, atol=1e-9)
    np.testing.assert_allclose(found.defenders, 1 / 3, atol=1e-9)
    assert found.value == pytest.approx(0.0, abs=1e-9)
    assert nash_conv(ROCK, found.spoofers, found.defenders) == pytest.approx(0.0, abs=1e-9)
    assert nash_conv(ROCK, np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])) == 2.0


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_two_by_two_without_a_saddle_has_its_closed_form(scale: float) -> None:
    a, b, c, d = 3.0, 1.0, 0.0, 2.0
    found = nash(scale * np.array([[a, b], [c, d]]))
    total = a + d - b - c
    np.testing.assert_allclose(found.spoofers, [(d - c) / total, (a - b) / total], rtol=1e-9)
    np.testing.assert_allclose(found.defenders, [(d - b) / total, (a - c) / total], rtol=1e-9)
    assert found.value == pytest.approx(scale * (a * d - b * c) / total, rel=1e-9)


def value_by_enumeration(matrix: np.ndarray) -> float:
    """Of all square parts whose equalising mixtures are an equilibrium of the whole (Shapley and Snow 1950)."""
    rows, columns = matrix.shape
    for size in range(1, min(rows, columns) + 1):
        for some in itertools.combinations(range(rows), size):
            for others in itertools.combinations(range(columns), size):
                part = matrix[np.ix_(some, others)]
                system = np.block([[part.T, -np.ones((size, 1))], [np.ones((1, size)), np.zeros((1, 1))]])
                dual = np.block([[part, -np.ones((size, 1))], [np.ones((1, size)), np.zeros((1, 1))]])
                if abs(np.linalg.det(system)) < 1e-12 or abs(np.linalg.det(dual)) < 1e-12:
                    continue
                right = np.append(np.zeros(size), 1.0)
                x, y = np.linalg.solve(system, right), np.linalg.solve(dual, right)
                if (x[:-1] < -1e-12).any() or (y[:-1] < -1e-12).any():
                    continue
                value = x[-1]
                if (x[:-1] @ matrix[list(some)] >= value - 1e-9).all() and (
                    matrix[:, list(others)] @ y[:-1] <= value + 1e-9
                ).all():
                    return float(value)
    raise AssertionError("every matrix game has a value")


@pytest.mark.parametrize("shape", [(1, 1), (1, 4), (4, 1), (2, 3), (4, 3), (5, 5)])
def test_the_value_is_that_of_the_enumeration(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(sum(shape))
    for _ in range(20):
        matrix = rng.normal(size=shape)
        found = nash(matrix)
        assert found.value == pytest.approx(value_by_enumeration(matrix), abs=1e-8)
        assert nash_conv(matrix, found.spoofers, found.defenders) == pytest.approx(0.0, abs=1e-8)


def test_the_solver_of_openspiel_agrees() -> None:
    pyspiel = pytest.importorskip("pyspiel")
    solver = pytest.importorskip("open_spiel.python.algorithms.lp_solver")
    matrix = np.random.default_rng(3).normal(size=(6, 4))
    game = pyspiel.create_matrix_game(matrix.tolist(), (-matrix).tolist())
    assert nash(matrix).value == pytest.approx(solver.solve_zero_sum_matrix_game(game)[2], abs=1e-8)


def test_a_defender_that_commits_first_is_worse_off_than_one_that_mixes() -> None:
    matrix = np.array([[4.0, 1.0, 9.0], [0.0, 5.0, 9.0]])
    found = stackelberg(matrix)
    np.testing.assert_array_equal(found.defenders, [1.0, 0.0, 0.0])
    np.testing.assert_array_equal(found.spoofers, [1.0, 0.0])
    assert found.value == 4.0 > nash(matrix).value
    assert found.value == exploitability(matrix).min()
    assert uniform(matrix).value == matrix.mean()
    assert set(META_STRATEGIES) == {"nash", "uniform", "stackelberg"}


def test_the_interval_of_the_value_has_the_width_of_its_deviation() -> None:
    """The value moves by the mixtures' probabilities times what each cell moves by, to first order.

    The 2.5 % points of 300 resamples are known to 9 % of their distance (one sigma), so a width 50 % off is five sigma,
    P = 6e-7; and so is a value outside an interval that reaches 2.5 times as far.
    """
    truth, games = np.array([[3.0, 1.0], [0.0, 2.0]]), 400
    exact = nash(truth)
    harms = truth[:, :, None] + np.random.default_rng(5).normal(size=(2, 2, games))
    low, high = value_interval(harms, resamples=300)
    deviation = np.linalg.norm(np.outer(exact.spoofers, exact.defenders)) / np.sqrt(games)
    assert (high - low) / (2 * 1.96 * deviation) == pytest.approx(1.0, abs=0.5)
    assert low - 1.5 * (high - low) < exact.value < high + 1.5 * (high - low)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        ([], "it needs at least one row and one column, got shape (0,)"),
        ([[]], "it needs at least one row and one column, got shape (1, 0)"),
        ([[1.0, 2.0], [1.0]], "it must be numbers in rows of equal lengths"),
        ([[1.0, float("nan")]], "row 0 has no number in column 1, got nan"),
    ],
)
def test_a_matrix_with_holes_is_refused(matrix: object, message: str) -> None:
    for solve in META_STRATEGIES.values():
        with pytest.raises(ValueError, match=re.escape(message)):
            solve(matrix)


def test_probabilities_must_be_some() -> None:
    with pytest.raises(ValueError, match="spoofers must be 3 probabilities that sum to 1"):
        nash_conv(ROCK, np.array([0.5, 0.5]), np.full(3, 1 / 3))
    with pytest.raises(ValueError, match="an interval needs harms"):
        value_interval(np.zeros((2, 2, 1)))
