"""Named set-ups: one file per paper, recorded logs, our own."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

from spoofgym.scenario import Scenario
from spoofgym.scenarios.foi_drive import foi_drive
from spoofgym.scenarios.kujur_flight import kujur_flight
from spoofgym.scenarios.liu_flight import liu_flight
from spoofgym.scenarios.recorded import recorded
from spoofgym.scenarios.shadmehri_flight import shadmehri_flight
from spoofgym.scenarios.song_robot import song_robot
from spoofgym.specification import build

SCENARIOS: dict[str, Callable[..., Scenario]] = {
    "foi-drive": foi_drive,
    "kujur-flight": kujur_flight,
    "liu-flight": liu_flight,
    "recorded": recorded,
    "shadmehri-flight": shadmehri_flight,
    "song-robot": song_robot,
}


@lru_cache(maxsize=32)
def _build(text: str) -> Scenario:
    return build(text, SCENARIOS, "scenario")


def make_scenario(scenario: str | Scenario) -> Scenario:
    """The scenario that a specification names; an object is returned as it is.

    Raises:
        ValueError: unknown name or option, or a value that does not fit; the message lists the valid ones.
    """
    return scenario if isinstance(scenario, Scenario) else _build(scenario)
