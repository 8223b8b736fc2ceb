"""Notes on stderr: a policy may play what it was not trained on, and a reader of its score should know."""

from __future__ import annotations

from collections.abc import Sequence

from spoofgym.detectors.base import Detector
from spoofgym.evaluation.trained_on import what_is_new
from spoofgym.policies.learned import LearnedDefender, LearnedSpoofer
from spoofgym.program import say
from spoofgym.scenario import Scenario


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
