"""The bank of hypotheses of one game: which attacks may have begun, when they ended, and what each makes of the fixes.

A hypothesis is a node of the tree of shapes, an onset, and an end if it has ended. Given these, mean innovations and
mean error are affine in the attack a = r (sin θ, cos θ), so a hypothesis carries b = Σ G'ν, A = Σ G'G and the filter's
mean error per unit of a. What is known of the attack whatever a is, its fixed offsets, is taken from ν first. `sizes`
integrates over a.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.kernels import njit
from spoofgym.optimum.bayes.filtering import Filter
from spoofgym.optimum.bayes.sizes import Rule, best, sizes_and_headings, support
from spoofgym.optimum.bayes.tree import Tree

REST = 4
"""A hypothesis of little weight is integrated in one of so many epochs."""


class Bank(NamedTuple):
    """Room for hypotheses; leading axis: C places, of which the first are taken.

    Attributes:
        node: of the tree, (C,).
        onset: epoch, (C,).
        over: whether the attack has ended, (C,).
        prior: logarithm of the prior probability, of an attack that lasts without that of lasting, (C,).
        left: of the node's mass, as `Node.left`, (C,).
        linear: b, (C, 2).
        quadratic: A: its elements 00, 01, 11, (C, 3).
        state: mean error per unit of a, and that of the fixed offsets, (C, 3, n).
        score: log likelihood ratio of the fixed offsets alone and no attack, (C,).
        weight: logarithm of the prior probability times the likelihood ratio of the hypothesis and no attack, (C,).
        excess: of the weight over its upper bound, when it was last computed, (C,).
        moments: of a: its mean (2) and covariance (00, 01, 11), (C, 5).
    """

    node: Runs
    onset: Runs
    over: Flags
    prior: Floats
    left: Floats
    linear: Floats
    quadratic: Floats
    state: Floats
    score: Floats
    weight: Floats
    excess: Floats
    moments: Floats


class Prior(NamedTuple):
    """What is known before a game, as logarithms of probabilities.

    Attributes:
        onset: that an attack begins at epoch k, (K+1,).
        quiet: that none has begun before epoch k, (K+1,).
        lasts: that it lasts d epochs, (K+2,).
        ends: that it ends after d - 1, (K+2,).
    """

    onset: Floats
    quiet: Floats
    lasts: Floats
    ends: Floats


class Limits(NamedTuple):
    """What is left out.

    Attributes:
        kept: least posterior probability of a hypothesis that is carried on, a logarithm.
        spread: least posterior probability of one that is integrated anew in every epoch, and whose attacks enter the
            estimate one by one, if they differ, a logarithm.
    """

    kept: float
    spread: float


class Knowledge(NamedTuple):
    """All that a bank needs to know of a game before it is played.

    Attributes:
        tree: of shapes.
        prior: of onset and end.
        filter: of the game.
        rule: of the integral over size and heading.
    """

    tree: Tree
    prior: Prior
    filter: Filter
    rule: Rule


def empty_bank(places: int, states: int) -> Bank:
    """Room for so many hypotheses of a filter with so many states."""
    return Bank(
        node=np.zeros(places, dtype=np.int64),
        onset=np.zeros(places, dtype=np.int64),
        over=np.zeros(places, dtype=np.bool_),
        prior=np.zeros(places),
        left=np.zeros(places),
        linear=np.zeros((places, 2)),
        quadratic=np.zeros((places, 3)),
        state=np.zeros((places, 3, states)),
        score=np.zeros(places),
        weight=np.zeros(places),
        excess=np.zeros(places),
        moments=np.zeros((places, 5)),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _copy(bank: Bank, source: int, target: int, scale: float) -> None:
    """Put a hypothesis into another place, its size in another unit."""
    bank.node[target], bank.onset[target], bank.over[target] = bank.node[source], bank.onset[source], bank.over[source]
    bank.prior[target], bank.left[target] = bank.prior[source], bank.left[source]
    for i in range(2):
        bank.linear[target, i] = scale * bank.linear[source, i]
        for j in range(bank.state.shape[2]):
            bank.state[target, i, j] = scale * bank.state[source, i, j]
    for j in range(bank.state.shape[2]):
        bank.state[target, 2, j] = bank.state[source, 2, j]
    bank.score[target] = bank.score[source]
    for i in range(3):
        bank.quadratic[target, i] = scale * scale * bank.quadratic[source, i]
    bank.weight[target], bank.excess[target] = bank.weight[source], bank.excess[source]
    for i in range(5):
        bank.moments[target, i] = bank.moments[source, i]


@njit(cache=True, nogil=True, error_model="numpy")
def branch(bank: Bank, count: int, epoch: int, known: Knowledge) -> int:
    """Let attacks end, be told apart, and begin, before an epoch's fix is seen.

    Args:
        bank: of hypotheses, in place.
        count: places that are taken.
        epoch: of the fix.
        known: of the game.

    Returns:
        Places that are taken then; more than there are if there are too few, and the first ones are untouched.
    """
    tree, prior, places = known.tree, known.prior, len(bank.node)
    before = count
    for i in range(before):
        if bank.over[i]:
            continue
        since = epoch - bank.onset[i]
        if prior.ends[since] > -np.inf:
            if count == places:
                return places + 1
            _copy(bank, i, count, 1.0)
            bank.over[count] = True
            bank.prior[count], bank.excess[count] = bank.prior[count] + prior.ends[since], 0.0
            count += 1
        for node in range(tree.first_born[since], tree.first_born[since + 1]):
            if tree.parent[node] != bank.node[i]:
                continue
            if count == places:
                return places + 1
            _copy(bank, i, count, tree.scale[node])
            bank.node[count] = node
            bank.prior[count] = prior.onset[bank.onset[i]] + tree.log_mass[node]
            bank.left[count], bank.excess[count] = tree.left[node, since], 0.0
            count += 1
    for node in range(tree.first_born[1], tree.first_born[2]):
        if tree.parent[node] >= 0 or prior.onset[epoch - 1] == -np.inf:
            continue
        if count == places:
            return places + 1
        _begin(bank, count, node, epoch - 1, known)
        count += 1
    # last, so that the first places are as they were where there is too little room
    for i in range(before):
        if not bank.over[i]:
            bank.left[i] = tree.left[bank.node[i], epoch - bank.onset[i]]
    return _drop_parents(bank, count, epoch, tree)


@njit(cache=True, nogil=True, error_model="numpy")
def _begin(bank: Bank, place: int, node: int, onset: int, known: Knowledge) -> None:
    """A hypothesis whose first offset comes now."""
    bank.node[place], bank.onset[place], bank.over[place] = node, onset, False
    bank.prior[place], bank.excess[place] = known.prior.onset[onset] + known.tree.log_mass[node], 0.0
    bank.left[place] = known.tree.left[node, 1]
    bank.linear[place], bank.quadratic[place], bank.state[place], bank.score[place] = 0.0, 0.0, 0.0, 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _drop_parents(bank: Bank, count: int, epoch: int, tree: Tree) -> int:
    """Leave out hypotheses whose children hold all their mass."""
    kept = 0
    for i in range(count):
        if bank.over[i] or epoch - bank.onset[i] <= tree.last[bank.node[i]]:
            if kept != i:
                _copy(bank, i, kept, 1.0)
            kept += 1
    return kept


@njit(cache=True, nogil=True, error_model="numpy")
def carry(bank: Bank, count: int, epoch: int, known: Knowledge, whitened: Floats) -> None:
    """Carry every hypothesis over an epoch, and note what its fix says.

    Args:
        bank: of hypotheses, in place.
        count: places that are taken.
        epoch: of the fix.
        known: of the game.
        whitened: innovation of the filter that knows no attack, (3,).
    """
    tree, filter_ = known.tree, known.filter
    closed, seen, whiten, gain = filter_.closed[epoch], filter_.seen[epoch], filter_.whiten[epoch], filter_.gain[epoch]
    n = closed.shape[0]
    offset, shown, state = np.zeros((3, 3)), np.empty((3, 3)), np.empty(n)
    for i in range(count):
        node = bank.node[i]
        columns = 3 if tree.shifted[node] else 2
        for a in range(3):
            for b in range(3):
                offset[a, b], shown[a, b] = 0.0, 0.0
        if not bank.over[i]:
            since = epoch - bank.onset[i]
            along, right = tree.profile[node, since, 0], tree.profile[node, since, 1]
            offset[0, 0], offset[0, 1] = along, -right
            offset[1, 0], offset[1, 1] = right, along
            for b in range(3):
                offset[2, b] = tree.fixed[node, since, b]
        for a in range(columns):
            before = bank.state[i, a]
            first = second = third = 0.0
            for j in range(n):
                first += seen[0, j] * before[j]
                second += seen[1, j] * before[j]
                third += seen[2, j] * before[j]
            shown[a, 0], shown[a, 1], shown[a, 2] = first, second, third
            for b in range(3):
                for j in range(3):
                    shown[a, b] -= whiten[b, j] * offset[a, j]
            for j in range(n):
                state[j] = gain[0, j] * offset[a, 0] + gain[1, j] * offset[a, 1] + gain[2, j] * offset[a, 2]
            for k in range(n):
                factor = before[k]
                for j in range(n):
                    state[j] += closed[k, j] * factor
            for j in range(n):
                before[j] = state[j]
        for b in range(3):
            unexplained = whitened[b] - shown[2, b]
            bank.score[i] += shown[2, b] * (whitened[b] - 0.5 * shown[2, b])
            bank.linear[i, 0] += shown[0, b] * unexplained
            bank.linear[i, 1] += shown[1, b] * unexplained
            bank.quadratic[i, 0] += shown[0, b] * shown[0, b]
            bank.quadratic[i, 1] += shown[0, b] * shown[1, b]
            bank.quadratic[i, 2] += shown[1, b] * shown[1, b]


@njit(cache=True, nogil=True, error_model="numpy")
def law_of(bank: Bank, place: int, tree: Tree) -> tuple[int, Floats, float]:
    """Kind, numbers and what is left of the law of a hypothesis's size."""
    node = bank.node[place]
    return tree.law[node], tree.law_of[node], bank.left[place]


