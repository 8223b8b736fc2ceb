"""The trees of the populations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.optimum.bayes.held_out_shapes import decaying, sign_changing, spiral, two_stage
from spoofgym.optimum.bayes.shapes import SHAPE_DRAWS, Resolution, Shape, growth, jump, ramp
from spoofgym.optimum.bayes.tree import Node
from spoofgym.timeline import Timeline

POPULATION_SHAPES: dict[str, tuple[Shape, ...]] = {
    "training": (ramp, jump, growth),
    "held-out": (two_stage, sign_changing, decaying, spiral),
}
"""Those of each population, which are drawn equally often, in the order of its pool."""
OPEN = {"training"}
"""Populations of which nothing needs to be told."""


def population_nodes(
    population: str, timeline: Timeline, resolution: Resolution, told: Floats | None = None
) -> list[Node]:
    """The nodes of a population's attacks.

    Args:
        population: its name.
        timeline: of the game, longer than the shortest attack.
        resolution: of the cells.
        told: of a game, see `Fixes`.

    Raises:
        ValueError: an unknown population, or one of which a game must tell something and does not.
    """
    validation.one_of("Bayesian bound", "population", population, tuple(POPULATION_SHAPES))
    shapes = POPULATION_SHAPES[population]
    if told is None:
        if resolution.told or population not in OPEN:
            raise ValueError(f"Bayesian bound: of {population} attacks a game must tell the numbers of their shapes")
        told = np.zeros((len(shapes), SHAPE_DRAWS))
    return mixed([shape(timeline, resolution, numbers) for shape, numbers in zip(shapes, told, strict=True)])


def mixed(shapes: list[list[Node]]) -> list[Node]:
    """The nodes of several shapes that are drawn equally often."""
    nodes: list[Node] = []
    for shape in shapes:
        first = len(nodes)
        for node in shape:
            parent = node.parent + first if node.parent >= 0 else node.parent
            nodes.append(replace(node, mass=node.mass / len(shapes), parent=parent))
    return nodes
