"""Alignment at rest: level from gravity, heading stated, magnetic or unknown (Groves 2013, sections 5.6.1, 5.6.2)."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.geodesy import position_difference
from spoofgym.logs.alignment.base import Alignment, levelled
from spoofgym.logs.alignment.headings import heading_at
from spoofgym.logs.log import Log, velocity_of
from spoofgym.logs.mounting import interval_means
from spoofgym.logs.table import seconds

METHOD = "static"
WINDOW = 2.0
"""Time over which a vehicle must rest, s."""
MOST_SPEED = (0.3, 0.6)
"""Of a vehicle at rest, by a velocity of small sigma and of a large one, m/s."""
SIGMAS = 4.0
"""So many sigmas of the velocity may a resting vehicle seem to move, in between."""
SPAN = 5.0
"""To either side of a fix, over which positions tell the speed where the receiver gives none, s."""
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
    """Whether the vehicle has been at rest since `WINDOW` before each fix, and is so at the next one, (n,)."""
    time = log.fixes.time
    velocity, sigma = _horizontal_velocity(log)
    slow = np.hypot(velocity[:, 0], velocity[:, 1]) <= np.clip(SIGMAS * sigma, *MOST_SPEED)
    rate = np.linalg.norm(interval_means(log.imu_time, log.angular_rate, time[:-1], time[1:]), axis=1)
    still = np.concatenate([[False], slow[1:] & slow[:-1] & (rate <= MOST_RATE)])  # since the fix before
    inside = (time >= max(log.start, log.imu_time[0]) + WINDOW) & (time <= log.imu_time[-1])
    began = np.searchsorted(time, time - WINDOW, side="right") - 1
    moved = np.concatenate([[0], np.cumsum(~still)])
    resting = inside & (began >= 0) & (moved[np.arange(len(time)) + 1] == moved[np.maximum(began, 0) + 1])
    resting[[0, -1]] = False
    resting[:-1] &= still[1:]
    return np.asarray(resting)


def _horizontal_velocity(log: Log) -> tuple[Floats, Floats]:
    """East and north, (n, 2), and the sigma per axis, (n,), m/s: the receiver's, or of positions some seconds apart."""
    fixes = log.fixes
    if fixes.velocity is not None:
        sigma = fixes.velocity_sigma
        stated = np.zeros(len(fixes.time)) if sigma is None else sigma[:, :2].max(axis=1)
        return fixes.velocity[:, :2], stated
    before = np.searchsorted(fixes.time, fixes.time - SPAN)
    after = np.searchsorted(fixes.time, fixes.time + SPAN, side="right") - 1
    spent = np.maximum(fixes.time[after] - fixes.time[before], 1e-9)
    track = position_difference(fixes.position, fixes.position[0])[:, :2]
    stated = np.zeros((len(fixes.time), 3)) if fixes.position_sigma is None else fixes.position_sigma
    return (track[after] - track[before]) / spent[:, None], np.sqrt(2.0) * stated[:, :2].max(axis=1) / spent
