"""An alignment, and what all of them share: level from the specific force less the acceleration of the fixes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.geodesy import displace, normal_gravity
from spoofgym.logs.log import Log, velocity_of
from spoofgym.logs.table import seconds
from spoofgym.mechanization import attitude_matrix

MAX_TILT = np.radians(60.0)
"""A steeper roll or pitch means a wrong mounting, rad."""
ITERATIONS = 10


@dataclass(frozen=True, eq=False)
class Alignment:
    """Where the filter starts.

    Attributes:
        method: that found it: static, attitude, course, coarse; heading where that is stated, hover where it is not.
        fix: index of the fix it starts from.
        attitude: body R, F, U to ENU, (3, 3).
        velocity: ENU, (3,), m/s.
        attitude_sigma: 1 sigma of its errors about E, N, U, (3,), rad.
        source: where the heading is from, for a reader; empty = the method says it.
    """

    method: str
    fix: int
    attitude: Floats
    velocity: Floats
    attitude_sigma: Floats
    source: str = ""

    def position(self, log: Log) -> Floats:
        """Of the IMU: that of the fix, less the lever arm; latitude rad, longitude rad, height m, (3,)."""
        return displace(log.fixes.position[self.fix], -self.attitude @ log.lever_arm)

    @property
    def heading(self) -> float:
        """Clockwise from north, rad, from 0 to 2π."""
        return float(np.arctan2(self.attitude[0, 1], self.attitude[1, 1]) % (2.0 * np.pi))

    def told(self, log: Log) -> str:
        """A line about it."""
        up, sigma = self.attitude[2], np.degrees(self.attitude_sigma)
        source = f" ({self.source})" if self.source else ""
        return (
            f"alignment: {self.method}{source}, at {seconds(log.fixes.time[self.fix])} s; heading "
            f"{np.degrees(self.heading):.0f}° ± {sigma[2]:.2g}°, pitch {np.degrees(np.arcsin(up[1])):.0f}°, roll "
            f"{np.degrees(np.arctan2(-up[0], up[2])):.0f}°"
        )


def levelled(log: Log, fix: int, heading: float) -> Floats:
    """The attitude at a fix that is neither the first nor the last, whose heading is known, (3, 3).

    Roll and pitch follow from the mean specific force between the fixes around it, less the acceleration that they show
    (Groves 2013, section 5.6.2).

    Args:
        log: with body axes.
        fix: its index.
        heading: clockwise from north, rad.

    Raises:
        ValueError: there are no inertial samples, or the specific force does not point up.
    """
    fixes, velocity = log.fixes, velocity_of(log.fixes)
    time = float(fixes.time[fix])
    window = (log.imu_time >= fixes.time[fix - 1]) & (log.imu_time <= fixes.time[fix + 1])
    if not window.any():
        raise ValueError(f"log {str(log.folder)!r}: no IMU samples around the alignment at {seconds(time)} s")
    force = log.specific_force[window].mean(axis=0)
    acceleration = (velocity[fix + 1] - velocity[fix - 1]) / (fixes.time[fix + 1] - fixes.time[fix - 1])
    where = f"log {str(log.folder)!r}: at the alignment at {seconds(time)} s{fixes.line(time)},"
    gravity = normal_gravity(fixes.position[fix, 0], fixes.position[fix, 2])
    return _level(force, acceleration, heading, gravity, where)


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
