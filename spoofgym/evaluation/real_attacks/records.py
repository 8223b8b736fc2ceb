"""Which records take part, with which options, and which real attack each holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from spoofgym.attacks.recorded import NAME as RECORDED
from spoofgym.logs.log_files import NOTES
from spoofgym.logs.notes import Notes
from spoofgym.logs.spoofed_fixes import TABLE as SPOOFED_FIXES
from spoofgym.logs.spoofed_ranges import TABLE as SPOOFED_RANGES
from spoofgym.logs.table import has_table
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.specification import Specification

RESTING = {"imu": "simulated:tactical", "oscillator": "ocxo"}
"""Options of an antenna that rests, whose log has no IMU, where none are given."""
SAME_PLACE = 1e-6
"""Antennas so near to each other are one, rad."""


@dataclass(frozen=True)
class Record:
    """A log that takes part.

    Attributes:
        name: that tables use.
        given: the specification of the log without an attack.
        beside: whether the spoofed fixes or ranges of a real attack stand beside the true ones.
        within: whether its own ranges are spoofed from some time on.
        scene: the record of the same antenna without an attack; None = there is none, or it needs none.
    """

    name: str
    given: Specification
    beside: bool
    within: bool
    scene: Record | None = None

    @property
    def is_clean(self) -> bool:
        """Whether it can be played without an attack to its end."""
        return not self.within

    def scenario(self) -> Scenario:
        """The log without an attack."""
        return make_scenario(str(self.given))

    def attacked(self) -> Scenario:
        """The game of the attack within its ranges."""
        options = {**self.given.options, "attack": RECORDED}
        if self.scene is not None:
            options["clean"] = str(self.scene.given.value)
        return make_scenario(str(replace(self.given, options=options)))


def folders_of(data: Path) -> list[str]:
    """The folders of logs in a folder, in the order of their names."""
    return [str(path) for path in sorted(data.iterdir()) if (path / NOTES).is_file()] if data.is_dir() else []


def records(texts: Sequence[str]) -> list[Record]:
    """The records that texts name, each a folder and options after it; a scene without an attack is found among them.

    Raises:
        ValueError: a folder is no log, or two have one name.
    """
    found = [_record(text) for text in texts]
    names = [record.name for record in found]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"two logs are named {twice!r}; each needs a folder of another name")
    return [replace(record, scene=_scene(record, found)) if record.within else record for record in found]


def _record(text: str) -> Record:
    given = Specification.parse(text if text.startswith(f"{RECORDED}:") else f"{RECORDED}:{text}")
    folder = Path(given.value or "")
    if not folder.is_dir():
        raise ValueError(f"log {str(folder)!r} is no folder; a log is a folder with {NOTES}")
    for option in ("attack", "onset", "horizon", "clean"):
        if option in given.options:
            raise ValueError(f"log {str(folder)!r}: {option} is chosen by the study; leave it out")
    notes, options = Notes(folder / NOTES), dict(given.options)
    if notes.antenna() is not None and not has_table(folder, "imu"):
        options = {**RESTING, **options}
    ranges = options.get("coupling") == "tight" or "imu" in options
    table = SPOOFED_RANGES if ranges else SPOOFED_FIXES
    beside = has_table(folder, table) and notes.attacked() is not None
    within = ranges and notes.effects() is not None and not beside
    return Record(folder.resolve().name, replace(given, options=options), beside, within)


def _scene(record: Record, others: Sequence[Record]) -> Record | None:
    """The first record without an attack whose antenna rests in the same place."""
    place = _place(record)
    for other in others:
        if place is not None and other.is_clean and not other.beside:
            there = _place(other)
            if there is not None and np.abs(there[:2] - place[:2]).max() < SAME_PLACE:
                return other
    return None


def _place(record: Record) -> np.ndarray | None:
    return Notes(Path(str(record.given.value)) / NOTES).antenna()
