"""The shapes of the training attacks as trees, and what all shapes share.

They are what `spoofgym.attacks.families` draws: profiles come from the families themselves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
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

SHAPE_DRAWS = 6
"""Uniform numbers of a shape."""


@dataclass(frozen=True, kw_only=True)
class Resolution:
    """How finely attacks are told apart.

    Attributes:
        sizes: nodes of the integral over the size.
        headings: nodes of the integral over the heading.
        growth: longest cell of the time at which a shape changes, s.
        kept: least posterior probability of a hypothesis that is carried on.
        told: whether the Bayesian is told all of a shape but its size and its heading.
    """

    sizes: int = 8
    headings: int = 8
    growth: float = 0.5
    kept: float = 1e-7
    told: bool = False

    def __post_init__(self) -> None:
        owner = "resolution"
        validation.whole(owner, "sizes", self.sizes, 2, 64)
        validation.whole(owner, "headings", self.headings, 4, 256)
        validation.above(owner, "growth", self.growth)
        validation.between(owner, "kept", self.kept, 1e-12, 1e-3)


RESOLUTIONS = {
    "coarse": Resolution(sizes=5, headings=5, growth=2.0),
    "usual": Resolution(),
    "fine": Resolution(sizes=16, headings=16, growth=0.25, kept=1e-9),
    "told": Resolution(told=True),
}
"""By name, to see whether a figure has settled, and what it is worth to know the shape."""

Shape = Callable[[Timeline, Resolution, Floats], list[Node]]
"""The nodes of a kind of attack, from a game's uniform numbers of its shape, of which it takes what is told."""


def profile(family: AttackFamily, timeline: Timeline, *draws: float) -> Floats:
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


def cells(span: tuple[float, float], longest: float) -> tuple[Floats, Floats]:
    """Edges and middles of equal cells of a span, none longer than ``longest``."""
    low, high = span
    edges = np.linspace(low, high, max(1, round((high - low) / longest)) + 1)
    return edges, 0.5 * (edges[:-1] + edges[1:])


def births(times: Floats, timeline: Timeline) -> tuple[Runs, Runs]:
    """When attacks that change at these times after their onset are told apart from one that does not.

    Args:
        times: in order, s.
        timeline: of the game.

    Returns:
        Epochs after the onset at which each has first another offset, and for d = 0..K+1 how many have by then.
    """
    first = np.floor(times / timeline.interval).astype(np.int64) + 1
    return first, np.searchsorted(first, np.arange(timeline.num_epochs + 2), side="right").astype(np.int64)


def ramp(timeline: Timeline, resolution: Resolution, told: Floats) -> list[Node]:
    """`RandomRamp`: its size is its rate, m/s."""
    return [Node(profile(RandomRamp(), timeline, 0.0) / RAMP_RATE[0], Law(LOG_UNIFORM, *RAMP_RATE), 1.0)]


def jump(timeline: Timeline, resolution: Resolution, told: Floats) -> list[Node]:
    """`RandomJump`, m."""
    return [Node(profile(RandomJump(), timeline, 0.0) / JUMP_SIZE[0], Law(POWER, *JUMP_SIZE, first=0.0), 1.0)]


def growth(timeline: Timeline, resolution: Resolution, told: Floats) -> list[Node]:
    """`RandomGrowth`: a parabola up to half of its time of growth T, so the times are told apart from there on only.

    The size of the parent is 2 r / T², m/s², r the final size.
    """
    whole = Law(LOG_UNIFORM, *GROWTH_SIZE)
    if resolution.told:
        return [Node(profile(RandomGrowth(), timeline, 0.0, told[1]) / GROWTH_SIZE[0], whole, 1.0)]
    shortest, longest = GROWTH_TIME
    edges, times = cells(GROWTH_TIME, resolution.growth)
    first, born = births(0.5 * times, timeline)
    left = np.append(edges, longest)[born]
    parabola = np.zeros((timeline.num_epochs + 1, 3))
    parabola[:, 0] = (timeline.interval * np.arange(timeline.num_epochs + 1)) ** 2
    law = Law(GROWTH, *GROWTH_SIZE, first=shortest, second=longest)
    nodes = [Node(parabola, law, 1.0, last=int(first[-1]) - 1, left=left)]
    for time, birth in zip(times, first.tolist(), strict=True):
        draw = (time - shortest) / (longest - shortest)
        grown = profile(RandomGrowth(), timeline, 0.0, draw) / GROWTH_SIZE[0]
        nodes.append(Node(grown, whole, 1.0 / len(times), parent=0, birth=birth, scale=2.0 / time**2))
    return nodes
