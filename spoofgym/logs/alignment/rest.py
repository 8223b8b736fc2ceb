"""Alignment at rest: level from gravity, heading stated, magnetic or unknown (Groves 2013, sections 5.6.1 and 5.6.2)."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.logs.alignment.base import Alignment, levelled
from spoofgym.logs.alignment.headings import heading_at
from spoofgym.logs.fix_rows import DEFAULT_SIGMA
from spoofgym.logs.log import Log, velocity_of
from spoofgym.logs.mounting import interval_means
from spoofgym.logs.table import seconds

METHOD = "static"
WINDOW = 2.0
"""Time over which a vehicle must rest, s."""
MOST_SPEED = 0.3
"""Of a vehicle at rest, by a velocity of small sigma, m/s."""
SIGMAS = 4.0
"""So many sigmas of the velocity may a resting vehicle seem to move."""
MOST_RATE = np.radians(3.0)
"""Mean angular rate at rest, rad/s: the bias of a small gyro."""
LEVEL_SIGMA = np.radians(2.0)
"""Of pitch and roll, rad: a bias of 0.3 m/s²."""


def at_rest(log: Log) -> Alignment:
    """Align at the first fix from the log's start on at which the vehicle has been at rest for a while.

    Raises:
        ValueError: it never rests, or the specific force does not point up.
    """
    resting = resting_fixes(log)
    if not resting.any():
        raise ValueError(
            f"log {str(log.folder)!r}: alignment static: the vehicle is never at rest for {WINDOW:g} s after start_s = "
            f"{seconds(log.start)} s"
        )
    fix = int(np.flatnonzero(resting)[0])
    return without_motion(log, fix, METHOD)


def without_motion(log: Log, fix: int, method: str) -> Alignment:
    """The alignment at a fix whose heading does not come from motion; raises as `levelled`."""
    up = levelled(log, fix, 0.0)[2]
    heading = heading_at(log, float(log.fixes.time[fix]), up)
    sigma = np.array([LEVEL_SIGMA, LEVEL_SIGMA, heading.sigma])
    velocity = np.zeros(3) if method == METHOD else velocity_of(log.fixes)[fix].copy()
    return Alignment(method, fix, levelled(log, fix, heading.value), velocity, sigma, heading.source)


def resting_fixes(log: Log) -> Flags:
    """Whether the vehicle has been at rest since `WINDOW` before each fix, and is so at the next one, (n,).

    Fixes whose velocity is not known well enough to tell do not count.
    """
    fixes = log.fixes
    time, velocity = fixes.time, velocity_of(fixes)
    sigma = _speed_sigma(log)
    slow = np.hypot(velocity[:, 0], velocity[:, 1]) <= np.maximum(MOST_SPEED, SIGMAS * sigma)
    rate = np.linalg.norm(interval_means(log.imu_time, log.angular_rate, time[:-1], time[1:]), axis=1)
    still = np.concatenate([[False], slow[1:] & slow[:-1] & (rate <= MOST_RATE)])  # since the fix before
    inside = (time >= max(log.start, log.imu_time[0]) + WINDOW) & (time <= log.imu_time[-1])
    began = np.searchsorted(time, time - WINDOW, side="right") - 1
    moved = np.concatenate([[0], np.cumsum(~still)])
    resting = inside & (began >= 0) & (moved[np.arange(len(time)) + 1] == moved[np.maximum(began, 0) + 1])
    resting[[0, -1]] = False
    resting[:-1] &= still[1:]
    return np.asarray(resting)


def _speed_sigma(log: Log) -> Floats:
    """Of the horizontal velocity per axis, as stated or as differences of positions have it, (n,), m/s."""
    fixes = log.fixes
    if fixes.velocity_sigma is not None:
        return np.asarray(fixes.velocity_sigma[:, :2].max(axis=1))
    if fixes.velocity is not None or fixes.position_sigma is None:
        return np.full(len(fixes.time), max(DEFAULT_SIGMA[3:5]))
    return np.asarray(np.sqrt(0.5) * fixes.position_sigma[:, :2].max(axis=1) / np.gradient(fixes.time))
