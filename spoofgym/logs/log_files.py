"""The files of a recorded log, and what tells whether they are still those that were read."""

from __future__ import annotations

import os
from pathlib import Path

NOTES = "log.toml"
EPHEMERIS = "ephemeris.csv"
NOISE = "noise.toml"
"""The noises of the log as they were estimated, which a scenario reads where it is told to."""
TABLES = ("imu", "gnss", "reference", "ranges", "ranges_spoofed", "barometer", "magnetometer", "wheels", "aux")
"""Each is ``NAME.csv`` or ``NAME.csv.gz``."""

State = tuple[str, tuple[tuple[str, int, int, int, int], ...]]


def log_state(folder: str | Path, noise: str | None = None) -> State:
    """What changes whenever a file of the log does: the resolved path and, of each file, size, times and place.

    The time of the last change of the file's entry counts beside that of its content, since programs can set the
    latter, e.g. where they copy a file over another one of its size.

    Args:
        folder: of the log.
        noise: a file of noises beside its own, on which the scenario depends; None = there is none.
    """
    resolved = os.path.realpath(folder)
    names = [NOTES, EPHEMERIS, NOISE, *(f"{table}{ending}" for table in TABLES for ending in (".csv", ".csv.gz"))]
    if noise is not None:
        names.append(os.path.abspath(noise))
    states = []
    for name in names:
        try:
            found = os.stat(os.path.join(resolved, name))
        except OSError:
            continue
        states.append((name, found.st_size, found.st_mtime_ns, found.st_ctime_ns, found.st_ino))
    return resolved, tuple(states)
