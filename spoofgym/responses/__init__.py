"""What follows an alarm."""

from __future__ import annotations

from collections.abc import Callable

from spoofgym.responses.ardupilot import ArduPilotClip, ArduPilotGlitch
from spoofgym.responses.backtrack import ExcludeAndBacktrack
from spoofgym.responses.base import Response
from spoofgym.responses.constant_velocity import ConstantVelocityStart
from spoofgym.responses.exclude import AlwaysExclude, AlwaysUse, Exclude, Latch
from spoofgym.responses.exclude_satellites import ExcludeSatellites
from spoofgym.responses.multiple_hypothesis import MultipleHypothesis
from spoofgym.responses.onset_depth import OnsetDepth
from spoofgym.responses.px4 import Px4Auto, Px4DeadReckoning
from spoofgym.specification import build

RESPONSES: dict[str, Callable[..., Response]] = {
    "always-use": AlwaysUse,
    "always-exclude": AlwaysExclude,
    "exclude": Exclude,
    "latch": Latch,
    "exclude-satellites": ExcludeSatellites,
    "exclude-and-backtrack": ExcludeAndBacktrack,
    "constant-velocity-start": ConstantVelocityStart,
    "onset-depth": OnsetDepth,
    "multiple-hypothesis": MultipleHypothesis,
    "px4-auto": Px4Auto,
    "px4-dead-reckoning": Px4DeadReckoning,
    "ardupilot-glitch": ArduPilotGlitch,
    "ardupilot-clip": ArduPilotClip,
}


def make_response(response: str | Response) -> Response:
    """The response that a specification names; an object is returned as it is.

    Raises:
        ValueError: unknown name or option; the message lists the valid ones.
    """
    return response if isinstance(response, Response) else build(response, RESPONSES, "response")
