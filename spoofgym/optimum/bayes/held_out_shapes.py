"""The shapes of the held-out attacks as trees.

What has no place in a tree is told to the Bayesian in every game, as it is if such an attack comes: it errs less than
one who is not told, so it bounds defenders from below all the more.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.attacks.families import (
    CHANGE_TIME,
    DECAY_TIME,
    DECAYING_SIZE,
    FAST_RATE,
    RAMP_RATE,
    SLOW_RATE,
    SPIRAL_RATE,
    TURNING_RATE,
    TURNING_TIME,
    ClimbingSpiral,
    DecayingJump,
    RandomRamp,
    SignChangingRamp,
    TwoStageRamp,
)
from spoofgym.optimum.bayes.shapes import Resolution, births, cells, profile
from spoofgym.optimum.bayes.tree import LOG_UNIFORM, POWER, Law, Node
from spoofgym.timeline import Timeline


def two_stage(timeline: Timeline, resolution: Resolution, told: Floats) -> list[Node]:
    """`TwoStageRamp`: its size is the slow rate, m/s; how many times faster the fast one is, is told.

    Both rates are uniform, so that given their ratio the density of the slow one is in proportion to it.
    """
    ratio = _at(told[1], FAST_RATE) / _at(told[0], SLOW_RATE)
    low, high = max(SLOW_RATE[0], FAST_RATE[0] / ratio), min(SLOW_RATE[1], FAST_RATE[1] / ratio)
    slow, fast = _draw(np.array([low]), SLOW_RATE).item(), _draw(np.array([low * ratio]), FAST_RATE).item()

    def after(draw: float) -> Floats:
        return profile(TwoStageRamp(), timeline, slow, fast, draw) / low

    return _changing(timeline, resolution, Law(POWER, low, high, first=1.0), CHANGE_TIME, after, told[2])


def sign_changing(timeline: Timeline, resolution: Resolution, told: Floats) -> list[Node]:
    """`SignChangingRamp`: its size is its rate, m/s."""

    def after(draw: float) -> Floats:
        return profile(SignChangingRamp(), timeline, 0.0, draw) / TURNING_RATE[0]

    return _changing(timeline, resolution, Law(POWER, *TURNING_RATE, first=0.0), TURNING_TIME, after, told[1])


def _changing(
    timeline: Timeline,
    resolution: Resolution,
    law: Law,
    span: tuple[float, float],
    after: Callable[[float], Floats],
    told: float,
) -> list[Node]:
    """A ramp up to a time of change, which is uniform.

    Args:
        timeline: of the game.
        resolution: of the time.
        law: of the rate.
        span: earliest and latest change, s after the onset.
        after: the profile per m/s of an attack whose change has this place in the span.
        told: the place, if it is told.
    """
    if resolution.told:
        return [Node(after(told), law, 1.0)]
    _, times = cells(span, resolution.growth)
    first, born = births(times, timeline)
    ramp = profile(RandomRamp(), timeline, 0.0) / RAMP_RATE[0]
    nodes = [Node(ramp, law, 1.0, last=int(first[-1]) - 1, left=1.0 - born / len(times))]
    for draw, birth in zip(_draw(times, span).tolist(), first.tolist(), strict=True):
        nodes.append(Node(after(draw), law, 1.0 / len(times), parent=0, birth=birth))
    return nodes


def decaying(timeline: Timeline, resolution: Resolution, told: Floats) -> list[Node]:
    """`DecayingJump`: its size is that of the jump, m. The times of decay are told apart from the beginning."""
    law = Law(POWER, *DECAYING_SIZE, first=0.0)

    def of(draw: float) -> Floats:
        return profile(DecayingJump(), timeline, 0.0, draw) / DECAYING_SIZE[0]

    if resolution.told:
        return [Node(of(told[1]), law, 1.0)]
    # cells that are equal in the logarithm: what they leave open shows in the ratio of the times
    count = max(1, round(np.log(DECAY_TIME[1] / DECAY_TIME[0]) * DECAY_TIME[0] / resolution.growth))
    edges = np.geomspace(*DECAY_TIME, count + 1)
    masses = np.diff(edges) / (DECAY_TIME[1] - DECAY_TIME[0])
    draws = _draw(0.5 * (edges[:-1] + edges[1:]), DECAY_TIME)
    return [Node(of(draw), law, mass) for draw, mass in zip(draws.tolist(), masses.tolist(), strict=True)]


def spiral(timeline: Timeline, resolution: Resolution, told: Floats) -> list[Node]:
    """`ClimbingSpiral`: its size is its rate, m/s; how it turns and climbs is told."""
    whole = profile(ClimbingSpiral(), timeline, 0.0, told[1], told[2])
    climb = np.zeros_like(whole)
    climb[:, 2] = whole[:, 2]
    return [Node((whole - climb) / SPIRAL_RATE[0], Law(LOG_UNIFORM, *SPIRAL_RATE), 1.0, fixed=climb)]


def _at(draw: float, span: tuple[float, float]) -> float:
    return float(span[0] + (span[1] - span[0]) * draw)


def _draw(values: Floats, span: tuple[float, float]) -> Floats:
    """The uniform numbers that make these values."""
    return (values - span[0]) / (span[1] - span[0])
