"""The parts that golden episodes are played with: thresholds that need no calibration, options that have no default."""

from __future__ import annotations

import inspect

from spoofgym.attacks import ATTACKS
from spoofgym.detectors import DETECTORS, make_detector
from spoofgym.detectors.base import Detector
from spoofgym.detectors.receiver_flag import ReceiverFlag
from spoofgym.responses.base import Response
from spoofgym.scenario import Scenario

QUIET = 1e8
"""A threshold that no statistic exceeds."""
REQUIRED = {"rate": "0.5", "jump": "2", "radius": "20", "delay": "3", "d": "1.2", "azimuth": "90", "attack": "ramp:0.5"}
"""Values for options of attacks that have no default."""


def ready(name: str, threshold: float = QUIET) -> Detector:
    """A detector by its specification, with a threshold that need not be calibrated."""
    detector = make_detector(name)
    for part in (*detector.members, detector):
        if part.lacks_slope:
            part.set_slope(0.1)
        if part.threshold is None or isinstance(part, ReceiverFlag):
            part.set_threshold(threshold if part is detector else 1.0)
    return detector


def fits(part: Detector | Response, scenario: Scenario) -> bool:
    """Whether a scenario offers what a detector or response needs."""
    return set(part.needs) <= set(scenario.offers)


def detectors_for(scenario: Scenario) -> list[Detector]:
    """Every detector that fits a scenario."""
    return [detector for detector in map(ready, DETECTORS) if fits(detector, scenario)]


def spelled(name: str) -> str:
    """The specification of an attack, with values for options that have no default."""
    parameters = inspect.signature(ATTACKS[name]).parameters.values()
    needed = [parameter.name for parameter in parameters if parameter.default is parameter.empty]
    return name + "".join(f"{',' if place else ':'}{key}={REQUIRED[key]}" for place, key in enumerate(needed))
