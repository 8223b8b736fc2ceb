"""Classical defenders: a detector and a response each, published ones and those tuned on the training attacks."""

from __future__ import annotations

import re
from dataclasses import dataclass

from spoofgym.detectors import DETECTORS
from spoofgym.responses import RESPONSES
from spoofgym.specification import Specification, registered_by_others

SEPARATOR = " > "
SLASH = "/"
"""May stand for the separator: a shell takes ``>`` for a redirection."""
WORLD_DETECTORS = (
    "snapshot",
    "windowed:n=5",
    "windowed:n=20",
    "signed-mean:n=5",
    "signed-mean:n=10",
    "relative-motion:k=20",
)
"""Run beside every defender of an evaluation, so that the same episode begins the same for all."""


@dataclass(frozen=True)
class ClassicalDefender:
    """What watches, and what follows its alarm.

    Attributes:
        name: in reports.
        detector: its specification.
        response: its specification.
        tuned: chosen on the training attacks; else published, or a yardstick.
    """

    name: str
    detector: str
    response: str
    tuned: bool = False


PUBLISHED = (
    ClassicalDefender("snapshot", "snapshot", "exclude"),
    ClassicalDefender("snapshot-latch", "snapshot", "latch"),
    ClassicalDefender("foi-w5-b20", "windowed:n=5", "exclude-and-backtrack:20"),
    ClassicalDefender("foi-w20-b20", "windowed:n=20", "exclude-and-backtrack:20"),
    ClassicalDefender("foi-w5-b0", "windowed:n=5", "exclude"),
    ClassicalDefender("foi-w20-b0", "windowed:n=20", "exclude"),
    ClassicalDefender("foi-relative-b20", "relative-motion:k=20", "exclude-and-backtrack:20"),
    ClassicalDefender("foi-constant-velocity", "windowed:n=5", "constant-velocity-start:20"),
    ClassicalDefender("px4-auto", "snapshot", "px4-auto"),
    ClassicalDefender("px4-dead-reckoning", "snapshot", "px4-dead-reckoning"),
    ClassicalDefender("ardupilot-glitch", "snapshot", "ardupilot-glitch"),
    ClassicalDefender("ardupilot-clip", "snapshot", "ardupilot-clip"),
)
"""The responses of the literature and of two autopilots, which follow their own gates instead of an alarm."""

WITHOUT_ALARM = ("multiple-hypothesis",)
"""Responses that follow no alarm, but weigh the innovations themselves."""


def keeps_within(limit: float) -> str:
    """The multiple-hypothesis defender that seeks to keep the error within an alert limit, m.

    Its options are the best of some ten on the drive with a limit of 50 m, against attacks that no test sees.
    """
    return f"multiple-hypothesis:ahead=30,hidden=0.7,amplitude=3,limit={limit:g}"


OWN_ALARM = "windowed:n=20"
"""Which a response of somebody else follows, where nobody says otherwise."""

GRID_DETECTORS = ("windowed:n=20", "signed-mean:n=5", "signed-mean:n=10")
GRID_DEPTHS = (0, 10, 20, 50)
GRID_REUSES = (0, 5, 12)
"""The grid that classical defenders are tuned on: detector x depth (or the estimated onset) x epochs until re-use."""


TUNED = {
    "foi-drive": [
        ClassicalDefender("tuned-depth", "signed-mean:n=5", "exclude-and-backtrack:10,reuse=12", True),
        ClassicalDefender("tuned-onset", "signed-mean:n=5", "onset-depth:reuse=12", True),
    ],
    "liu-flight:horizon=250,imu=tactical": [
        ClassicalDefender("tuned-depth", "signed-mean:n=5", "exclude-and-backtrack:50,reuse=12", True),
        ClassicalDefender("tuned-onset", "signed-mean:n=10", "onset-depth:reuse=12", True),
    ],
}
"""The best of the grid on 4,000 games of each scenario's training attacks: ``spoofgym tune``."""


def grid() -> list[ClassicalDefender]:
    """Every defender of the grid; detectors and responses that somebody else has registered are part of it."""
    result = []
    for detector in (*GRID_DETECTORS, *registered_by_others(DETECTORS)):
        for response in registered_by_others(RESPONSES):
            result.append(ClassicalDefender(f"{detector}{SEPARATOR}{response}", detector, response, True))
        for reuse in GRID_REUSES:
            option = f"reuse={reuse}" if reuse else ""
            for depth in GRID_DEPTHS:
                response = with_depth(depth, option)
                result.append(ClassicalDefender(f"{detector}{SEPARATOR}{response}", detector, response, True))
            response = "onset-depth" + (f":{option}" if option else "")
            result.append(ClassicalDefender(f"{detector}{SEPARATOR}{response}", detector, response, True))
    return result


def own_defenders() -> list[ClassicalDefender]:
    """Detectors that somebody else has registered, with the plainest response, and such responses to a usual alarm."""
    pairs = [(name, "exclude") for name in registered_by_others(DETECTORS)]
    pairs += [(OWN_ALARM, name) for name in registered_by_others(RESPONSES)]
    return [ClassicalDefender(f"{detector}{SEPARATOR}{response}", detector, response) for detector, response in pairs]


def with_depth(depth: int, options: str = "") -> str:
    """The response that excludes, and takes ``depth`` epochs back first; ``options`` are those of its re-use."""
    if depth:
        return f"exclude-and-backtrack:{depth}" + (f",{options}" if options else "")
    return "exclude" + (f":{options}" if options else "")


def tuned_for(scenario: str) -> list[ClassicalDefender]:
    """The tuned defenders of a scenario: the best of a fixed depth, then the best that estimates the onset.

    For a scenario that nobody has tuned them on they are those of the drive.
    """
    return TUNED.get(scenario, TUNED["foi-drive"])


def watcher_and_response(text: str) -> tuple[str, str] | None:
    """The specifications of a detector and of the response to its alarm; None where a text spells no such pair.

    ``detector > response`` is one, and ``detector/response``. Slashes within the detector, which stand for commas in a
    part of it, are told from this one by the name of a response that follows it.
    """
    detector, separator, response = (part.strip() for part in text.partition(SEPARATOR.strip()))
    if separator:
        return detector, response
    if re.split("[:,/]", text.strip(), maxsplit=1)[0].strip() not in DETECTORS:
        return None
    for slash in (place for place, letter in enumerate(text) if letter == SLASH):
        rest = text[slash + 1 :].strip()
        if re.split("[:,]", rest, maxsplit=1)[0].strip() in RESPONSES:
            return text[:slash].strip(), rest
    return None


def parse(text: str) -> ClassicalDefender:
    """The defender that ``detector > response`` or ``detector/response`` spells.

    Raises:
        ValueError: the text is not of this form.
    """
    parts = watcher_and_response(text)
    if parts is None or not all(parts):
        raise ValueError(f"a defender is spelled detector/response, e.g. snapshot/exclude, got {text!r}")
    detector, response = parts
    Specification.parse(detector)
    Specification.parse(response)
    return ClassicalDefender(f"{detector}{SEPARATOR}{response}", detector, response)
