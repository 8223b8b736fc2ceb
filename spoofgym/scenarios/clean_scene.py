"""The scene of a recorded attack without the attack: where thresholds and false alarms come from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.recorded_family import SETTLING, recorded_family
from spoofgym.specification import Specification

OF_THE_GAME = ("attack", "clean", "onset", "horizon")
"""Options that belong to the game of the attack."""


def clean_scene(scenario: Scenario) -> Scenario:
    """The clean game for a recorded one.

    Where the log has the unspoofed fixes or ranges beside the spoofed ones, it is the scenario itself: who plays no
    attack plays it clean. Where its own ranges are spoofed, it is the log that ``clean=`` names, else what comes before
    the attack; it begins `SETTLING` after the alignment.

    Raises:
        ValueError: the log that ``clean=`` names cannot be used, or nothing is left after `SETTLING`.
    """
    family, given = recorded_family(scenario), Specification.parse(scenario.name)
    if not (family.attacked and family.spoofed_within):
        return scenario
    options = {key: value for key, value in given.options.items() if key not in OF_THE_GAME}
    scene = make_scenario(str(replace(given, value=given.options.get("clean", given.value), options=options)))
    time = recorded_family(scene).epoch_time
    first = int(np.searchsorted(time, recorded_family(scene).align_time + SETTLING))
    if first > len(time) - 2:
        raise ValueError(
            f"scenario {scenario.name!r}: the clean scene {scene.name!r} ends within {SETTLING:g} s of the alignment; "
            "clean=FOLDER names a log of the same scene without the attack"
        )
    return scene.changed(onset=float(time[first]))
