"""The detectors of a game, as its arguments name them."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from typing import Any

from spoofgym import validation
from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.scenario import Scenario

HINT = "choose others: detectors=('snapshot', 'windowed:n=5')"


def make_monitors(owner: str, argument: str, given: Any) -> list[Detector]:
    """The detectors that an argument names, without thresholds yet.

    They are copies: an object that the caller gives to two environments must not carry memories between them.

    Args:
        owner: the environment, for messages.
        argument: its name.
        given: a specification or a detector, or several.

    Raises:
        ValueError: one is unknown, or given twice.
    """
    several = given if isinstance(given, tuple | list) else (given,)
    with validation.argument(owner, argument):
        detectors = [deepcopy(make_detector(part)) for part in several]
        names = [detector.name for detector in detectors]
        if len(set(names)) < len(names):
            raise ValueError(f"each detector can be given once only, got {', '.join(names)}")
    return detectors


def require_fitting(detectors: Sequence[Detector], scenario: Scenario) -> None:
    """Refuse detectors that need what the scenario does not give.

    Raises:
        ValueError: naming the first of them, and what it needs.
    """
    for detector in detectors:
        scenario.facts.require(f"detector {detector.name!r}", detector.needs, HINT)