@njit(cache=True, nogil=True, error_model="numpy")
def prior_of(bank: Bank, place: int, epoch: int, prior: Prior) -> float:
    """Logarithm of the prior probability of a hypothesis."""
    lasts = 0.0 if bank.over[place] else prior.lasts[epoch - bank.onset[place]]
    return bank.prior[place] + lasts


@njit(cache=True, nogil=True, error_model="numpy")
def weigh(bank: Bank, count: int, epoch: int, known: Knowledge, limits: Limits, nodes: Floats) -> float:
    """Weigh every hypothesis by what has been seen; the logarithm of the sum of all weights, no attack included.

    Args:
        bank: of hypotheses, in place.
        count: places that are taken.
        epoch: of the last fix.
        known: of the game.
        limits: what is left out.
        nodes: room for the integral, (R T, 4).
    """
    largest = known.prior.quiet[epoch]
    total = 1.0
    for i in range(count):
        kind, law, left = law_of(bank, i, known.tree)
        low, high = support(kind, law, left)
        bank.weight[i] = -np.inf
        if high <= low:
            continue
        before = prior_of(bank, i, epoch, known.prior) + bank.score[i]
        bound = before + best(bank.linear[i], bank.quadratic[i], low, high)[4]
        # whether it matters is told by what it was worth, if the data are for it as much as for its best attack
        bank.weight[i] = bound + bank.excess[i]
        if bank.weight[i] < largest + limits.kept:
            continue
        # one of little weight is integrated anew every fourth epoch
        turn = bank.excess[i] == 0.0 or (bank.onset[i] + epoch) % REST == 0
        if turn or bank.weight[i] > largest + limits.spread:
            bank.weight[i] = before + sizes_and_headings(
                bank.linear[i], bank.quadratic[i], kind, law, left, known.rule, nodes
            )
            bank.excess[i] = bank.weight[i] - bound
            _moments(nodes, bank.moments[i])
        weight = bank.weight[i]
        if weight > largest:
            total = total * math.exp(largest - weight) + 1.0
            largest = weight
        else:
            total += math.exp(weight - largest)
    return largest + math.log(total)


