"""Reading a recorded log: inertial samples, GNSS fixes and, where there is one, a reference solution.

A log is a folder in the project's format (docs/log-format.md): north-east-down, degrees, raw sensor axes. It is
converted here, at the door; everything behind works in east-north-up, right-forward-up and radians.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from spoofgym.arrays import Floats
from spoofgym.geodesy import displace, position_difference
from spoofgym.scenarios.mounting import find_delay, find_mounting
from spoofgym.scenarios.table import check_increasing, has_table, read_table, table_path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

IMU_COLUMNS = ("t_s", "gx_radps", "gy_radps", "gz_radps", "ax_mps2", "ay_mps2", "az_mps2")
POSITION_COLUMNS = ("t_s", "lat_deg", "lon_deg", "h_m")
VELOCITY_COLUMNS = ("vn_mps", "ve_mps", "vd_mps")
POSITION_SIGMA_COLUMNS = ("sd_n_m", "sd_e_m", "sd_d_m")
VELOCITY_SIGMA_COLUMNS = ("sd_vn_mps", "sd_ve_mps", "sd_vd_mps")

LIMITS = {"lat_deg": (-89.0, 89.0), "lon_deg": (-360.0, 360.0), "h_m": (-12_000.0, 100_000.0)} | {
    name: (0.0, math.inf) for name in POSITION_SIGMA_COLUMNS + VELOCITY_SIGMA_COLUMNS
}
"""Valid values, inclusive, of columns that have bounds."""
PLAUSIBLE_FORCE = (5.0, 20.0)
"""Median magnitude of a specific force that contains gravity and is in m/s²."""
ROTATION_TOLERANCE = 1e-3

_ENU_OF_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""East, north, up from north, east, down; and right, forward, up from forward, right, down."""


@dataclass(frozen=True, eq=False)
class Fixes:
    """Positions in time: a receiver's fixes, or a reference solution.

    Attributes:
        time: (n,), s, increasing.
        position: latitude rad, longitude rad, ellipsoidal height m, (n, 3).
        velocity: ENU, (n, 3), m/s; None = not in the log.
        position_sigma: ENU, (n, 3), m; None = not in the log.
        velocity_sigma: ENU, (n, 3), m/s; None = not in the log.
    """

    time: Floats
    position: Floats
    velocity: Floats | None
    position_sigma: Floats | None
    velocity_sigma: Floats | None


@dataclass(frozen=True, eq=False)
class Log:
    """A recorded drive or flight; all times on one clock.

    Attributes:
        name: of the log.
        folder: it was read from.
        start: first moment fit for alignment, s.
        imu_time: of the inertial samples, (n,), s, increasing, the IMU's delay subtracted.
        angular_rate: body R, F, U, (n, 3), rad/s.
        specific_force: the same, m/s².
        fixes: of the receiver, their delay, stated or found, subtracted.
        reference: solution to compare with; None = the log has none.
    """

    name: str
    folder: Path
    start: float
    imu_time: Floats
    angular_rate: Floats
    specific_force: Floats
    fixes: Fixes
    reference: Fixes | None


def velocity_of(fixes: Fixes) -> Floats:
    """The receiver's velocity, or central differences of its positions where it gives none, (n, 3), ENU, m/s."""
    if fixes.velocity is not None:
        return fixes.velocity
    track = position_difference(fixes.position, fixes.position[0])
    return np.asarray(np.gradient(track, fixes.time, axis=0))


def interpolate(solution: Fixes, time: Floats) -> tuple[Floats, Floats]:
    """A solution at other times, by the cubic that meets its positions and velocities.

    Args:
        solution: positions in time.
        time: inside its own times, (n,), s.

    Returns:
        Position (n, 3) latitude rad, longitude rad, height m, and velocity (n, 3) ENU, m/s.
    """
    origin = solution.position[0]
    spline = CubicHermiteSpline(solution.time, position_difference(solution.position, origin), velocity_of(solution))
    return displace(origin, spline(time)), spline(time, 1)


