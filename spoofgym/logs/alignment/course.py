"""Alignment by course: the vehicle drives forward, so its heading is its course over ground (Groves 2013, 5.6.3)."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.alignment.base import Alignment, levelled
from spoofgym.logs.fix_rows import DEFAULT_SIGMA, UNKNOWN_SIGMA
from spoofgym.logs.log import Fixes, Log, velocity_of
from spoofgym.logs.mounting import interval_means
from spoofgym.logs.table import seconds

MIN_SPEED = 5.0
"""Slowest speed whose course is trusted as heading, whatever the receiver, m/s."""
MAX_COURSE_SIGMA = np.radians(3.5)
"""Largest 1 sigma of a course that is trusted at a lower speed, rad: that of `MIN_SPEED` with 0.3 m/s."""
LEAST_SPEED = 0.5
"""Slowest speed of a vehicle that counts as driving forward, m/s."""
METHOD = "course"
SIGMA = (np.radians(5.0), np.radians(5.0), np.radians(10.0))
"""Of the attitude (E, N, U), rad: course against heading, and a mounting known to some degrees."""
MAX_TURN = np.radians(60.0)
"""Largest turn between the fix before the alignment and the one after, rad: mean force and mean acceleration are
compared over that time, as if the vehicle had one attitude."""


def by_course(log: Log, least_speed: float | None = None) -> Alignment:
    """Align at the first fix from the log's start on at which the vehicle moves.

    Args:
        log: of a vehicle that drives forward.
        least_speed: whose course is trusted, m/s; None = `MIN_SPEED`, or what the accuracy of the velocity allows.

    Raises:
        ValueError: it never moves fast enough, or the specific force does not point up.
    """
    velocity = velocity_of(log.fixes)
    fix = _first_moving(log, velocity, least_speed)
    course = float(np.arctan2(velocity[fix, 0], velocity[fix, 1]))
    return Alignment(METHOD, fix, levelled(log, fix, course), velocity[fix].copy(), np.array(SIGMA))


def _first_moving(log: Log, velocity: Floats, least_speed: float | None) -> int:
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
    trusted = MIN_SPEED if least_speed is None else least_speed
    moving = np.flatnonzero(fits & (speed >= trusted))
    if len(moving) == 0 and least_speed is None:
        moving = np.flatnonzero(fits & (speed >= least))
    if len(moving) == 0:
        raise ValueError(
            f"log {str(log.folder)!r}: the vehicle must move at {trusted:g} m/s or more after start_s = "
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
