"""A log of an antenna that rests, without an IMU: the samples of a perfect one at rest are put in its place.

Who plays on it adds the errors of a stated grade, each run its own. That the IMU is simulated must be said wherever a
result is told.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from spoofgym.geodesy import earth_rate, normal_gravity
from spoofgym.logs.log import Fixes, Log
from spoofgym.logs.notes import Notes, StatedHeading
from spoofgym.logs.ranges_log import read_ranges
from spoofgym.logs.table import has_table, seconds

RATE = 50.0
"""Of the samples, Hz."""
HEADING = StatedHeading(0.0, np.radians(1.0))
"""Of the simulated IMU, where the log states none, and what a filter knows of it."""
MARGIN = 1.0
"""Samples begin so much before the ranges and end so much after them, s."""


def resting_log(folder: str | Path) -> Log:
    """Read a log of ranges without an IMU whose antenna rests at a stated place.

    Its body is level, with the heading that the log states. Its reference is the antenna's place; its fixes are, until
    those of the ranges take their place, too.

    Args:
        folder: holds ``log.toml`` with ``static = true`` and the antenna's place, ``ranges.csv`` and ``ephemeris.csv``.

    Raises:
        ValueError: the antenna moves, or is nowhere, or the log has an IMU of its own or no ranges.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ValueError(f"log {str(folder)!r} is no folder; a log is a folder with log.toml")
    notes, owner = Notes(folder / "log.toml"), f"log {str(folder)!r}: imu=simulated"
    antenna = notes.antenna()
    if has_table(folder, "imu"):
        raise ValueError(f"{owner} is for a log without imu.csv; this one has an IMU of its own")
    if antenna is None:
        raise ValueError(f"{owner} needs an antenna that rests: log.toml must state static = true and its place")
    if not has_table(folder, "ranges"):
        raise ValueError(f"{owner} needs ranges.csv and ephemeris.csv")
    notes.mounting()
    start, time = notes.seconds("start_s", None), read_ranges(folder).time
    if not time[0] - MARGIN <= start < time[-1]:
        raise ValueError(
            f"{owner}: start_s {seconds(start)} s lies outside the ranges, from {seconds(time[0])} to "
            f"{seconds(time[-1])} s"
        )
    samples = np.arange(time[0] - MARGIN, time[-1] + MARGIN, 1.0 / RATE)
    heading = notes.heading() or HEADING
    _, north, up = earth_rate(antenna[0])
    rate = np.array([-north * np.sin(heading.value), north * np.cos(heading.value), up])
    still = Fixes(time, np.tile(antenna, (len(time), 1)), np.zeros((len(time), 3)), None, None)
    return Log(
        name=notes.name(folder.name),
        folder=folder,
        start=start,
        imu_time=samples,
        angular_rate=np.tile(rate, (len(samples), 1)),
        specific_force=np.tile([0.0, 0.0, normal_gravity(antenna[0], antenna[2])], (len(samples), 1)),
        lever_arm=np.zeros(3),
        fixes=still,
        reference=still,
        heading=heading,
        attacked=notes.attacked(),
        effects=notes.effects(),
        antenna=antenna,
        ionosphere=notes.ionosphere(),
    )
