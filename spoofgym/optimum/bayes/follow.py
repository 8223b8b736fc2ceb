"""One epoch of the Bayesian: the posterior of all attacks, and of what the filter that trusts every fix misses."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.kernels import njit
from spoofgym.optimum.bayes.bank import Bank, Knowledge, Limits, branch, carry, law_of, prune, weigh
from spoofgym.optimum.bayes.sizes import sizes_and_headings

POSITION = 6
"""State of the eastern error of the position."""


class Room(NamedTuple):
    """Where an epoch is worked out.

    Attributes:
        bank: of hypotheses.
        nodes: of the integral over size and heading, (R T, 4).
        parts: of the posterior mixture now and a while later, (2, M, 4): weight, mean (2) and deviation per axis of
            round Gaussians, m.
    """

    bank: Bank
    nodes: Floats
    parts: Floats


class Posterior(NamedTuple):
    """What comes of an epoch.

    Attributes:
        hypotheses: carried on; more than there is room for, if there is too little.
        total: logarithm of the sum of all weights.
        quiet: probability that no attack has begun.
        lost: probability of the hypotheses that were left out.
    """

    hypotheses: int
    total: float
    quiet: float
    lost: float


@njit(cache=True, nogil=True, error_model="numpy")
def follow(known: Knowledge, epoch: int, whitened: Floats, limits: Limits, room: Room, count: int) -> Posterior:
    """Follow a game over an epoch.

    Args:
        known: of the game.
        epoch: of the fix.
        whitened: innovation of the filter that knows no attack, (3,).
        limits: what is left out.
        room: its bank is that after the epoch before, in place.
        count: hypotheses of the epoch before.
    """
    bank = room.bank
    if epoch > 0:
        count = branch(bank, count, epoch, known)
        if count > len(bank.node):
            return Posterior(count, 0.0, 0.0, 0.0)
        carry(bank, count, epoch, known, whitened)
    total = weigh(bank, count, epoch, known, limits, room.nodes)
    count, lost = prune(bank, count, limits.kept, total)
    return Posterior(count, total, math.exp(known.prior.quiet[epoch] - total), lost)


@njit(cache=True, nogil=True, error_model="numpy")
def mix(room: Room, posterior: Posterior, epoch: int, known: Knowledge, limits: Limits) -> int:
    """What the filter misses, as a mixture of round Gaussians; their number, above the room if there are too many.

    Args:
        room: of the epoch; its parts are the result.
        posterior: of the epoch.
        epoch: of the fix.
        known: of the game.
        limits: what is left out.
    """
    used = _mix(room, posterior.hypotheses, epoch, known, posterior.total, limits)
    if used <= room.parts.shape[1]:
        _normalise(room.parts, used)
    return used


@njit(cache=True, nogil=True, error_model="numpy")
def _normalise(parts: Floats, used: int) -> None:
    """Let weights sum to 1."""
    total = 0.0
    for i in range(used):
        total += parts[0, i, 0]
    for i in range(used):
        parts[0, i, 0] /= total
        parts[1, i, 0] = parts[0, i, 0]


@njit(cache=True, nogil=True, error_model="numpy")
def _mix(room: Room, count: int, epoch: int, known: Knowledge, total: float, limits: Limits) -> int:
    """The mixture with weights that do not sum to 1."""
    bank, nodes, parts = room
    rows, places, n = known.filter.rows[epoch], parts.shape[1], bank.state.shape[2]
    own, own_later = _per_axis(known.filter.covariance[epoch]), _per_axis(known.filter.later[epoch])
    parts[:, 0, :3] = 0.0
    parts[0, 0, 0] = math.exp(known.prior.quiet[epoch] - total)
    parts[0, 0, 3], parts[1, 0, 3] = math.sqrt(own), math.sqrt(own_later)
    used = 1
    now, later = np.empty((3, 2)), np.empty((3, 2))
    for i in range(count):
        if used + len(nodes) > places:
            return places + 1
        share, moments = math.exp(bank.weight[i] - total), bank.moments[i]
        for a in range(3):
            state, east, north = bank.state[i, a], 0.0, 0.0
            for j in range(n):
                east += rows[0, j] * state[j]
                north += rows[1, j] * state[j]
            now[a, 0], now[a, 1], later[a, 0], later[a, 1] = state[POSITION], state[POSITION + 1], east, north
        spread = _spread(now, moments)
        if bank.weight[i] < total + limits.spread or spread < 0.2 * own:
            _put(parts[0, used], share, now, moments, own + 0.5 * spread)
            _put(parts[1, used], share, later, moments, own_later + 0.5 * _spread(later, moments))
            used += 1
            continue
        kind, law, left = law_of(bank, i, known.tree)
        sizes_and_headings(bank.linear[i], bank.quadratic[i], kind, law, left, known.rule, nodes)
        for j in range(len(nodes)):
            if nodes[j, 0] > 1e-6:
                _put(parts[0, used], share * nodes[j, 0], now, nodes[j, 1:], own)
                _put(parts[1, used], share * nodes[j, 0], later, nodes[j, 1:], own_later)
                used += 1
    return used


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _per_axis(covariance: Floats) -> float:
    return float(0.5 * (covariance[0, 0] + covariance[1, 1]))


@njit(cache=True, nogil=True, error_model="numpy")
def _spread(moved: Floats, moments: Floats) -> float:
    """Trace of the covariance that an attack's own makes: mean error per unit (3, 2), moments of the attack (5,)."""
    total = 0.0
    for b in range(2):
        total += moved[0, b] ** 2 * moments[2] + 2.0 * moved[0, b] * moved[1, b] * moments[3]
        total += moved[1, b] ** 2 * moments[4]
    return max(total, 0.0)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _put(part: Floats, weight: float, moved: Floats, attack: Floats, variance: float) -> None:
    """One Gaussian of the mixture: that of an attack, whose first two numbers are a, with a hypothesis's mean error."""
    part[0] = weight
    part[1] = moved[0, 0] * attack[0] + moved[1, 0] * attack[1] + moved[2, 0]
    part[2] = moved[0, 1] * attack[0] + moved[1, 1] * attack[1] + moved[2, 1]
    part[3] = math.sqrt(variance)
