"""What a policy was trained on, where it plays something else: it may play, and a reader of its score should know."""

from __future__ import annotations

from collections.abc import Sequence

from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.envs.config import SpooferConfig
from spoofgym.envs.trained import defender_config, spoofer_config
from spoofgym.policies.learned import LearnedDefender, LearnedSpoofer
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario


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
