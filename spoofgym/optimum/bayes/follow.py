"""One game of the Bayesian: epoch by epoch, the posterior of all attacks and the estimate that errs least."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.kernels import njit
from spoofgym.optimum.bayes.bank import Bank, Knowledge, Limits, branch, carry, law_of, prune, weigh
from spoofgym.optimum.bayes.median import Rice, expected_distance, geometric_median
from spoofgym.optimum.bayes.sizes import sizes_and_headings

POSITION = 6
"""State of the eastern error of the position."""


class Account(NamedTuple):
    """What comes of a game; leading axis: epochs 0..K.

    Attributes:
        median: geometric median of what the filter misses that takes every fix for true, (K+1, 2), m.
        mean: of what it misses, (K+1, 2), m.
        expected: distance from the median that the posterior expects, (K+1,), m.
        quiet: posterior probability that no attack has begun, (K+1,).
        hypotheses: carried on, (K+1,).
        lost: posterior probability of those that were left out at the epoch, (K+1,).
    """

    median: Floats
    mean: Floats
    expected: Floats
    quiet: Floats
    hypotheses: Floats
    lost: Floats


def blank_account(epochs: int) -> Account:
    """Room for a game of so many epochs."""
    plane = (epochs, 2)
    return Account(np.zeros(plane), np.zeros(plane), *(np.zeros(epochs) for _ in range(4)))


@njit(cache=True, nogil=True, error_model="numpy")
def follow(
    known: Knowledge, whitened: Floats, limits: Limits, bank: Bank, parts: Floats, tables: Rice, account: Account
) -> bool:
    """Follow a game.

    Args:
        known: of the game.
        whitened: innovations of the filter that knows no attack, (K+1, 3).
        limits: what is left out.
        bank: room for hypotheses.
        parts: room for the posterior mixture, (M, 4).
        tables: of `rice`.
        account: what comes of it, result.

    Returns:
        Whether there was room for all hypotheses.
    """
    nodes = np.empty((len(known.rule.place) * known.rule.headings, 4))
    count = 0
    for epoch in range(len(whitened)):
        if epoch > 0:
            count = branch(bank, count, epoch, known)
            if count > len(bank.node):
                return False
            carry(bank, count, epoch, known, whitened[epoch])
        total = weigh(bank, count, epoch, known, limits, nodes)
        count, account.lost[epoch] = prune(bank, count, limits.kept, total)
        used = _mix(bank, count, epoch, known, total, limits, (nodes, parts))
        if used > len(parts):
            return False
        mixture = parts[:used]
        x, y = _normalise(mixture)
        account.mean[epoch, 0], account.mean[epoch, 1] = x, y
        x, y = geometric_median(mixture, (x, y), tables)
        account.median[epoch, 0], account.median[epoch, 1] = x, y
        account.expected[epoch] = expected_distance(mixture, x, y, tables)
        account.quiet[epoch] = math.exp(known.prior.quiet[epoch] - total)
        account.hypotheses[epoch] = count
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _normalise(parts: Floats) -> tuple[float, float]:
    """Let weights sum to 1; the mean."""
    total = x = y = 0.0
    for i in range(len(parts)):
        total += parts[i, 0]
        x += parts[i, 0] * parts[i, 1]
        y += parts[i, 0] * parts[i, 2]
    for i in range(len(parts)):
        parts[i, 0] /= total
    return x / total, y / total


@njit(cache=True, nogil=True, error_model="numpy")
def _mix(
    bank: Bank,
    count: int,
    epoch: int,
    known: Knowledge,
    total: float,
    limits: Limits,
    room: tuple[Floats, Floats],
) -> int:
    """What the filter misses, as a mixture of round Gaussians; their number, above the room if too many."""
    nodes, parts = room
    covariance = known.filter.covariance[epoch]
    own = 0.5 * (covariance[0, 0] + covariance[1, 1])
    parts[0, 0], parts[0, 1], parts[0, 2] = math.exp(known.prior.quiet[epoch] - total), 0.0, 0.0
    parts[0, 3] = math.sqrt(own)
    used = 1
    for i in range(count):
        if bank.weight[i] < total + limits.mixed:
            continue
        if used + len(nodes) > len(parts):
            return len(parts) + 1
        share = math.exp(bank.weight[i] - total)
        state, moments = bank.state[i], bank.moments[i]
        spread = 0.0
        for b in range(POSITION, POSITION + 2):
            spread += state[0, b] ** 2 * moments[2] + 2.0 * state[0, b] * state[1, b] * moments[3]
            spread += state[1, b] ** 2 * moments[4]
        if bank.weight[i] < total + limits.spread or spread < 0.2 * own:
            _put(parts[used], share, state, moments[0], moments[1], own + 0.5 * max(spread, 0.0))
            used += 1
            continue
        kind, law, left = law_of(bank, i, known.tree)
        sizes_and_headings(bank.linear[i], bank.quadratic[i], kind, law, left, known.rule, nodes)
        for j in range(len(nodes)):
            if nodes[j, 0] > 1e-6:
                _put(parts[used], share * nodes[j, 0], state, nodes[j, 1], nodes[j, 2], own)
                used += 1
    return used


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _put(part: Floats, weight: float, state: Floats, x: float, y: float, variance: float) -> None:
    """One Gaussian of the mixture: that of the attack (x, y) with a hypothesis's mean error per unit, (2, n)."""
    part[0] = weight
    part[1] = state[0, POSITION] * x + state[1, POSITION] * y
    part[2] = state[0, POSITION + 1] * x + state[1, POSITION + 1] * y
    part[3] = math.sqrt(variance)