def read_log(folder: str | Path) -> Log:
    """Read and check a log.

    Where the mounting is unknown it is found from the whole drive, and the bias of the gyro at a standstill taken away;
    so is the delay of the fixes, unless the log states one.

    Args:
        folder: holds ``log.toml``, ``imu.csv``, ``gnss.csv`` and perhaps ``reference.csv``; tables may be gzipped
            (``.csv.gz``).

    Raises:
        ValueError: a file or column is missing, a value is not a finite number or out of range, time does not increase
            (each with file name, and line where there is one), IMU, fixes and ``start_s`` do not overlap, or an unknown
            mounting cannot be found.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ValueError(f"log {str(folder)!r} is no folder; a log is a folder with log.toml, imu.csv and gnss.csv")
    notes = _read_notes(folder / "log.toml")
    name = notes.get("name", folder.name)
    mounting = _mounting(folder / "log.toml", notes)
    start = _number(folder / "log.toml", notes, "start_s", None)

    path = table_path(folder, "imu")
    imu = read_table(path, [IMU_COLUMNS], [], LIMITS)
    check_increasing(path, imu["t_s"])
    rate = np.column_stack([imu[column] for column in IMU_COLUMNS[1:4]])
    force = np.column_stack([imu[column] for column in IMU_COLUMNS[4:]])
    magnitude = float(np.median(np.linalg.norm(force, axis=1)))
    if not PLAUSIBLE_FORCE[0] <= magnitude <= PLAUSIBLE_FORCE[1]:
        raise ValueError(
            f"{path}: the median specific force is {magnitude:.3g}; it must be in m/s² and contain gravity (about 9.8)"
        )
    log = Log(
        name=str(name),
        folder=folder,
        start=start,
        imu_time=imu["t_s"] - _number(folder / "log.toml", notes, "imu_delay_s", 0.0),
        angular_rate=rate,
        specific_force=force,
        fixes=_read_fixes(table_path(folder, "gnss"), _number(folder / "log.toml", notes, "gnss_delay_s", 0.0)),
        reference=_read_fixes(table_path(folder, "reference"), 0.0) if has_table(folder, "reference") else None,
    )
    _check_overlap(log)
    if mounting is not None:
        return _turned(log, mounting, np.zeros(3))
    if "gnss_delay_s" not in notes:
        delay = find_delay(*_motion(log))
        log = replace(log, fixes=replace(log.fixes, time=log.fixes.time - delay))
    found = find_mounting(*_motion(log))
    return _turned(log, found.rotation, found.gyro_bias)


def _motion(log: Log) -> tuple[str, Floats, Floats, Floats, Floats, Floats]:
    """What tells the mounting, from the log's start on."""
    owner, after = f"log {str(log.folder)!r}", log.fixes.time >= log.start
    fix_time, velocity = log.fixes.time[after], velocity_of(log.fixes)[after]
    return owner, log.imu_time, log.angular_rate, log.specific_force, fix_time, velocity


def _turned(log: Log, rotation: Floats, gyro_bias: Floats) -> Log:
    """The log with its samples turned from sensor axes to body right, forward, up."""
    return replace(
        log, angular_rate=(log.angular_rate - gyro_bias) @ rotation.T, specific_force=log.specific_force @ rotation.T
    )


def _check_overlap(log: Log) -> None:
    first = max(log.start, log.imu_time[0], log.fixes.time[0])
    last = min(log.imu_time[-1], log.fixes.time[-1])
    if first >= last:
        raise ValueError(
            f"log {str(log.folder)!r}: no overlap: IMU from {log.imu_time[0]:g} to {log.imu_time[-1]:g} s, fixes from "
            f"{log.fixes.time[0]:g} to {log.fixes.time[-1]:g} s, start_s {log.start:g} s"
        )
    if log.reference is not None and log.reference.time[0] > last:
        raise ValueError(
            f"log {str(log.folder)!r}: the reference begins at {log.reference.time[0]:g} s, after the log's end"
        )


def _read_notes(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise ValueError(f"{path} is missing")
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: not valid TOML: {error}") from None


def _number(path: Path, notes: dict[str, Any], key: str, default: float | None) -> float:
    value = notes.get(key, default)
    if value is None:
        raise ValueError(f"{path}: {key} is missing; it must be a finite number of seconds")
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError(f"{path}: {key} must be a finite number of seconds, got {value!r}")
    return float(value)


def _mounting(path: Path, notes: dict[str, Any]) -> Floats | None:
    """Rotation from sensor axes to body right, forward, up, (3, 3); None = unknown.

    Raises:
        ValueError: the key is missing, or its value is no rotation.
    """
    if "imu_to_body_frd" not in notes:
        raise ValueError(f"{path}: imu_to_body_frd is missing; where the mounting is unknown it must be [], empty")
    value = notes["imu_to_body_frd"]
    if value == []:
        return None
    message = (
        f"{path}: imu_to_body_frd must be a rotation, 3 rows of 3 numbers (body forward, right, down), got {value!r}"
    )
    try:
        matrix = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(message) from None
    if matrix.shape != (3, 3) or not np.all(np.isfinite(matrix)):
        raise ValueError(message)
    left, scale, right = np.linalg.svd(matrix)
    rotation: Floats = left @ right
    if np.any(np.abs(scale - 1.0) > ROTATION_TOLERANCE) or np.linalg.det(rotation) < 0.0:
        raise ValueError(message)
    return np.asarray(_ENU_OF_NED @ rotation)


def _read_fixes(path: Path, delay: float) -> Fixes:
    optional: list[tuple[str, ...]] = [VELOCITY_COLUMNS, POSITION_SIGMA_COLUMNS, VELOCITY_SIGMA_COLUMNS]
    table = read_table(path, [POSITION_COLUMNS], optional, LIMITS)
    check_increasing(path, table["t_s"])
    position = np.column_stack([np.radians(table["lat_deg"]), np.radians(table["lon_deg"]), table["h_m"]])

    def enu(columns: tuple[str, ...], matrix: Floats) -> Floats | None:
        if columns[0] not in table:
            return None
        return np.column_stack([table[column] for column in columns]) @ matrix.T

    return Fixes(
        time=table["t_s"] - delay,
        position=position,
        velocity=enu(VELOCITY_COLUMNS, _ENU_OF_NED),
        position_sigma=enu(POSITION_SIGMA_COLUMNS, np.abs(_ENU_OF_NED)),
        velocity_sigma=enu(VELOCITY_SIGMA_COLUMNS, np.abs(_ENU_OF_NED)),
    )
