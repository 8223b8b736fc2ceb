"""The baselines of an attacker in a game: none, random, best constant ramp, closed form, optimum, upper bound."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.attacks import make_attack
from spoofgym.attacks.base import Attack
from spoofgym.detectors.base import Detector
from spoofgym.detectors.chi_square import Snapshot
from spoofgym.optimum import best_budget, best_ramp, bounded_optimum, noncentrality_optimum, upper_bound
from spoofgym.policies.scripted import OffsetSequence, RandomRates
from spoofgym.scenario import Scenario

Score = Callable[[Attack, int], float]
"""The mean undetected error, m, of an attack over so many games, which are always played with the same noise."""

SEARCH_EPISODES = 1000
SEARCH_ROUNDS = 3


@dataclass(frozen=True)
class Baseline:
    """An attacker to compare with.

    Attributes:
        name: in tables.
        knowledge: of the victim that it needs.
        attack: what it does; None where nothing plays (a bound, or an optimum that is not known).
        exact: its exact undetected error, m, where it is known.
    """

    name: str
    knowledge: str
    attack: Attack | None
    exact: float | None


def exact_threshold(scenario: Scenario, detectors: list[Detector]) -> float | None:
    """The threshold where exact values exist, a matched filter against the snapshot test alone; else None."""
    if scenario.matched and len(detectors) == 1 and isinstance(detectors[0], Snapshot) and scenario.dimension == 3:
        return detectors[0].threshold
    return None


def known_baselines(scenario: Scenario, threshold: float) -> list[Baseline]:
    """The baselines of a game with exact values, each computed without a simulation."""
    model = scenario.linear_model()
    ramp = best_ramp(model, threshold, np.array(scenario.drag_off_rate))
    closed, closed_outcome = best_budget(model, threshold)
    optimum = bounded_optimum(model, threshold, np.array(scenario.drag_off_rate))
    return [
        Baseline("none", "blind", make_attack("none"), None),
        Baseline("random", "blind", RandomRates(scenario.drag_off_rate), None),
        Baseline("best-ramp", "shadow", _ramp(ramp.rate, ramp.azimuth), float(ramp.outcome.score)),
        Baseline("closed-form", "shadow", OffsetSequence("closed-form", closed.offsets), float(closed_outcome.score)),
        Baseline("optimum", "shadow", OffsetSequence("optimum", optimum.outcome.offsets), float(optimum.score)),
        Baseline("upper-bound", "shadow", None, float(upper_bound(model, threshold).score)),
    ]


def searched_baselines(scenario: Scenario, score: Score) -> list[Baseline]:
    """The baselines of a game without exact values: ramp and closed form are searched by simulation.

    Args:
        scenario: of the game.
        score: of an attack in the game, by simulation.
    """
    rate, azimuth = _search_ramp(scenario, score)
    baselines = [
        Baseline("none", "blind", make_attack("none"), None),
        Baseline("random", "blind", RandomRates(scenario.drag_off_rate), None),
        Baseline("best-ramp", "shadow", _ramp(rate, azimuth), None),
    ]
    if scenario.dimension == 3:
        unit = noncentrality_optimum(scenario.linear_model(), scenario.timeline.num_epochs, 1.0).offsets
        scale = _search_scale(lambda factor: OffsetSequence("closed-form", factor * unit), score)
        baselines.append(Baseline("closed-form", "shadow", OffsetSequence("closed-form", scale * unit), None))
    else:
        baselines.append(Baseline("closed-form", "shadow", None, None))
    return [*baselines, Baseline("optimum", "shadow", None, None), Baseline("upper-bound", "shadow", None, None)]


def _ramp(rate: float, azimuth: float) -> Attack:
    return make_attack(f"ramp:{rate:.6g},direction={azimuth:.6g}")


def _search_ramp(scenario: Scenario, score: Score) -> tuple[float, float]:
    """Best rate (m/s) and azimuth (degrees) on a grid that is refined about its best point."""
    rates: Floats = np.geomspace(0.01, max(scenario.drag_off_rate[:2]), 9)
    azimuths: Floats = np.arange(0.0, 180.0, 45.0)
    best = (-1.0, 0.0, 0.0)
    for _ in range(SEARCH_ROUNDS):
        scores = [
            (score(_ramp(rate, azimuth % 180.0), SEARCH_EPISODES), rate, azimuth)
            for rate in rates
            for azimuth in azimuths
        ]
        best = max([best, *scores])
        ratio = (rates[-1] / rates[0]) ** (1.0 / (len(rates) - 1))
        spacing = azimuths[1] - azimuths[0]
        limit = max(scenario.drag_off_rate[:2])
        rates = np.minimum(best[1] * np.geomspace(1.0 / ratio, ratio, 5), limit)
        azimuths = best[2] + spacing * np.array([-0.5, 0.0, 0.5])
    return float(best[1]), float(best[2] % 180.0)


def _search_scale(attack_at: Callable[[float], Attack], score: Score) -> float:
    """Best factor on a grid that is refined about its best point."""
    factors: Floats = np.geomspace(0.5, 100.0, 12)
    best = (-1.0, 0.0)
    for _ in range(SEARCH_ROUNDS):
        best = max([best, *((score(attack_at(factor), SEARCH_EPISODES), factor) for factor in factors)])
        ratio = (factors[-1] / factors[0]) ** (1.0 / (len(factors) - 1))
        factors = best[1] * np.geomspace(1.0 / ratio, ratio, 5)
    return float(best[1])