@njit(cache=True, nogil=True, error_model="numpy")
def _moments(nodes: Floats, moments: Floats) -> None:
    """Mean and covariance of weighted points, (Q, 3) with weights that sum to 1."""
    x = y = xx = xy = yy = 0.0
    for i in range(len(nodes)):
        weight, a, b = nodes[i, 0], nodes[i, 1], nodes[i, 2]
        x += weight * a
        y += weight * b
        xx += weight * a * a
        xy += weight * a * b
        yy += weight * b * b
    moments[0], moments[1], moments[2], moments[3], moments[4] = x, y, xx - x * x, xy - x * y, yy - y * y


@njit(cache=True, nogil=True, error_model="numpy")
def prune(bank: Bank, count: int, floor: float, total: float) -> tuple[int, float]:
    """Leave out hypotheses of a small posterior probability.

    Args:
        bank: of hypotheses, in place.
        count: places that are taken.
        floor: least probability that is kept, a logarithm.
        total: logarithm of the sum of the weights.

    Returns:
        Places that are taken then, and the probability that was left out.
    """
    kept, lost = 0, 0.0
    for i in range(count):
        if bank.weight[i] < total + floor:
            lost += math.exp(bank.weight[i] - total)
            continue
        if kept != i:
            _copy(bank, i, kept, 1.0)
        kept += 1
    return kept, lost
