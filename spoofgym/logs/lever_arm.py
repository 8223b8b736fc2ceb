"""An antenna that does not sit at the IMU: what the fixes of a log say of the IMU's velocity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.log import Log
from spoofgym.logs.mounting import interval_means

HALF = 0.05
"""Time to either side of a fix over which the angular rate is averaged, s."""


def with_velocity_at_imu(log: Log) -> Log:
    """The log with C (ω x l) taken off the velocities of its fixes, which are the antenna's.

    The attitude is that of a level vehicle that looks where it drives. With an arm of 3 m, 0.3 rad/s and 5 degrees of
    roll, pitch or drift angle that is right to 8 cm/s. Positions need no such step: the filter knows its attitude.
    """
    if log.fixes.velocity is None or not log.lever_arm.any():
        return log
    time, velocity = log.fixes.time, log.fixes.velocity
    rate = interval_means(log.imu_time, log.angular_rate, time - HALF, time + HALF)
    body = np.cross(rate, log.lever_arm)
    corrected = velocity
    for _ in range(2):  # the antenna's own course is off by what is looked for
        corrected = velocity - _level(body, corrected)
    return replace(log, fixes=replace(log.fixes, velocity=corrected))


def _level(body: Floats, velocity: Floats) -> Floats:
    """Vectors in right, forward, up of a level vehicle that drives along a velocity, in ENU, (n, 3)."""
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    moving = speed > 0.0
    forward = np.where(moving[:, None], velocity[:, :2], [0.0, 1.0]) / np.where(moving, speed, 1.0)[:, None]
    right = np.column_stack([forward[:, 1], -forward[:, 0]])
    return np.column_stack([body[:, :1] * right + body[:, 1:2] * forward, body[:, 2]])
