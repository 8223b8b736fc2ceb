"""The trees of shapes say what the families draw."""

from __future__ import annotations

import numpy as np
import pytest

from spoofgym.arrays import Floats
from spoofgym.attacks.families import (
    DRAWS,
    GROWTH_TIME,
    AttackFamily,
    RandomGrowth,
    RandomJump,
    RandomRamp,
)
from spoofgym.attacks.pool import POPULATIONS
from spoofgym.optimum.bayes.held_out_shapes import two_stage
from spoofgym.optimum.bayes.populations import POPULATION_SHAPES, population_nodes
from spoofgym.optimum.bayes.shapes import SHAPE_DRAWS, Resolution, growth, jump, ramp
from spoofgym.optimum.bayes.tree import ROOT, Node, plant
from spoofgym.timeline import Timeline

TIMELINE = Timeline.steady(20.0, 1.0, 230)
ANGLE = 0.1
NOTHING = np.zeros(SHAPE_DRAWS)


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
    (node,) = shape(TIMELINE, Resolution(), NOTHING)
    for draw, size in ((0.0, node.law.low), (1.0, node.law.high)):
        np.testing.assert_allclose(turned(size * node.profile), drawn(family, draw), atol=1e-9)


def test_a_growth_is_a_parabola_until_it_is_told_apart() -> None:
    nodes = growth(TIMELINE, Resolution(growth=0.5), NOTHING)
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
    nodes = growth(TIMELINE, Resolution(growth=1.0), NOTHING)
    parent, children = nodes[0], nodes[1:]
    for since in (1, 5, 6, 20, 39):
        born = sum(child.mass for child in children if child.birth <= since)
        assert (GROWTH_TIME[1] - parent.left[since]) / 70.0 == pytest.approx(1.0 - born)
    assert parent.last == max(child.birth for child in children) - 1


KINDS = [
    pytest.param(shape, family, id=family.kind)
    for name, shapes in POPULATION_SHAPES.items()
    for shape, family in zip(shapes, POPULATIONS[name]().members, strict=True)
]


@pytest.mark.parametrize(("shape", "family"), KINDS)
def test_one_whose_shape_is_told_is_what_is_drawn(shape, family: AttackFamily) -> None:
    """All but the size and the heading is in the node: a size within its law makes the attack."""
    rng = np.random.default_rng(1)
    for numbers in rng.random((5, SHAPE_DRAWS)):
        (node,) = shape(TIMELINE, Resolution(told=True), numbers)
        whole = drawn(family, *numbers)
        along = turned(node.profile)[1]
        size = whole[1, :2] @ along[:2] / (along @ along)
        assert node.law.low * (1.0 - 1e-9) <= size <= node.law.high * (1.0 + 1e-9)
        fixed = node.fixed if node.fixed.size else 0.0
        np.testing.assert_allclose(size * turned(node.profile) + fixed, whole, atol=1e-9)


@pytest.mark.parametrize(("shape", "family"), KINDS)
def test_some_branch_is_near_what_is_drawn(shape, family: AttackFamily) -> None:
    """The whole tree: masses sum to 1, and up to its birth a branch is its parent, to what cells leave open."""
    rng = np.random.default_rng(2)
    for numbers in rng.random((3, SHAPE_DRAWS)):
        nodes = shape(TIMELINE, Resolution(growth=0.25), numbers)
        assert sum(node.mass for node in nodes if node.parent == ROOT) == pytest.approx(1.0)
        if len(nodes) > 1 and nodes[0].last < 1 << 30:
            assert sum(node.mass for node in nodes[1:]) == pytest.approx(1.0)
        (told,) = shape(TIMELINE, Resolution(told=True), numbers)
        whole = [node for node in nodes if node.birth > 1] or nodes
        errors = [np.abs(node.profile - told.profile).max() for node in whole]
        assert min(errors) < 0.02 * np.abs(told.profile).max()
        for node in nodes[1:]:
            if node.parent != ROOT:
                before = node.scale * nodes[node.parent].profile
                np.testing.assert_allclose(node.profile[: node.birth], before[: node.birth], atol=1e-9)


def test_given_their_ratio_the_slow_rate_of_two_stages_has_the_law_of_the_node() -> None:
    """Rates that are uniform are uniform in the law's own probability: six standard errors, 2e-9."""
    rng, shares = np.random.default_rng(3), []
    for numbers in rng.random((400, SHAPE_DRAWS)):
        (node,) = two_stage(TIMELINE, Resolution(told=True), numbers)
        assert (node.law.first, node.law.low > 0.0) == (1.0, True)
        low, high = node.law.low, node.law.high
        slow = 0.1 + 0.7 * numbers[0]
        shares.append((slow**2 - low**2) / (high**2 - low**2))
    assert np.mean(shares) == pytest.approx(0.5, abs=6.0 / np.sqrt(12.0 * len(shares)))


@pytest.mark.parametrize("population", POPULATION_SHAPES)
def test_a_population_is_a_mixture_of_its_shapes(population: str) -> None:
    count = len(POPULATION_SHAPES[population])
    nodes = population_nodes(population, TIMELINE, Resolution(growth=2.0), np.full((count, SHAPE_DRAWS), 0.4))
    assert sum(node.mass for node in nodes if node.parent == ROOT) == pytest.approx(1.0)
    assert len({_root(nodes, node).profile[10].tobytes() for node in nodes}) >= count


@pytest.mark.parametrize("population", POPULATION_SHAPES)
def test_trees_lie_in_memory_in_one_order(population: str) -> None:
    """Arrays in another order would be another kernel, which takes ten seconds to compile."""
    count = len(POPULATION_SHAPES[population])
    nodes = population_nodes(population, TIMELINE, Resolution(growth=2.0), np.full((count, SHAPE_DRAWS), 0.4))
    for some in (nodes, nodes[:1]):
        assert all(array.flags.c_contiguous for array in plant(some, TIMELINE.num_epochs))


def test_what_must_be_told_is_asked_for() -> None:
    assert population_nodes("training", TIMELINE, Resolution(growth=2.0))
    for population, resolution in (("held-out", Resolution()), ("training", Resolution(told=True))):
        with pytest.raises(ValueError, match=f"of {population} attacks a game must tell"):
            population_nodes(population, TIMELINE, resolution)


def _root(nodes: list[Node], node: Node) -> Node:
    return node if node.parent == ROOT else _root(nodes, nodes[node.parent])
