"""The files of a recorded log, and what tells whether they are still those that were read."""

from __future__ import annotations

import os
from pathlib import Path

NOTES = "log.toml"
EPHEMERIS = "ephemeris.csv"
TABLES = ("imu", "gnss", "reference", "ranges")
"""Each is ``NAME.csv`` or ``NAME.csv.gz``."""

State = tuple[str, tuple[tuple[str, int, int, int, int], ...]]


def log_state(folder: str | Path) -> State:
    """What changes whenever a file of the log does: the resolved path and, of each file, size, times and place.

    The time of the last change of the file's entry counts beside that of its content, since programs can set the
    latter, e.g. where they copy a file over another one of its size.
    """
    resolved = os.path.realpath(folder)
    names = [NOTES, EPHEMERIS, *(f"{table}{ending}" for table in TABLES for ending in (".csv", ".csv.gz"))]
    states = []
    for name in names:
        try:
            found = os.stat(os.path.join(resolved, name))
        except OSError:
            continue
        states.append((name, found.st_size, found.st_mtime_ns, found.st_ctime_ns, found.st_ino))
    return resolved, tuple(states)
