"""Reading a recorded log: inertial samples, GNSS fixes and, where there is one, a reference solution.

A log is a folder in the project's format (docs/reference/log-format.md): north-east-down, degrees, raw sensor axes.
It is converted here, at the door; everything behind works in east-north-up, right-forward-up and radians.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.geodesy import displace, position_difference
from spoofgym.logs.fix_rows import known_sigmas, most_wild, usable_rows
from spoofgym.logs.mounting import find_delay, find_mounting
from spoofgym.logs.notes import ENU_OF_NED, Effects, Notes, StatedHeading
from spoofgym.logs.table import TIMES, check_increasing, has_table, read_table, seconds, table_path
from spoofgym.sensors.klobuchar import Klobuchar

IMU_COLUMNS = ("t_s", "gx_radps", "gy_radps", "gz_radps", "ax_mps2", "ay_mps2", "az_mps2")
POSITION_COLUMNS = ("t_s", "lat_deg", "lon_deg", "h_m")
VELOCITY_COLUMNS = ("vn_mps", "ve_mps", "vd_mps")
POSITION_SIGMA_COLUMNS = ("sd_n_m", "sd_e_m", "sd_d_m")
VELOCITY_SIGMA_COLUMNS = ("sd_vn_mps", "sd_ve_mps", "sd_vd_mps")
SIGMA_COLUMNS = (POSITION_SIGMA_COLUMNS, VELOCITY_SIGMA_COLUMNS)

LIMITS = {
    **{"t_s": TIMES},
    **{"lat_deg": (-89.0, 89.0), "lon_deg": (-360.0, 360.0), "h_m": (-12_000.0, 100_000.0)},
    **{name: (0.0, math.inf) for name in POSITION_SIGMA_COLUMNS + VELOCITY_SIGMA_COLUMNS},
    **{name: (-10_000.0, 10_000.0) for name in VELOCITY_COLUMNS + IMU_COLUMNS[4:]},
    **{name: (-1_000.0, 1_000.0) for name in IMU_COLUMNS[1:4]},
}
"""Valid values, inclusive, of columns that have bounds."""
BRIDGED = (1.0, 3.0)
"""Time between two epochs of a reference over which it is always, and never, interpolated, s."""
MOST_INTERVALS = 3.0
"""The longest time in between these two in usual intervals of the reference."""
PLAUSIBLE_FORCE = (5.0, 20.0)
"""Median magnitude of a specific force that contains gravity and is in m/s²."""


@dataclass(frozen=True, eq=False)
class Fixes:
    """Positions in time: a receiver's fixes, or a reference solution.

    Attributes:
        time: (n,), s, increasing.
        position: latitude rad, longitude rad, ellipsoidal height m, (n, 3).
        velocity: ENU, (n, 3), m/s; None = not in the log.
        position_sigma: ENU, (n, 3), m; None = not in the log.
        velocity_sigma: ENU, (n, 3), m/s; None = not in the log.
        lines: of the table that they were read from, (n,); None = they were not.
    """

    time: Floats
    position: Floats
    velocity: Floats | None
    position_sigma: Floats | None
    velocity_sigma: Floats | None
    lines: Runs | None = None

    def line(self, time: float) -> str:
        """Where the fix of a time stands in the log, for a message; empty = it does not."""
        place = int(np.searchsorted(self.time, time))
        if self.lines is None or place == len(self.time) or self.time[place] != time:
            return ""
        return f", line {self.lines[place]} of gnss.csv"


@dataclass(frozen=True, eq=False)
class Log:
    """A recorded drive or flight; all times on one clock.

    Attributes:
        name: of the log.
        folder: it was read from.
        start: first moment fit for alignment, s.
        imu_time: of the inertial samples, (n,), s, increasing, the IMU's delay subtracted.
        angular_rate: body R, F, U, (n, 3), rad/s.
        specific_force: body R, F, U, (n, 3), m/s².
        lever_arm: from the IMU to the antenna, body R, F, U, (3,), m.
        fixes: of the receiver, their delay, stated or found, subtracted.
        reference: solution to compare with; None = the log has none.
        rotation: from the axes of the IMU to body right, forward, up, (3, 3).
        imu_delay: that was subtracted, and belongs to every table on the IMU's clock, s.
        alignment: the method that the log states; None = it states none.
        heading: that the log states of its start; None = it states none.
        declination: of the magnetic field, east of true north, rad; None = not stated.
        fix_delay: that was subtracted from the times of the fixes, s.
        attacked: times of the first and the last spoofed fix, or range, in the table, s; None = not stated.
        effects: when the log's own tables are spoofed; None = not stated.
        antenna: where it rests, latitude rad, longitude rad, height m, (3,); None = it moves, or has an IMU.
        ionosphere: that was broadcast; None = not stated.
    """

    name: str
    folder: Path
    start: float
    imu_time: Floats
    angular_rate: Floats
    specific_force: Floats
    lever_arm: Floats
    fixes: Fixes
    reference: Fixes | None
    rotation: Floats = field(default_factory=lambda: np.eye(3))
    imu_delay: float = 0.0
    alignment: str | None = None
    heading: StatedHeading | None = None
    declination: float | None = None
    fix_delay: float = 0.0
    attacked: tuple[float, float] | None = None
    effects: Effects | None = None
    antenna: Floats | None = None
    ionosphere: Klobuchar | None = None


def velocity_of(fixes: Fixes) -> Floats:
    """The receiver's velocity, or central differences of its positions where it gives none, (n, 3), ENU, m/s."""
    if fixes.velocity is not None:
        return fixes.velocity
    track = position_difference(fixes.position, fixes.position[0])
    return np.asarray(np.gradient(track, fixes.time, axis=0))


