"""What every importer makes of its source: tables of one clock, a mounting, remarks, and what was amiss."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from spoofgym.arrays import Floats

Columns = dict[str, Floats]
"""A table: columns of equal length by the names of docs/log-format.md, ``t_s`` among them."""

MOST_BYTES = 2**31
"""Largest source file that is read, bytes."""
MOST_ROWS = 10_000_000
"""Most rows of a table: as many lines as a table of a log may have."""
AXES: dict[str, tuple[tuple[int, int, int], ...]] = {
    "frd": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "flu": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    "rfu": ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
    "unknown": (),
}
"""Sensor axes by name (forward, right, down, ...) as ``imu_to_body_frd``; empty = found from the drive."""
C = 299_792_458.0
GPS_EPOCH_UNIX = 315_964_800
"""Unix time at which GPS time begins, s."""
WEEK = 604_800
LEAP_SECONDS = 18
"""GPS time less UTC since 2017, s."""


@dataclass(frozen=True)
class Options:
    """What a user may say of a source.

    Attributes:
        imu_topic: of a ROS bag; None = the only one there is.
        fix_topic: of a ROS bag; None = the only one there is.
    """

    imu_topic: str | None = None
    fix_topic: str | None = None


@dataclass(kw_only=True)
class Recording:
    """What an importer has read.

    Attributes:
        kind: of source, for people.
        clock: what the times are.
        tables: by the name of the file: ``imu``, ``gnss``, perhaps ``reference``, ``ranges``, ``ephemeris``, and what
            nothing of spoofgym reads: ``attitude``, ``barometer``, ``magnetometer``, ``wheels``, ``solution``.
        axes: of the inertial sensor, a key of `AXES`.
        settings: keys of ``log.toml`` that the source knows, such as ``gnss_delay_s``.
        remarks: text for ``log.toml`` by key.
        problems: what was amiss, a line each.
    """

    kind: str
    clock: str
    tables: dict[str, Columns] = field(default_factory=dict)
    axes: str = "unknown"
    settings: dict[str, float | list[float]] = field(default_factory=dict)
    remarks: dict[str, str] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)


def damaged(path: Path, offset: int, what: str) -> ValueError:
    """The error of a file that is not what its format says, at a byte."""
    return ValueError(f"{path}, offset {offset}: {what}")


def check_size(path: Path) -> int:
    """Bytes of a source file.

    Raises:
        ValueError: it is missing, empty or larger than `MOST_BYTES`.
    """
    if not path.is_file():
        raise ValueError(f"{path}: no such file")
    size = path.stat().st_size
    if not 0 < size <= MOST_BYTES:
        raise ValueError(f"{path}: has {size} bytes; valid are 1 to {MOST_BYTES}")
    return size


def read_bytes(path: Path) -> bytes:
    """A source file of at most `MOST_BYTES`."""
    check_size(path)
    return path.read_bytes()


def column(table: Mapping[str, object], *names: str) -> Floats | None:
    """The first of some columns that is there, as numbers; None = none is."""
    for name in names:
        if name in table:
            return np.asarray(table[name], dtype=np.float64)
    return None


def velocity_of_course(speed: Floats, course: Floats) -> tuple[Floats, Floats]:
    """North and east components, m/s.

    Args:
        speed: (n,), m/s.
        course: clockwise from north, (n,), degrees.
    """
    return speed * np.cos(np.radians(course)), speed * np.sin(np.radians(course))


def time_of_week(gps: Floats) -> Floats:
    """Seconds of the week in which the first time lies, so that they go on over its end.

    Args:
        gps: seconds since the beginning of GPS time, (n,).
    """
    return gps - WEEK * np.floor(gps[0] / WEEK) if len(gps) else gps


def euler_angles(quaternion: Floats) -> tuple[Floats, Floats, Floats]:
    """Roll, pitch and yaw of body (forward, right, down) against north, east, down, rad.

    Args:
        quaternion: (n, 4), scalar first, body to navigation frame.
    """
    w, x, y, z = quaternion.T
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    return roll, pitch, np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
