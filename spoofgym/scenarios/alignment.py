"""Initial position, velocity and attitude of a recorded log, from a moving vehicle.

Heading is the course over ground; roll and pitch follow from the mean specific force of a short window less the
acceleration that the fixes show over it (Groves 2013, sections 5.6.2 and 5.6.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.geodesy import normal_gravity
from spoofgym.navigation.mechanization import attitude_matrix
from spoofgym.scenarios.log import Log, velocity_of
from spoofgym.scenarios.table import seconds

MIN_SPEED = 5.0
"""Slowest speed whose course is trusted as heading, m/s."""
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
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    after = (fixes.time >= max(log.start, log.imu_time[0])) & (fixes.time <= log.imu_time[-1])
    inside = np.arange(len(speed))
    moving = np.flatnonzero(after & (speed >= MIN_SPEED) & (inside > 0) & (inside < len(speed) - 1))
    if len(moving) == 0:
        raise ValueError(
            f"log {str(log.folder)!r}: the vehicle must move at {MIN_SPEED:g} m/s or more after start_s = "
            f"{seconds(log.start)} s, so that its course gives the heading"
        )
    fix = int(moving[0])
    course = np.arctan2(velocity[fix, 0], velocity[fix, 1])
    window = (log.imu_time >= fixes.time[fix - 1]) & (log.imu_time <= fixes.time[fix + 1])
    if not window.any():
        raise ValueError(f"log {str(log.folder)!r}: no IMU samples around the alignment at {seconds(fixes.time[fix])} s")
    force = log.specific_force[window].mean(axis=0)
    acceleration = (velocity[fix + 1] - velocity[fix - 1]) / (fixes.time[fix + 1] - fixes.time[fix - 1])
    position = fixes.position[fix]
    attitude = _level(force, acceleration, float(course), normal_gravity(position[0], position[2]), log)
    return Alignment(fix, attitude, velocity[fix].copy(), position.copy())


def _level(force: Floats, acceleration: Floats, heading: float, gravity: float, log: Log) -> Floats:
    """The attitude of this heading that turns the specific force into acceleration plus gravity, by iteration."""
    attitude = attitude_matrix(0.0, 0.0, heading)
    for _ in range(ITERATIONS):
        up = force - attitude.T @ acceleration
        pitch = np.arctan2(up[1], np.hypot(up[0], up[2]))
        roll = np.arctan2(-up[0], up[2])
        attitude = attitude_matrix(pitch, roll, heading)
    if max(abs(pitch), abs(roll)) > MAX_TILT or abs(np.linalg.norm(up) - gravity) > 0.3 * gravity:
        raise ValueError(
            f"log {str(log.folder)!r}: at alignment roll is {np.degrees(roll):.0f}° and pitch "
            f"{np.degrees(pitch):.0f}°: imu_to_body_frd does not fit (at rest the down axis reads about -9.8 m/s²)"
        )
    return attitude