def covered(solution: Fixes, time: Floats) -> Flags:
    """Whether a solution tells the position at times, (n,): they are its own, or lie between two that are near.

    Over T seconds with an acceleration of up to a, the cubic of `interpolate` errs by a T²/16 at most: 0.2 m in one
    second of a car that brakes and turns with 3 m/s², 1.7 m in three, 19 m in ten. So a hole is not bridged: what is
    longer than three usual intervals, as far as these are between 1 and 3 s.
    """
    widest = float(np.clip(MOST_INTERVALS * np.median(np.diff(solution.time)), *BRIDGED))
    after = np.clip(np.searchsorted(solution.time, time), 1, len(solution.time) - 1)
    before, following = solution.time[after - 1], solution.time[after]
    inside = (time >= before) & (time <= following) & (following - before <= widest)
    return np.asarray(inside | (time == before) | (time == following))


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


def step_means(time: Floats, samples: Floats, grid: Floats) -> Floats:
    """Means of straight lines between samples (n, 3) at their times over each step of a grid (k,), (k - 1, 3)."""
    at = np.column_stack([np.interp(grid, time, samples[:, a]) for a in range(3)])
    return np.asarray(0.5 * (at[1:] + at[:-1]))


@dataclass(frozen=True, eq=False)
class Tables:
    """The files of a log as they are: each value is in its limits and times increase, and nothing more is known.

    Attributes:
        folder: of the log.
        notes: its ``log.toml``.
        imu: columns of the inertial samples.
        gnss: columns of the fixes, rows that are no fix included.
        reference: columns of the reference; None = there is none.
    """

    folder: Path
    notes: Notes
    imu: dict[str, Floats]
    gnss: dict[str, Floats]
    reference: dict[str, Floats] | None


def read_log(folder: str | Path) -> Log:
    """Read a log.

    Where the mounting is unknown it is found from the whole drive, and the bias of the gyro at a standstill taken away;
    so is the delay of the fixes, unless the log states one.

    Args:
        folder: holds ``log.toml``, ``imu.csv``, ``gnss.csv`` and perhaps ``reference.csv``; tables may be gzipped
            (``.csv.gz``).

    Raises:
        ValueError: a file or column is missing or too large, ``log.toml`` has a key that is unknown, a value is not a
            finite number or out of range, time does not increase (each with file name, and line where there is one),
            IMU, fixes and ``start_s`` do not overlap, or an unknown mounting cannot be found.

    Warns:
        LogWarning: rows are left out because they are no fix, or a sigma is unknown.
    """
    return log_of(read_tables(folder))


def read_tables(folder: str | Path) -> Tables:
    """The files of a log; raises what `read_log` does of single values."""
    folder = Path(folder)
    if not folder.is_dir():
        raise ValueError(f"log {str(folder)!r} is no folder; a log is a folder with log.toml, imu.csv and gnss.csv")
    notes = Notes(folder / "log.toml")
    notes.mounting(), notes.seconds("start_s", None)
    if notes.antenna() is not None and not has_table(folder, "imu"):
        raise ValueError(
            f"log {str(folder)!r} has no imu.csv, and its antenna is static: recorded:{folder},imu=simulated:tactical "
            "simulates a resting IMU of that grade"
        )
    path = table_path(folder, "imu")
    imu = read_table(path, [IMU_COLUMNS], [], LIMITS)
    check_increasing(path, imu["t_s"])
    return Tables(
        folder=folder,
        notes=notes,
        imu=imu,
        gnss=read_table(table_path(folder, "gnss"), [POSITION_COLUMNS], [VELOCITY_COLUMNS, *SIGMA_COLUMNS], LIMITS),
        reference=_read_reference(folder),
    )


