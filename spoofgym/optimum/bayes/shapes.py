"""The trees of the populations: what their attacks look like, as `spoofgym.attacks.families` draws them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.attacks.families import (
    DRAWS,
    GROWTH_SIZE,
    GROWTH_TIME,
    JUMP_SIZE,
    RAMP_RATE,
    AttackFamily,
    RandomGrowth,
    RandomJump,
    RandomRamp,
)
from spoofgym.optimum.bayes.tree import GROWTH, LOG_UNIFORM, POWER, Law, Node
from spoofgym.timeline import Timeline


@dataclass(frozen=True, kw_only=True)
class Resolution:
    """How finely attacks are told apart.

    Attributes:
        sizes: nodes of the integral over the size.
        headings: nodes of the integral over the heading.
        growth: longest cell of the time of a growth, s.
    """

    sizes: int = 8
    headings: int = 8
    growth: float = 0.5

    def __post_init__(self) -> None:
        owner = "resolution"
        validation.whole(owner, "sizes", self.sizes, 2, 64)
        validation.whole(owner, "headings", self.headings, 4, 256)
        validation.above(owner, "growth", self.growth)


RESOLUTIONS = {
    "coarse": Resolution(sizes=5, headings=5, growth=2.0),
    "usual": Resolution(),
    "fine": Resolution(sizes=16, headings=16, growth=0.25),
}
"""By name, to see whether a figure has settled."""

Shape = Callable[[Timeline, Resolution], list[Node]]


def _profile(family: AttackFamily, timeline: Timeline, *draws: float) -> Floats:
    """Offsets along the heading, to its right and up, (K+1, 3), m, of an attack from epoch 0 to the end of the game.

    Args:
        family: of the attack.
        timeline: of the game.
        draws: uniform numbers of the shape.
    """
    numbers = np.zeros((1, DRAWS))
    numbers[0, 2] = 1.0  # not in view of a manoeuvre
    numbers[0, 6 : 6 + len(draws)] = draws
    family.bind(timeline, 1)
    # the heading is north
    return family.drawn(numbers)[0][:, [1, 0, 2]]


def ramp(timeline: Timeline, resolution: Resolution) -> list[Node]:
    """`RandomRamp`: its size is its rate, m/s."""
    profile = _profile(RandomRamp(), timeline, 0.0) / RAMP_RATE[0]
    return [Node(profile, Law(LOG_UNIFORM, *RAMP_RATE), 1.0)]


def jump(timeline: Timeline, resolution: Resolution) -> list[Node]:
    """`RandomJump`, m."""
    profile = _profile(RandomJump(), timeline, 0.0) / JUMP_SIZE[0]
    return [Node(profile, Law(POWER, *JUMP_SIZE, first=0.0), 1.0)]


def growth(timeline: Timeline, resolution: Resolution) -> list[Node]:
    """`RandomGrowth`: a parabola up to half of its time of growth T, so the times are told apart from there on only.

    The size of the parent is 2 r / T², m/s², r the final size.
    """
    shortest, longest = GROWTH_TIME
    cells = max(1, round((longest - shortest) / resolution.growth))
    edges = np.linspace(shortest, longest, cells + 1)
    times, interval = 0.5 * (edges[:-1] + edges[1:]), timeline.interval
    births = np.floor(times / (2.0 * interval)).astype(np.int64) + 1
    since = np.arange(timeline.num_epochs + 2)
    left = np.append(edges, longest)[np.searchsorted(births, since, side="right")]
    parabola = np.zeros((timeline.num_epochs + 1, 3))
    parabola[:, 0] = (interval * since[:-1]) ** 2
    law = Law(GROWTH, *GROWTH_SIZE, first=shortest, second=longest)
    nodes = [Node(parabola, law, 1.0, last=int(births[-1]) - 1, left=left)]
    for time, birth in zip(times, births.tolist(), strict=True):
        draw = (time - shortest) / (longest - shortest)
        profile = _profile(RandomGrowth(), timeline, 0.0, draw) / GROWTH_SIZE[0]
        law = Law(LOG_UNIFORM, *GROWTH_SIZE)
        nodes.append(Node(profile, law, 1.0 / cells, parent=0, birth=birth, scale=2.0 / time**2))
    return nodes


POPULATION_SHAPES: dict[str, tuple[Shape, ...]] = {"training": (ramp, jump, growth)}
"""Those of each population, which are drawn equally often."""


def population_nodes(population: str, timeline: Timeline, resolution: Resolution) -> list[Node]:
    """The nodes of a population's attacks.

    Args:
        population: its name.
        timeline: of the game, longer than the shortest attack.
        resolution: of the cells.

    Raises:
        ValueError: an unknown population.
    """
    validation.one_of("Bayesian bound", "population", population, tuple(POPULATION_SHAPES))
    return mixed([shape(timeline, resolution) for shape in POPULATION_SHAPES[population]])


def mixed(shapes: list[list[Node]]) -> list[Node]:
    """The nodes of several shapes that are drawn equally often."""
    nodes: list[Node] = []
    for shape in shapes:
        first = len(nodes)
        for node in shape:
            parent = node.parent + first if node.parent >= 0 else node.parent
            nodes.append(replace(node, mass=node.mass / len(shapes), parent=parent))
    return nodes
