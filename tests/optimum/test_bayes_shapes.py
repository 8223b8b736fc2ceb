"""The trees of shapes say what the families draw."""

from __future__ import annotations

import numpy as np
import pytest

from spoofgym.arrays import Floats
from spoofgym.attacks.families import DRAWS, GROWTH_TIME, AttackFamily, RandomGrowth, RandomJump, RandomRamp
from spoofgym.optimum.bayes.shapes import Resolution, growth, jump, population_nodes, ramp
from spoofgym.optimum.bayes.tree import ROOT, Node
from spoofgym.timeline import Timeline

TIMELINE = Timeline.steady(20.0, 1.0, 230)
ANGLE = 0.1


def drawn(family: AttackFamily, *draws: float) -> Floats:
    """An attack from epoch 0 to the end, (K+1, 3), m ENU."""
    numbers = np.zeros((1, DRAWS))
    numbers[0, 2], numbers[0, 5], numbers[0, 6 : 6 + len(draws)] = 1.0, ANGLE, draws
    family.bind(TIMELINE, 1)
    return family.drawn(numbers)[0]


def turned(profile: Floats) -> Floats:
    """A profile at the heading of `drawn`, (K+1, 3), m ENU."""
    sine, cosine = np.sin(2.0 * np.pi * ANGLE), np.cos(2.0 * np.pi * ANGLE)
    along, right, up = profile.T
    return np.stack([sine * along + cosine * right, cosine * along - sine * right, up], axis=1)


@pytest.mark.parametrize(("shape", "family"), [(ramp, RandomRamp()), (jump, RandomJump())])
def test_a_shape_of_one_node(shape, family: AttackFamily) -> None:
    (node,) = shape(TIMELINE, Resolution())
    for draw, size in ((0.0, node.law.low), (1.0, node.law.high)):
        np.testing.assert_allclose(turned(size * node.profile), drawn(family, draw), atol=1e-9)


def test_a_growth_is_a_parabola_until_it_is_told_apart() -> None:
    nodes = growth(TIMELINE, Resolution(growth=0.5))
    parent, children = nodes[0], nodes[1:]
    assert parent.parent == ROOT
    assert sum(child.mass for child in children) == pytest.approx(parent.mass)
    for place in (0, 17, len(children) - 1):
        child = children[place]
        time = GROWTH_TIME[0] + (place + 0.5) * 0.5
        whole = drawn(RandomGrowth(), 1.0, (time - GROWTH_TIME[0]) / (GROWTH_TIME[1] - GROWTH_TIME[0]))
        size = child.law.high
        np.testing.assert_allclose(turned(size * child.profile), whole, atol=1e-9)
        np.testing.assert_allclose(
            turned(size * child.scale * parent.profile)[: child.birth], whole[: child.birth], atol=1e-9
        )
        # a later birth would be too late
        assert not np.allclose(turned(size * child.scale * parent.profile)[child.birth + 1], whole[child.birth + 1])


def test_what_is_left_of_a_parent_is_what_its_children_have_not_taken() -> None:
    nodes = growth(TIMELINE, Resolution(growth=1.0))
    parent, children = nodes[0], nodes[1:]
    for since in (1, 5, 6, 20, 39):
        born = sum(child.mass for child in children if child.birth <= since)
        assert (GROWTH_TIME[1] - parent.left[since]) / 70.0 == pytest.approx(1.0 - born)
    assert parent.last == max(child.birth for child in children) - 1


def test_a_population_is_a_mixture_of_its_shapes() -> None:
    nodes = population_nodes("training", TIMELINE, Resolution())
    assert sum(node.mass for node in nodes if node.parent == ROOT) == pytest.approx(1.0)
    assert {_root(nodes, node).mass for node in nodes} == {1.0 / 3.0}


def _root(nodes: list[Node], node: Node) -> Node:
    return node if node.parent == ROOT else _root(nodes, nodes[node.parent])
