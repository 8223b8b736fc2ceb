"""Initial position, velocity and attitude of a recorded log, from a moving vehicle.

Heading is the course over ground; roll and pitch follow from the mean specific force of a short window less the
acceleration that the fixes show over it (Groves 2013, sections 5.6.2 and 5.6.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.geodesy import displace, normal_gravity
from spoofgym.logs.fix_rows import DEFAULT_SIGMA, UNKNOWN_SIGMA
from spoofgym.logs.log import Fixes, Log, velocity_of
from spoofgym.logs.mounting import interval_means
from spoofgym.logs.table import seconds
from spoofgym.mechanization import attitude_matrix

MIN_SPEED = 5.0
"""Slowest speed whose course is trusted as heading, whatever the receiver, m/s."""
MAX_COURSE_SIGMA = np.radians(3.5)
"""Largest 1 sigma of a course that is trusted at a lower speed, rad: that of `MIN_SPEED` with 0.3 m/s."""
LEAST_SPEED = 0.5
"""Slowest speed of a vehicle that counts as driving forward, m/s."""
MAX_TURN = np.radians(60.0)
"""Largest turn between the fix before the alignment and the one after, rad: mean force and mean acceleration are
compared over that time, as if the vehicle had one attitude."""
MAX_TILT = np.radians(60.0)
"""A steeper roll or pitch means a wrong mounting, rad."""
ITERATIONS = 10


@dataclass(frozen=True, eq=False)
class Alignment:
    """Where the filter starts.

    Attributes:
        fix: index of the fix it starts from.
        attitude: body R, F, U to ENU, (3, 3).
        velocity: ENU, (3,), m/s.
        position: latitude rad, longitude rad, height m, (3,).
    """

    fix: int
    attitude: Floats
    velocity: Floats
    position: Floats


def align(log: Log) -> Alignment:
    """Align at the first fix from the log's start on at which the vehicle moves.

    Raises:
        ValueError: it never moves fast enough, or the specific force does not point up.
    """
    fixes, velocity = log.fixes, velocity_of(log.fixes)
    fix = _first_moving(log, velocity)
    time = float(fixes.time[fix])
    course = np.arctan2(velocity[fix, 0], velocity[fix, 1])
    window = (log.imu_time >= fixes.time[fix - 1]) & (log.imu_time <= fixes.time[fix + 1])
    if not window.any():
        raise ValueError(f"log {str(log.folder)!r}: no IMU samples around the alignment at {seconds(time)} s")
    force = log.specific_force[window].mean(axis=0)
    acceleration = (velocity[fix + 1] - velocity[fix - 1]) / (fixes.time[fix + 1] - fixes.time[fix - 1])
    antenna = fixes.position[fix]
    where = f"log {str(log.folder)!r}: at the alignment at {seconds(time)} s{fixes.line(time)},"
    attitude = _level(force, acceleration, float(course), normal_gravity(antenna[0], antenna[2]), where)
    return Alignment(fix, attitude, velocity[fix].copy(), displace(antenna, -attitude @ log.lever_arm))


def _first_moving(log: Log, velocity: Floats) -> int:
    """The first fix from the log's start on whose course is trusted, and around which the vehicle hardly turns.

    Where the vehicle never moves at `MIN_SPEED`, the accuracy of the velocity decides.
    """
    fixes, speed = log.fixes, np.hypot(velocity[:, 0], velocity[:, 1])
    fits = (fixes.time >= max(log.start, log.imu_time[0])) & (fixes.time <= log.imu_time[-1])
    around = np.full(len(speed), np.inf)
    around[1:-1] = fixes.time[2:] - fixes.time[:-2]
    rate = interval_means(log.imu_time, log.angular_rate, fixes.time[:-2], fixes.time[2:])
    fits[1:-1] &= np.linalg.norm(rate, axis=1) * around[1:-1] <= MAX_TURN
    fits[[0, -1]] = False
    sigma = _velocity_sigma(fixes, around)
    fits &= sigma < UNKNOWN_SIGMA
    least = np.maximum(sigma / MAX_COURSE_SIGMA, LEAST_SPEED)
    moving = np.flatnonzero(fits & (speed >= MIN_SPEED))
    if len(moving) == 0:
        moving = np.flatnonzero(fits & (speed >= least))
    if len(moving) == 0:
        raise ValueError(
            f"log {str(log.folder)!r}: the vehicle must move at {MIN_SPEED:g} m/s or more after start_s = "
            f"{seconds(log.start)} s, so that its course gives the heading; {1.0 / MAX_COURSE_SIGMA:.0f} times the "
            f"sigma of its velocity is enough, {np.min(least, where=fits, initial=MIN_SPEED):.2g} m/s here; it reaches "
            f"{np.max(speed, where=fits, initial=0.0):.2g} m/s"
        )
    return int(moving[0])


def _velocity_sigma(fixes: Fixes, around: Floats) -> Floats:
    """Of the horizontal velocity per axis, (n,), m/s.

    Args:
        fixes: of the log.
        around: time from the fix before each to the one after, (n,), s.
    """
    sigma = np.full(len(fixes.time), max(DEFAULT_SIGMA[3:5]))
    if fixes.velocity_sigma is not None:
        return np.asarray(fixes.velocity_sigma[:, :2].max(axis=1))
    if fixes.position_sigma is not None:
        # differences of positions, or a receiver's velocity that states none: presumably as good as these
        sigma = np.minimum(sigma, np.sqrt(2.0) * fixes.position_sigma[:, :2].max(axis=1) / around)
    return sigma


def _level(force: Floats, acceleration: Floats, heading: float, gravity: float, where: str) -> Floats:
    """The attitude of this heading that turns the specific force into acceleration plus gravity.

    Raises:
        ValueError: there is none that is upright; either the fixes are to blame, or the mounting.
    """
    attitude, fits = _upright(force, acceleration, heading, gravity)
    if fits:
        return attitude
    if _upright(force, np.zeros(3), heading, gravity)[1]:
        raise ValueError(
            f"{where} the fixes show an acceleration of {np.linalg.norm(acceleration):.3g} m/s², which the specific "
            "force does not: fixes, or the ranges and range rates that they are made from, are wrong there, or on "
            "another clock than the IMU; a later start_s begins after it"
        )
    up = attitude[2]
    raise ValueError(
        f"{where} roll is {np.degrees(np.arctan2(-up[0], up[2])):.0f}° and pitch {np.degrees(np.arcsin(up[1])):.0f}°: "
        "imu_to_body_frd does not fit (at rest the down axis reads about -9.8 m/s²)"
    )


def _upright(force: Floats, acceleration: Floats, heading: float, gravity: float) -> tuple[Floats, bool]:
    """The attitude, found by iteration, and whether it and the size of the force are plausible."""
    attitude = attitude_matrix(0.0, 0.0, heading)
    for _ in range(ITERATIONS):
        up = force - attitude.T @ acceleration
        pitch = np.arctan2(up[1], np.hypot(up[0], up[2]))
        roll = np.arctan2(-up[0], up[2])
        attitude = attitude_matrix(pitch, roll, heading)
    size = abs(np.linalg.norm(up) - gravity) <= 0.3 * gravity
    return attitude, bool(max(abs(pitch), abs(roll)) <= MAX_TILT and size)
