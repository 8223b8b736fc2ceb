"""What a policy was trained on, where it plays something else: it may play, and whoever reads its score should know."""

from __future__ import annotations

from collections.abc import Sequence

from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.envs.config import SpooferConfig
from spoofgym.envs.trained import defender_config, spoofer_config
from spoofgym.policies.learned import LearnedDefender, LearnedSpoofer
from spoofgym.program import say
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario


def tell_what_is_new(
    policies: Sequence[LearnedSpoofer | LearnedDefender],
    scenario: Scenario,
    fidelity: str,
    detectors: Sequence[Detector] | None = None,
) -> None:
    """One line on stderr for each policy that plays what it was not trained on.

    Args:
        policies: that play.
        scenario: in which.
        fidelity: of the simulation.
        detectors: that watch a spoofer; None = they are no part of what it was trained on, or are those it asks for.
    """
    for policy in policies:
        new = what_is_new(policy, scenario, fidelity, detectors)
        if new:
            say(f"note: policy {policy.name!r} plays what it was not trained on: {'; '.join(new)}")


def what_is_new(
    policy: LearnedSpoofer | LearnedDefender, scenario: Scenario, fidelity: str, detectors: Sequence[Detector] | None
) -> list[str]:
    """In what a game differs from the one that a policy was trained on."""
    config = spoofer_config(policy) if isinstance(policy, LearnedSpoofer) else defender_config(policy)
    pairs = [
        ("scenario", scenario.name, _scenario_name(str(config.scenario), config.coupling)),
        ("fidelity", fidelity, config.fidelity),
    ]
    if isinstance(config, SpooferConfig) and detectors is not None:
        given = config.detector if isinstance(config.detector, tuple) else (config.detector,)
        trained = ", ".join(make_detector(str(part)).name for part in given)
        pairs.append(("detector", ", ".join(detector.name for detector in detectors), trained))
    return [f"{what} {here} (trained: {there})" for what, here, there in pairs if here != there]


def _scenario_name(text: str, coupling: str | None) -> str:
    """The full name of the scenario of a training; its specification where it cannot be built here."""
    try:
        return make_scenario(text, coupling).name
    except (ValueError, OSError):
        return text
