"""Named set-ups: one file per paper, recorded logs, our own."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from spoofgym import validation
from spoofgym.logs.log_files import State, log_state
from spoofgym.navigation.family import COUPLINGS
from spoofgym.scenario import Scenario
from spoofgym.scenarios.cache import ScenarioCache
from spoofgym.scenarios.foi_drive import foi_drive
from spoofgym.scenarios.kujur_flight import kujur_flight
from spoofgym.scenarios.liu_flight import liu_flight
from spoofgym.scenarios.recorded import recorded
from spoofgym.scenarios.shadmehri_flight import shadmehri_flight
from spoofgym.scenarios.song_robot import song_robot
from spoofgym.specification import Specification, build

SCENARIOS: dict[str, Callable[..., Scenario]] = {
    "foi-drive": foi_drive,
    "kujur-flight": kujur_flight,
    "liu-flight": liu_flight,
    "recorded": recorded,
    "shadmehri-flight": shadmehri_flight,
    "song-robot": song_robot,
}

_CACHE = ScenarioCache()


def _build(text: str) -> Scenario:
    return _CACHE.get((text, _factory(text), _log_state(text)), partial(build, text, SCENARIOS, "scenario"))


def _factory(text: str) -> Callable[..., Scenario] | None:
    """The function that builds it, which may be registered anew under its name; None where there is none."""
    return SCENARIOS.get(Specification.parse(text).name)


def _log_state(text: str) -> State | None:
    """That of the log that a specification names; None where it names none."""
    if not isinstance(text, str):
        return None
    given = Specification.parse(text)
    folder = given.options.get("path", given.value)
    if given.name != "recorded" or folder is None:
        return None
    return log_state(folder, given.options.get("noise"))


def _made(scenario: Any) -> Scenario:
    """From the cache what a text names; what is neither text nor scenario is refused."""
    if isinstance(scenario, Scenario):
        return scenario
    return _build(scenario) if isinstance(scenario, str) else build(scenario, SCENARIOS, "scenario")


def make_scenario(scenario: str | Scenario, coupling: str | None = None) -> Scenario:
    """The scenario that a specification names; an object is returned as it is.

    The scenarios that were built last are kept. A recorded one is built anew once a file of its log has changed.

    Args:
        scenario: the specification, or an object.
        coupling: that its filter must have, ``loose`` or ``tight``: ``coupling=`` is added to a specification that has
            this option and does not use it; None = what the scenario is.

    Raises:
        ValueError: unknown name or option, a value that does not fit (the message lists the valid ones), or a scenario
            of the other coupling.
    """
    if coupling is None:
        return _made(scenario)
    validation.one_of("scenario", "coupling", coupling, COUPLINGS)
    made = _build(_with_coupling(scenario, coupling)) if isinstance(scenario, str) else make_scenario(scenario)
    if made.family.coupling != coupling:
        choose = ", ".join(name for name in SCENARIOS if _takes_coupling(name))
        raise ValueError(
            f"scenario {made.name!r} is {made.family.coupling}ly coupled, not {coupling}ly; with coupling=loose or "
            f"coupling=tight: {choose}"
        )
    return made


def _takes_coupling(name: str) -> bool:
    return name in SCENARIOS and "coupling" in inspect.signature(SCENARIOS[name]).parameters


def _with_coupling(text: str, coupling: str) -> str:
    """The specification with this coupling, if its scenario has the option and it says nothing of it."""
    given = Specification.parse(text)
    if not _takes_coupling(given.name) or "coupling" in given.options:
        return text
    if given.value is not None and next(iter(inspect.signature(SCENARIOS[given.name]).parameters)) == "coupling":
        return text
    return str(replace(given, options={**given.options, "coupling": coupling}))
