"""The tree of shapes of a population: every node is an attack that is linear in its size and heading.

A shape has a size r with a law of its own, a heading θ that is uniform, and perhaps another parameter (such as a time)
in which it is not linear. That parameter is cut into cells, a node each. Nodes whose offsets differ by a factor
alone up to an epoch are one node until then, their parent: a bank of filters carries what can be told apart only.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs

LOG_UNIFORM, POWER, GROWTH = 0, 1, 2
"""Laws of a size: its logarithm is uniform; its density is a power; the start of a growth (see `shapes`)."""
ROOT = -1


@dataclass(frozen=True)
class Law:
    """How the size r of an attack is distributed, between ``low`` and ``high``.

    Attributes:
        kind: LOG_UNIFORM, POWER or GROWTH.
        low: least size; of GROWTH the least final size.
        high: largest.
        first: POWER: the exponent; GROWTH: the shortest time of growth, s.
        second: GROWTH: the longest.
    """

    kind: int
    low: float
    high: float
    first: float = 0.0
    second: float = 0.0


@dataclass(frozen=True)
class Node:
    """Attacks of one shape.

    Attributes:
        profile: offsets d epochs after the onset per unit of size, along the heading, to its right and up, (K+1, 3).
        law: of the size.
        mass: probability of the node among the attacks of the population; of a parent, that of all its descendants.
        parent: its place in the tree, or ROOT.
        birth: first d at which the node is told apart from its parent.
        scale: unit of this node's size in the parent's, up to there.
        last: last d for which the node stands; later its children hold all its mass.
        left: for each d, (K+2,): the share of the mass that no child has taken; of GROWTH, the shortest time of growth
            that is left, s.
        fixed: offsets that come on top whatever the size and the heading, (K+1, 3), m ENU; empty = none.
    """

    profile: Floats
    law: Law
    mass: float
    parent: int = ROOT
    birth: int = 1
    scale: float = 1.0
    last: int = 1 << 30
    left: Floats = field(default_factory=lambda: np.ones(0))
    fixed: Floats = field(default_factory=lambda: np.zeros((0, 3)))


class Tree(NamedTuple):
    """Nodes as kernels take them; leading axis: J nodes, which are sorted by their birth.

    Attributes:
        profile: (J, K+1, 3).
        law: kind, (J,).
        law_of: low, high, first, second of the law, (J, 4).
        log_mass: (J,).
        parent: (J,).
        scale: (J,).
        last: (J,).
        left: (J, K+2).
        fixed: (J, K+1, 3).
        shifted: whether ``fixed`` has anything, (J,).
        first_born: place of the first node that is born d epochs after the onset or later, (K+3,).
    """

    profile: Floats
    law: Runs
    law_of: Floats
    log_mass: Floats
    parent: Runs
    scale: Floats
    last: Runs
    left: Floats
    fixed: Floats
    shifted: Flags
    first_born: Runs


def plant(nodes: list[Node], num_epochs: int) -> Tree:
    """The tree of nodes, whose parents stand before them.

    Its arrays lie in memory in one order, however the profiles were made: another order would be another kernel.
    """
    order = sorted(range(len(nodes)), key=lambda place: nodes[place].birth)
    place = {ROOT: ROOT, **{old: new for new, old in enumerate(order)}}
    ordered = [nodes[old] for old in order]
    births = np.array([node.birth for node in ordered])
    whole, nothing = np.ones(num_epochs + 2), np.zeros((num_epochs + 1, 3))
    return Tree(
        profile=np.ascontiguousarray(np.stack([node.profile for node in ordered])),
        law=np.array([node.law.kind for node in ordered]),
        law_of=np.array([(law.low, law.high, law.first, law.second) for law in (node.law for node in ordered)]),
        log_mass=np.log([node.mass for node in ordered]),
        parent=np.array([place[node.parent] for node in ordered]),
        scale=np.array([node.scale for node in ordered]),
        last=np.array([min(node.last, num_epochs) for node in ordered]),
        left=np.stack([node.left if node.left.size else whole for node in ordered]),
        fixed=np.ascontiguousarray(np.stack([node.fixed if node.fixed.size else nothing for node in ordered])),
        shifted=np.array([node.fixed.size > 0 for node in ordered]),
        first_born=np.searchsorted(births, np.arange(num_epochs + 3)),
    )