def log_of(tables: Tables) -> Log:
    """The log that files hold; raises and warns as `read_log`."""
    folder, notes, imu = tables.folder, tables.notes, tables.imu
    mounting, start = notes.mounting(), notes.seconds("start_s", None)
    delay = notes.seconds("gnss_delay_s", 0.0)
    path = table_path(folder, "imu")
    rate = np.column_stack([imu[column] for column in IMU_COLUMNS[1:4]])
    force = np.column_stack([imu[column] for column in IMU_COLUMNS[4:]])
    magnitude = float(np.median(np.linalg.norm(force, axis=1)))
    if not PLAUSIBLE_FORCE[0] <= magnitude <= PLAUSIBLE_FORCE[1]:
        raise ValueError(
            f"{path}: the median specific force is {magnitude:.3g}; it must be in m/s² and contain gravity (about 9.8)"
            f"{force_hint(magnitude)}"
        )
    log = Log(
        name=notes.name(folder.name),
        folder=folder,
        start=start,
        imu_time=imu["t_s"] - notes.seconds("imu_delay_s", 0.0),
        angular_rate=rate,
        specific_force=force,
        lever_arm=notes.lever_arm(),
        fixes=_usable_fixes(table_path(folder, "gnss"), tables.gnss, start, delay),
        reference=None if tables.reference is None else _usable_reference(folder, tables.reference, start),
        imu_delay=notes.seconds("imu_delay_s", 0.0),
        alignment=notes.alignment(),
        heading=notes.heading(),
        declination=notes.declination(),
        fix_delay=delay,
        attacked=notes.attacked(),
        effects=notes.effects(),
        ionosphere=notes.ionosphere(),
    )
    _check_overlap(log)
    if mounting is not None:
        return _turned(log, mounting, np.zeros(3))
    if "gnss_delay_s" not in notes:
        found_delay = find_delay(*_motion(log))
        log = replace(log, fixes=replace(log.fixes, time=log.fixes.time - found_delay), fix_delay=found_delay)
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
        log,
        angular_rate=(log.angular_rate - gyro_bias) @ rotation.T,
        specific_force=log.specific_force @ rotation.T,
        rotation=rotation,
    )


def _check_overlap(log: Log) -> None:
    first = max(log.start, log.imu_time[0], log.fixes.time[0])
    last = min(log.imu_time[-1], log.fixes.time[-1])
    if first >= last:
        raise ValueError(
            f"log {str(log.folder)!r}: no overlap: IMU from {seconds(log.imu_time[0])} to "
            f"{seconds(log.imu_time[-1])} s, fixes from {seconds(log.fixes.time[0])} to "
            f"{seconds(log.fixes.time[-1])} s, start_s {seconds(log.start)} s"
        )
    if log.reference is not None and log.reference.time[0] > last:
        raise ValueError(
            f"log {str(log.folder)!r}: the reference begins at {seconds(log.reference.time[0])} s, after the log's end"
        )


def force_hint(magnitude: float) -> str:
    """What a median specific force of this size may be in, for a message."""
    if abs(magnitude - 1.0) < 0.15:
        return "; it seems to be in g (multiply it by 9.80665), or gravity is taken away (a linear acceleration)"
    if abs(magnitude / 32.17 - 1.0) < 0.15:
        return "; it seems to be in ft/s² (multiply it by 0.3048)"
    if abs(magnitude / 1000.0 - 1.0) < 0.15:
        return "; it seems to be in cm/s² (multiply it by 0.01) or milli-g (by 0.0098067)"
    if magnitude < PLAUSIBLE_FORCE[0]:
        return "; gravity seems to be taken away (a linear acceleration): the sensor's own samples are needed"
    return ""


def _usable_fixes(path: Path, table: dict[str, Floats], start: float, delay: float) -> Fixes:
    rows, lines = usable_rows(path, table, start + delay)
    check_increasing(path, rows["t_s"], lines)
    return replace(as_fixes(known_sigmas(path, rows, lines, start + delay), delay), lines=lines)


def _read_reference(folder: Path) -> dict[str, Floats] | None:
    if not has_table(folder, "reference"):
        return None
    path = table_path(folder, "reference")
    return read_table(path, [POSITION_COLUMNS], [VELOCITY_COLUMNS, POSITION_SIGMA_COLUMNS], LIMITS)


def _usable_reference(folder: Path, table: dict[str, Floats], start: float) -> Fixes:
    """Its sigmas only tell which rows are no position."""
    path = table_path(folder, "reference")
    rows, lines = usable_rows(path, table, start, most_wild(table["t_s"]))
    check_increasing(path, rows["t_s"], lines)
    return replace(as_fixes(rows), position_sigma=None, lines=lines)


def as_fixes(rows: dict[str, Floats], delay: float = 0.0) -> Fixes:
    """Columns of a table of positions in the units and axes behind the door, whatever they are worth.

    Args:
        rows: columns by their names.
        delay: subtracted from the times, s.
    """
    def enu(columns: tuple[str, ...], matrix: Floats) -> Floats | None:
        if columns[0] not in rows:
            return None
        return np.column_stack([rows[column] for column in columns]) @ matrix.T

    return Fixes(
        time=rows["t_s"] - delay,
        position=np.column_stack([np.radians(rows["lat_deg"]), np.radians(rows["lon_deg"]), rows["h_m"]]),
        velocity=enu(VELOCITY_COLUMNS, ENU_OF_NED),
        position_sigma=enu(POSITION_SIGMA_COLUMNS, np.abs(ENU_OF_NED)),
        velocity_sigma=enu(VELOCITY_SIGMA_COLUMNS, np.abs(ENU_OF_NED)),
    )
