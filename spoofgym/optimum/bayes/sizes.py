"""The integral over an attack's size and heading, where the likelihood is Gaussian in them and the prior is not.

The log likelihood of an attack a = r (sin θ, cos θ) against none is b'a - a'Aa/2. In polar coordinates the prior is a
product, and its ends are ends of intervals: Gauss-Legendre in log r over the sizes that matter, and for each of them
equidistant headings around the best one, or around the whole circle where the heading is unknown.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.kernels import njit
from spoofgym.optimum.bayes.tree import GROWTH, LOG_UNIFORM, POWER

REACH = 4.5
"""Half width of a window, in standard deviations."""
RIDGE = 1e-12
"""Added to the diagonal of A, so that an attack that nothing has shown yet has an inverse."""


class Rule(NamedTuple):
    """The nodes of the integral.

    Attributes:
        place: Gauss-Legendre nodes of the size in [-1, 1], (R,).
        weight: their weights, (R,).
        headings: T, number of headings.
    """

    place: Floats
    weight: Floats
    headings: int


def rule(sizes: int, headings: int) -> Rule:
    """A rule of so many nodes."""
    place, weight = np.polynomial.legendre.leggauss(sizes)
    return Rule(place, weight, headings)


@njit(cache=True, nogil=True, error_model="numpy")
def support(kind: int, law: Floats, left: float) -> tuple[float, float]:
    """Least and largest size."""
    if kind == GROWTH:
        return 2.0 * law[0] / law[3] ** 2, 2.0 * law[1] / left**2
    return law[0], law[1]


@njit(cache=True, nogil=True, error_model="numpy")
def density(kind: int, law: Floats, left: float, size: float) -> float:
    """Of log r at a size, times the share of the node's mass that is left.

    GROWTH: the size is 2 r / T², log r and T are uniform, and T is at least ``left``.
    """
    if kind == LOG_UNIFORM:
        return left / math.log(law[1] / law[0])
    if kind == POWER:
        power = law[2] + 1.0
        return left * power * size**power / (law[1] ** power - law[0] ** power)
    longest = min(math.sqrt(2.0 * law[1] / size), law[3])
    shortest = max(math.sqrt(2.0 * law[0] / size), left)
    return max(longest - shortest, 0.0) / ((law[3] - law[2]) * math.log(law[1] / law[0]))


@njit(cache=True, nogil=True, error_model="numpy")
def best(linear: Floats, quadratic: Floats, low: float, high: float) -> tuple[float, float, float, float, float]:
    """Where the likelihood is largest.

    Args:
        linear: b, (2,).
        quadratic: A: its elements 00, 01, 11, (3,).
        low: least size.
        high: largest.

    Returns:
        The direction of A⁻¹ b (2), its length, the standard deviation of the size, and about the largest log likelihood
        of a size that is possible.
    """
    a00, a01, a11 = quadratic[0] + RIDGE, quadratic[1], quadratic[2] + RIDGE
    determinant = a00 * a11 - a01 * a01
    x = (a11 * linear[0] - a01 * linear[1]) / determinant
    y = (a00 * linear[1] - a01 * linear[0]) / determinant
    length = math.hypot(x, y)
    ux, uy = (x / length, y / length) if length > 0.0 else (1.0, 0.0)
    deviation = math.sqrt((a11 * ux * ux - 2.0 * a01 * ux * uy + a00 * uy * uy) / determinant)
    short = max(low - length, length - high, 0.0) / deviation
    return ux, uy, length, deviation, 0.5 * (linear[0] * x + linear[1] * y - short * short)


@njit(cache=True, nogil=True, error_model="numpy")
def sizes_and_headings(
    linear: Floats, quadratic: Floats, kind: int, law: Floats, left: float, rule: Rule, nodes: Floats
) -> float:
    """The nodes of the integral over one attack.

    Args:
        linear: b, (2,).
        quadratic: A, (3,).
        kind: of the law of the size.
        law: its numbers, (4,).
        left: what is left of the node's mass.
        rule: R sizes and T headings.
        nodes: posterior weight of each, which sum to 1, and the attack a; one column is working room, (R T, 4), result.

    Returns:
        Logarithm of the integral; minus infinity where nothing is possible.
    """
    low, high = support(kind, law, left)
    x, y, length, deviation, _ = best(linear, quadratic, low, high)
    nearest = min(max(length, low), high)
    reach = math.hypot(nearest - length, REACH * deviation)
    bottom, top = math.log(max(low, length - reach)), math.log(min(high, length + reach))
    half, middle = 0.5 * (top - bottom), 0.5 * (top + bottom)
    count = rule.headings
    peak = -np.inf
    for i in range(len(rule.place)):
        size = math.exp(middle + half * rule.place[i])
        x, y, curvature = _best_heading(linear, quadratic, size, x, y)
        part = nodes[i * count : (i + 1) * count]
        peak = max(peak, _headings(linear, quadratic, size, (x, y, curvature), part))
    total = 0.0
    for i in range(len(rule.place)):
        size = math.exp(middle + half * rule.place[i])
        weight = half * rule.weight[i] * density(kind, law, left, size)
        for j in range(i * count, (i + 1) * count):
            nodes[j, 0] = weight * nodes[j, 3] * math.exp(nodes[j, 0] - peak)
            total += nodes[j, 0]
    if not total > 0.0:
        return -np.inf
    for j in range(len(nodes)):
        nodes[j, 0] /= total
    return peak + math.log(total)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _best_heading(
    linear: Floats, quadratic: Floats, size: float, x: float, y: float
) -> tuple[float, float, float]:
    """The heading of the largest likelihood for a size, by Newton's method, and the curvature there, per rad²."""
    curvature = 0.0
    for _ in range(2):
        # along the circle: (y, -x) is the direction of growing heading
        ahead, aside = linear[0] * x + linear[1] * y, linear[0] * y - linear[1] * x
        along = quadratic[0] * x * x + 2.0 * quadratic[1] * x * y + quadratic[2] * y * y
        mixed = quadratic[0] * x * y + quadratic[1] * (y * y - x * x) - quadratic[2] * x * y
        across = quadratic[0] * y * y - 2.0 * quadratic[1] * x * y + quadratic[2] * x * x
        curvature = size * (ahead + size * (across - along))
        if curvature < 1.0:
            break
        turn = min(max(size * (aside - size * mixed) / curvature, -1.0), 1.0)
        length = math.sqrt(1.0 + turn * turn)
        x, y = (x + turn * y) / length, (y - turn * x) / length
    return x, y, curvature


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _headings(
    linear: Floats, quadratic: Floats, size: float, best: tuple[float, float, float], nodes: Floats
) -> float:
    """The nodes of one size, (T, 4): log likelihood, attack, prior weight of the heading; the largest likelihood."""
    x, y, curvature = best
    count, width = len(nodes), 2.0 * math.pi
    if curvature > 0.0:
        width = min(width, 2.0 * REACH / math.sqrt(curvature))
    step = width / count
    sine, cosine = math.sin(0.5 * step), math.cos(0.5 * step)
    for _ in range(count - 1):
        x, y = cosine * x - sine * y, cosine * y + sine * x
    sine, cosine = 2.0 * sine * cosine, cosine * cosine - sine * sine
    peak = -np.inf
    for j in range(count):
        east, north = size * x, size * y
        square = quadratic[0] * east * east + 2.0 * quadratic[1] * east * north + quadratic[2] * north * north
        likelihood = linear[0] * east + linear[1] * north - 0.5 * square
        nodes[j, 0], nodes[j, 1], nodes[j, 2], nodes[j, 3] = likelihood, east, north, step / (2.0 * math.pi)
        peak = max(peak, likelihood)
        x, y = cosine * x + sine * y, cosine * y - sine * x
    return peak
