"""Makes tables of a recording fit for the log format: finite values, increasing times, a span of time."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.logs.importers.recording import Columns, Recording

SEVERAL_PER_TIME = ("ranges", "ranges_other")
"""Tables with several rows of one time."""
WITHOUT_TIME = ("ephemeris",)
LATEST = 1e12
"""Latest time of a log, s."""


def tidy(recording: Recording, begin: float | None, end: float | None) -> None:
    """Leave out rows that no table of a log may have, and those outside a span of time; tell how many.

    Args:
        recording: changed in place.
        begin: first time to keep, s; None = all.
        end: last time to keep, s; None = all.

    Raises:
        ValueError: the source has no inertial samples or no fixes, or nothing in the span.
    """
    for name, table in list(recording.tables.items()):
        if name in WITHOUT_TIME:
            continue
        recording.tables[name] = _tidied(recording, name, table, begin, end)
    for name, what in (("imu", "inertial samples"), ("gnss", "fixes")):
        rows = len(recording.tables.get(name, {"t_s": np.empty(0)})["t_s"])
        if rows < 2:
            span = "" if begin is None and end is None else " in this span of time"
            raise ValueError(f"{recording.kind}: {rows} {what} found{span}; needed are 2 or more")
    for name in [name for name, table in recording.tables.items() if not len(next(iter(table.values())))]:
        del recording.tables[name]


def _tidied(recording: Recording, name: str, table: Columns, begin: float | None, end: float | None) -> Columns:
    finite = _finite(table)
    _tell(recording, name, ~finite, "have a value that is no finite number, or no time")
    table = {key: values[finite] for key, values in table.items()}
    later = _later(name, table)
    _tell(recording, name, ~later, "are not later than the row before")
    time = table["t_s"]
    wanted = later & (time >= (-LATEST if begin is None else begin)) & (time <= (LATEST if end is None else end))
    return {key: values[wanted] for key, values in table.items()}


def _finite(table: Columns) -> Flags:
    """Rows whose values are all numbers."""
    good = np.abs(table["t_s"]) <= LATEST
    for values in table.values():
        good &= np.isfinite(values)
    return np.asarray(good)


def _later(name: str, table: Columns) -> Flags:
    """Rows that are later than all rows before; where a time may have several rows, not earlier."""
    time: Floats = table["t_s"]
    if not len(time):
        return np.empty(0, dtype=bool)
    before = np.concatenate([[-np.inf], np.maximum.accumulate(time)[:-1]])
    return np.asarray(time >= before if name in SEVERAL_PER_TIME else time > before)


def _tell(recording: Recording, name: str, rows: Flags, what: str) -> None:
    if rows.any():
        first = int(np.argmax(rows)) + 1
        recording.problems.append(
            f"{name}: {int(rows.sum())} of {len(rows)} rows {what}, and are left out; the first is row {first}"
        )
