"""Parts of a simulation are fitted to its scenario: bound to its runs, or refused where they need what it lacks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.attacks.base import Attack
from spoofgym.detectors.base import Detector, require_threshold
from spoofgym.navigation.facts import LINEAR_MODEL, RANGES
from spoofgym.responses.base import Response
from spoofgym.scenario import Scenario


def fit_detectors(owner: str, detectors: Sequence[Detector], scenario: Scenario, num_runs: int) -> None:
    """Bind detectors to the runs of a scenario, and tell them what is known of its filter.

    Args:
        owner: whose detectors, for messages.
        detectors: each with its threshold set.
        scenario: of the game.
        num_runs: N.

    Raises:
        ValueError: a detector needs what the scenario does not give, or has no threshold.
        TypeError: one is no detector.
    """
    for detector in detectors:
        validation.instance(owner, "detectors", detector, Detector, "detectors, as make_detector gives")
    for detector in detectors:
        detector.bind(num_runs, scenario.family.seen_dimension(detector.in_position))
        scenario.facts.require(f"detector {detector.name!r}", detector.needs)
        detector.know(scenario.facts)
        require_threshold(detector)


def fit_attack(owner: str, attack: Attack, scenario: Scenario, num_runs: int) -> None:
    """Bind an attack to the runs of a scenario, and show it what it must see of the game.

    Raises:
        ValueError: it lies outside the game, or needs what the scenario does not give.
        TypeError: it is no attack.
    """
    validation.instance(owner, "attack", attack, Attack, "an attack, as make_attack gives, or None")
    family, facts = scenario.family, scenario.facts
    if attack.needs_velocity and not family.measures_velocity:
        raise ValueError(
            f"attack {attack.name!r} needs fixes with velocity (m = 6), scenario {scenario.name!r} has "
            f"{family.measurement}"
        )
    if attack.needs_ranges:
        facts.require(f"attack {attack.name!r}", (RANGES,))
        slots = family.satellites(np.arange(scenario.timeline.num_epochs + 1), 0)
        attack.meet(np.unique(slots[slots >= 0]))
    attack.bind(scenario.timeline, num_runs)
    attack.follow(scenario.velocity_in_steps())
    if attack.needs_model:
        facts.require(f"attack {attack.name!r}", (LINEAR_MODEL,))
        attack.study(scenario.linear_model())


def fit_response(owner: str, response: Response, scenario: Scenario, num_runs: int) -> None:
    """Bind a response to the runs of a scenario.

    Raises:
        ValueError: it needs what the scenario does not give.
        TypeError: it is no response.
    """
    validation.instance(owner, "response", response, Response, "a response, as make_response gives, or None")
    scenario.facts.require(f"response {response.name!r}", response.needs)
    response.know(scenario.facts)
    response.bind(num_runs)


def join(simulation: Any, *players: Attack | Detector | Response | None) -> None:
    """Give players the simulation that they play in, when it has been set up; None is nobody."""
    for player in players:
        if player is not None:
            player.join(simulation)
