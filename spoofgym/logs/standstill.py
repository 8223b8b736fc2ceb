"""When a vehicle stands still, by its inertial samples alone: GNSS must not tell, since it may be spoofed."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.logs.log import Log

WINDOW = 1.0
"""Time over which the samples must be quiet, s."""
QUIET_RATE = np.radians(0.3)
"""Largest standard deviation of the angular rate per axis over a window, rad/s."""
QUIET_FORCE = 0.08
"""Largest standard deviation of the specific force per axis over a window, m/s²."""
MOST_TURN = np.radians(3.0)
"""Largest mean angular rate per axis, rad/s: the bias of a small gyro."""


def standing_times(log: Log) -> Floats:
    """Ends of the windows throughout which the samples were quiet, (n,), s: at each sample that ends one.

    A vehicle that glides along a smooth road as quietly passes for one that stands; the gate of the aid is for that.
    """
    time = log.imu_time
    began = np.searchsorted(time, time - WINDOW)
    quiet = time - WINDOW >= time[0]
    for axis in log.angular_rate.T:
        mean, deviation = _moments(axis, began)
        quiet &= (deviation <= QUIET_RATE) & (np.abs(mean) <= MOST_TURN)
    for axis in log.specific_force.T:
        quiet &= _moments(axis - axis.mean(), began)[1] <= QUIET_FORCE
    return np.asarray(time[quiet])


def _moments(axis: Floats, began: Runs) -> tuple[Floats, Floats]:
    """Mean and standard deviation of the samples began[i]..i, (n,) each."""
    ends = np.arange(len(axis)) + 1
    count = ends - began
    first, second = (np.concatenate([[0.0], np.cumsum(power)]) for power in (axis, axis**2))
    mean = (first[ends] - first[began]) / count
    return mean, np.sqrt(np.maximum((second[ends] - second[began]) / count - mean**2, 0.0))
