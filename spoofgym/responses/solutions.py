"""The solutions among which a defender can choose, and the one whose expected error is least.

All are told by what lies between the unaided inertial solution and them. The unaided solution is untouched by any
decision and both meet the same inertial noise, so Φ alone carries such a difference.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.error_model import NUM_INERTIAL
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.responses.hypotheses import Bank

MOMENTS = 2
"""The error is looked at now and a while ahead."""
SEEN = 2 * MOMENTS
"""Horizontal positions at these moments."""
NO_LIMIT = 0.0
"""In the place of a limit: an error is worth its size, m."""
SIZE_SHARE = 1e-3
"""What an error as large as the limit is worth beside exceeding it."""
TINY = 1e-12
"""A variance below which a position is known, m²."""


class Solutions(NamedTuple):
    """The solutions of N runs.

    Attributes:
        filter: unaided solution minus the filter, (N, 15).
        correction: what the present fix would subtract from the filter's error, (N, 15).
        past: unaided solution minus what the filter is if the fixes of the last n epochs are taken back, (N, H+1, 15);
            n = 0 is the filter itself.
        reach: how many epochs can be taken back, (N,).
    """

    filter: Floats
    correction: Floats
    past: Floats
    reach: Runs


class Choice(NamedTuple):
    """What is decided in N runs.

    Attributes:
        use: the present fix, (N,).
        backtrack: epochs to take back, (N,).
        expected: what the error of the solution chosen is expected to be worth, mean of both moments, (N,).
    """

    use: Flags
    backtrack: Runs
    expected: Floats


def look_ahead(model: LinearModel, epochs: int) -> Floats:
    """From an error to the horizontal position now and some epochs ahead, (K+1, 4, 15).

    Args:
        model: of the game.
        epochs: how far to look; beyond the end of the game to its end.
    """
    last = model.num_epochs
    rows = np.zeros((last + 1, SEEN, NUM_INERTIAL))
    rows[:, [0, 1], [6, 7]] = 1.0
    for k in range(last + 1):
        product = np.eye(NUM_INERTIAL)
        for step in range(k + 1, min(k + epochs, last) + 1):
            product = model.transition[step] @ product
        rows[k, 2:] = product[6:8]
    return rows


@njit(cache=True, nogil=True, error_model="numpy")
def carry_past(runs: Runs, index: Runs, transition: Floats, backtracked: Runs, solutions: Solutions) -> None:
    """Carry the differences of the past solutions to the present epoch, and put the filter's in front.

    Args:
        runs: which, (n,).
        index: their epochs, (N,).
        transition: Φ, (K+1, 15, 15).
        backtracked: epochs taken back in the epoch before, (N,): the solutions since then are that of the oldest.
        solutions: ``past`` is changed in place.
    """
    work, oldest = np.empty(9), np.empty(NUM_INERTIAL)
    for run in runs:
        past = solutions.past[run]
        depth = min(backtracked[run], len(past) - 1)
        for j in range(NUM_INERTIAL):
            oldest[j] = past[depth, j]
        for n in range(len(past) - 1, 0, -1):
            for j in range(NUM_INERTIAL):
                past[n, j] = past[n - 1, j] if n - 1 > depth else oldest[j]
            kalman.predict_mean(transition[index[run]], past[n], work)
        for j in range(NUM_INERTIAL):
            past[0, j] = solutions.filter[run, j]


@njit(cache=True, nogil=True, error_model="numpy")
def position(rows: Floats, error: Floats, seen: Floats) -> None:
    """The horizontal positions, now and ahead (4,), of an error (15,)."""
    for a in range(SEEN):
        seen[a] = 0.0
        for j in range(NUM_INERTIAL):
            seen[a] += rows[a, j] * error[j]


@njit(cache=True, nogil=True, error_model="numpy")
def _variance(rows: Floats, covariance: Floats) -> float:
    """Trace of the horizontal covariance that two rows of an error make."""
    total = 0.0
    for a in range(2):
        for i in range(NUM_INERTIAL):
            if rows[a, i] != 0.0:
                for j in range(NUM_INERTIAL):
                    total += rows[a, i] * covariance[i, j] * rows[a, j]
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def exceedance(square: float, variance: float, limit: float) -> float:
    """Probability that a horizontal Gaussian vector is longer than a limit.

    With equal variances σ² of both axes |e|²/σ² has the noncentral chi-square distribution of two degrees of freedom
    and noncentrality λ = |μ|²/σ². Its power h is nearly normal (Sankaran 1963); the probability is right to 0.02.

    Args:
        square: |μ|², m².
        variance: 2 σ², m².
        limit: m.
    """
    if variance < TINY:
        return 1.0 if square > limit * limit else 0.0
    noncentrality = 2.0 * square / variance
    mean = 2.0 + noncentrality
    h = 1.0 - mean * (2.0 + 3.0 * noncentrality) * 2.0 / (3.0 * (2.0 + 2.0 * noncentrality) ** 2)
    p = (2.0 + 2.0 * noncentrality) / mean**2
    m = (h - 1.0) * (1.0 - 3.0 * h)
    centre = 1.0 + h * p * (h - 1.0 - 0.5 * (2.0 - h) * m * p)
    spread = h * math.sqrt(2.0 * p) * (1.0 + 0.5 * m * p)
    return 0.5 * math.erfc(((2.0 * limit * limit / (variance * mean)) ** h - centre) / (spread * math.sqrt(2.0)))


@njit(cache=True, nogil=True, error_model="numpy")
def _price(square: float, variance: float, limit: float) -> float:
    """What an error is expected to be worth under a Gaussian hypothesis.

    Without a limit that is its size, taken as √(|μ|² + tr Σ), m. With one it is the probability that the error exceeds
    the limit, and a small share of the size, because far from the limit all are alike.

    Args:
        square: |μ|², m².
        variance: tr Σ, m².
        limit: m; 0 = none.
    """
    size = math.sqrt(square + variance)
    if limit == 0.0:
        return size
    return exceedance(square, variance, limit) + SIZE_SHARE * size / limit


@njit(cache=True, nogil=True, error_model="numpy")
def loss_at(moment: int, weight: Floats, means: Floats, variances: Floats, seen: Floats, limit: float) -> float:
    """What the error of a solution is expected to be worth at one moment, 0 = now, 1 = ahead; as `expected_loss`."""
    total = 0.0
    for h in range(len(weight)):
        if weight[h] > 0.0:
            east = means[h, 2 * moment] - seen[2 * moment]
            north = means[h, 2 * moment + 1] - seen[2 * moment + 1]
            total += weight[h] * _price(east * east + north * north, variances[h, moment], limit)
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def expected_loss(weight: Floats, means: Floats, variances: Floats, seen: Floats, limit: float) -> float:
    """What the error of a solution is expected to be worth, mean of both moments.

    Args:
        weight: probabilities of the hypotheses, (M,).
        means: positions of the unaided solution's error at both moments, (M, 4), m.
        variances: traces of their horizontal covariances, (M, 2), m².
        seen: the same positions of the unaided solution minus this one, (4,), m.
        limit: that an error shall not exceed, m; 0 = an error is worth its size, m.
    """
    total = 0.0
    for moment in range(MOMENTS):
        total += loss_at(moment, weight, means, variances, seen, limit)
    return total / MOMENTS


@njit(cache=True, nogil=True, error_model="numpy")
def weigh_positions(
    looked: Floats, run: int, bank: Bank, weight: Floats, means: Floats, variances: Floats
) -> None:
    """Fill the probabilities of a run's hypotheses, and where they see the unaided solution's error.

    Args:
        looked: rows of `look_ahead` at the run's epoch, (4, 15).
        run: which.
        bank: the hypotheses.
        weight: (M,), filled.
        means: (M, 4), m, filled.
        variances: (M, 2), m², filled.
    """
    for h in range(len(weight)):
        weight[h] = np.exp(bank.log_weight[run, h])
        if weight[h] > 0.0:
            position(looked, bank.mean[run, h], means[h])
            for moment in range(MOMENTS):
                variances[h, moment] = _variance(looked[2 * moment :], bank.covariance[run, h])


@njit(cache=True, nogil=True, error_model="numpy")
def choose(
    runs: Runs,
    index: Runs,
    available: Flags,
    rows: Floats,
    bank: Bank,
    solutions: Solutions,
    limit: float,
    choice: Choice,
) -> None:
    """Choose the solution whose error is expected to be worth least; of equal ones the filter's, then the least depth.

    Args:
        runs: which, (n,).
        index: their epochs, (N,).
        available: whether there is a fix, (N,).
        rows: of `look_ahead`, (K+1, 4, 15).
        bank: the hypotheses.
        solutions: those that can be chosen.
        limit: that an error shall not exceed, m; 0 = an error is worth its size.
        choice: filled.
    """
    hypotheses = bank.log_weight.shape[1]
    weight, means, variances = np.empty(hypotheses), np.empty((hypotheses, SEEN)), np.empty((hypotheses, MOMENTS))
    seen, used = np.empty(SEEN), np.empty(NUM_INERTIAL)
    for run in runs:
        looked = rows[index[run]]
        weigh_positions(looked, run, bank, weight, means, variances)
        best = np.inf
        choice.use[run], choice.backtrack[run] = False, 0
        if available[run]:
            for j in range(NUM_INERTIAL):
                used[j] = solutions.filter[run, j] + solutions.correction[run, j]
            position(looked, used, seen)
            best = expected_loss(weight, means, variances, seen, limit)
            choice.use[run] = True
        for n in range(min(solutions.reach[run], solutions.past.shape[1] - 1) + 1):
            position(looked, solutions.past[run, n], seen)
            loss = expected_loss(weight, means, variances, seen, limit)
            if loss < best - 1e-9:
                best = loss
                choice.use[run], choice.backtrack[run] = False, n
        choice.expected[run] = best
