"""Tables of a log that hold neither inertial samples nor GNSS: barometer, magnetometer and wheels."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.log import Log
from spoofgym.logs.magnetometer import read_magnetometer
from spoofgym.logs.table import TIMES, check_increasing, has_table, read_table, table_path

AUX = "aux"
"""A table of several sensors at once."""
HEIGHTS = (("baro_m",), ("pressure_pa",), ("pressure_hpa",))
FIELD = ("mag_x", "mag_y", "mag_z")
"""In the axes of the IMU; only its direction counts."""
SPEEDS = (
    ("rear_left_mps", "rear_right_mps"),
    ("speed_mps",),
    ("front_left_mps", "front_right_mps"),
    ("distance_0_m", "distance_1_m"),
    ("distance_m",),
)
"""Wheels in the order of preference: those that do not steer, the vehicle's speed, those that do, ways."""
SEA_LEVEL, SCALE, EXPONENT = 101_325.0, 44_330.77, 0.190263
"""Standard atmosphere (ICAO), Pa, m and 1: height = 44330.77 (1 - (p / 101325)^0.190263)."""


@dataclass(frozen=True, eq=False)
class TimedReadings:
    """What a sensor read.

    Attributes:
        time: on the clock of the log, the IMU's delay subtracted, (n,), s, increasing.
        value: (n, q).
    """

    time: Floats
    value: Floats


def heights(log: Log) -> TimedReadings:
    """Heights by the barometer, (n, 1), m, up to an unknown offset; by the standard atmosphere where it gives pressure.

    Raises:
        ValueError: the log has no barometer, or a table is damaged.
    """
    path, columns = _columns(log, "barometer", HEIGHTS, "a barometer")
    if "baro_m" in columns:
        height = columns["baro_m"]
    else:
        pressure = columns["pressure_pa"] if "pressure_pa" in columns else 100.0 * columns["pressure_hpa"]
        if not np.all(pressure > 0.0):
            raise ValueError(f"{path}: a pressure must be greater than 0, got {float(pressure.min()):g}")
        height = SCALE * (1.0 - (pressure / SEA_LEVEL) ** EXPONENT)
    return TimedReadings(columns["t_s"] - log.imu_delay, height[:, None])


def fields(log: Log) -> TimedReadings:
    """The magnetic field in body axes right, forward, up, (n, 3), in the unit of the table.

    Raises:
        ValueError: the log has no magnetometer, or a table is damaged.
    """
    found = read_magnetometer(log.folder, log.rotation)
    if found is not None:
        return TimedReadings(found.time - log.imu_delay, found.body)
    _, columns = _columns(log, "magnetometer", (FIELD,), "a magnetometer")
    field = np.column_stack([columns[name] for name in FIELD])
    return TimedReadings(columns["t_s"] - log.imu_delay, field @ log.rotation.T)


def speeds(log: Log) -> TimedReadings:
    """The forward speed by the wheels, (n, 1), m/s: the mean of an axle, or how the ways travelled grow.

    Raises:
        ValueError: the log has no wheels, none whose columns are known, or a table is damaged.
    """
    _path, columns = _columns(log, "wheels", SPEEDS, "wheel speeds")
    names = next(group for group in SPEEDS if group[0] in columns)
    speed, time = np.mean([columns[name] for name in names], axis=0), columns["t_s"]
    if names[0].startswith("distance"):
        speed = np.gradient(speed, time)
    return TimedReadings(time - log.imu_delay, speed[:, None])


def _columns(log: Log, table: str, groups: tuple[tuple[str, ...], ...], what: str) -> tuple[Path, dict[str, Floats]]:
    """The columns of the first table that has a group of them, and its path."""
    seen = [name for name in (table, AUX) if has_table(log.folder, name)]
    for name in seen:
        path = table_path(log.folder, name)
        columns = read_table(path, [("t_s",)], list(groups), {"t_s": TIMES})
        if any(group[0] in columns for group in groups):
            check_increasing(path, columns["t_s"])
            return path, columns
    wanted = " or ".join(", ".join(group) for group in groups)
    missing = f"{table}.csv or {AUX}.csv (or .csv.gz)"
    where = f"{', '.join(f'{name}.csv' for name in seen)} has no column of it" if seen else f"there is no {missing}"
    raise ValueError(f"log {str(log.folder)!r} does not hold {what}: {where}; needed: t_s and {wanted}")
