"""The integral over size and heading, against sums over a fine grid."""

from __future__ import annotations

import numpy as np
import pytest

from spoofgym.optimum.bayes.sizes import Rule, density, rule, sizes_and_headings, support
from spoofgym.optimum.bayes.tree import GROWTH, LOG_UNIFORM, POWER

RAMP = (LOG_UNIFORM, (0.2, 5.0, 0.0, 0.0), 1.0)
JUMP = (POWER, (5.0, 50.0, 0.0, 0.0), 0.7)
START = (GROWTH, (10.0, 200.0, 10.0, 80.0), 24.0)
CASES = {
    "nothing known": (RAMP, (0.0, 0.0), (0.0, 0.0, 0.0)),
    "little": (RAMP, (0.3, -0.5), (0.4, 0.05, 0.3)),
    "much": (RAMP, (900.0, 2100.0), (1000.0, 30.0, 1050.0)),
    "at the edge": (RAMP, (20.0, 5.0), (100.0, 0.0, 90.0)),
    "far from possible": (JUMP, (1.0, 2.0), (1.5, 0.1, 1.4)),
    "a jump": (JUMP, (8.0, -14.0), (0.8, 0.0, 0.9)),
    "unlike axes": (JUMP, (30.0, 20.0), (2.0, 0.4, 1.0)),
    "a start": (START, (40.0, 10.0), (600.0, 20.0, 550.0)),
}


def _integral(case: str, finer: Rule) -> tuple[float, np.ndarray]:
    (kind, law, left), linear, quadratic = CASES[case]
    nodes = np.empty((len(finer.place) * finer.headings, 4))
    arguments = (np.array(linear), np.array(quadratic), kind, np.array(law), left)
    return sizes_and_headings(*arguments, finer, nodes), nodes


@pytest.mark.parametrize("case", CASES)
def test_it_is_a_sum_over_a_fine_grid(case: str) -> None:
    (kind, law, left), linear, quadratic = CASES[case]
    low, high = support(kind, np.array(law), left)
    edges = np.linspace(np.log(low), np.log(high), 2001)
    sizes = np.exp(0.5 * (edges[1:] + edges[:-1]))
    heading = np.arange(720) * (2.0 * np.pi / 720)
    east, north = sizes[:, None] * np.sin(heading), sizes[:, None] * np.cos(heading)
    likelihood = linear[0] * east + linear[1] * north
    likelihood -= 0.5 * (quadratic[0] * east**2 + 2.0 * quadratic[1] * east * north + quadratic[2] * north**2)
    mass = np.array([density(kind, np.array(law), left, size) for size in sizes]) * np.diff(edges)
    peak = likelihood.max()
    weights = mass[:, None] / 720 * np.exp(likelihood - peak)
    exact = peak + np.log(weights.sum())
    mean = np.array([(weights * part).sum() for part in (east, north)]) / weights.sum()
    found, nodes = _integral(case, rule(8, 8))
    assert found == pytest.approx(exact, abs=0.03)
    spread = np.sqrt((weights * (east**2 + north**2)).sum() / weights.sum() - mean @ mean)
    np.testing.assert_allclose(nodes[:, 0] @ nodes[:, 1:3], mean, atol=0.05 * spread)
    assert nodes[:, 0].sum() == pytest.approx(1.0)
    finer, _ = _integral(case, rule(24, 24))
    assert finer == pytest.approx(exact, abs=0.002)


def test_masses_are_those_of_the_laws() -> None:
    assert _integral("nothing known", rule(8, 8))[0] == pytest.approx(0.0, abs=1e-9)
    # a growth whose parabola still lasts after 12 s takes longer than 24 s
    kind, law, left = START
    nodes = np.empty((64 * 8, 4))
    mass = sizes_and_headings(np.zeros(2), np.zeros(3), kind, np.array(law), left, rule(64, 8), nodes)
    assert np.exp(mass) == pytest.approx((80.0 - 24.0) / 70.0, rel=1e-3)
