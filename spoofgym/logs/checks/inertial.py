"""Inertial samples by themselves: times, gravity, standstill, holes, and a sensor that has stopped."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.checks.finding import Finding
from spoofgym.logs.checks.times import SLOWEST_FIXES
from spoofgym.logs.log import Log, velocity_of
from spoofgym.logs.table import seconds

SLOWEST_RATE = 0.5
"""Longest usual time between samples that can be one, s."""
MUCH_LONGER = 30.0
"""Times the fixes' time, which samples in seconds do not last; those in milliseconds last a thousand times as long."""
HOLE = 0.5
"""Time without samples that no game may hold, s."""
STILL = 0.3
"""Speed of the fixes below which a vehicle may stand, m/s."""
LARGEST_BIAS = np.radians(2.0)
"""Angular rate at a standstill that is told, rad/s."""
GRAVITY = (9.3, 10.3)
"""Median magnitude of the specific force that is not told, m/s²."""
REPEATED = 0.5
"""Time for which samples may repeat while the vehicle moves, s."""
MOVING = 2.0
"""Speed of a vehicle that moves, m/s."""


def check_sample_times(time: Floats, fixes: Floats) -> Iterator[Finding]:
    """Whether the times of samples, (n,), can be seconds.

    Few samples that last as long as fixes, (k,), whose times are seconds, are in seconds, too, and come too seldom.
    """
    step = float(np.median(np.diff(time)))
    if step <= SLOWEST_RATE:
        return
    in_seconds = float(np.median(np.diff(fixes))) <= SLOWEST_FIXES and np.ptp(time) <= MUCH_LONGER * np.ptp(fixes)
    for unit, factor in (("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9)):
        if 5e-4 < step / factor < 0.11 and not in_seconds:
            advice = f"divide t_s by {factor:g}"
            yield Finding("error", "imu.csv", f"t_s is in {unit}: a sample comes each {step:g} s", advice, 1)
            return
    text = f"a sample comes each {step:.3g} s, too seldom to navigate by"
    yield Finding("error", "imu.csv", text, "an IMU has 20 to 1000 samples a second", 1)


def check_inertial(log: Log) -> Iterator[Finding]:
    """Findings about the inertial samples of a log, in body axes, from its start on."""
    after = log.imu_time >= log.start
    time, rate, force = log.imu_time[after], log.angular_rate[after], log.specific_force[after]
    if len(time) < 10:
        return
    yield from _check_gravity(force)
    yield from _check_holes(time)
    speed = _speed(log, time)
    if log.fixes.velocity is not None:
        yield from _check_standstill(rate, speed)
    yield from _check_repeated(log, time, np.hstack([rate, force]), speed)


def _speed(log: Log, time: Floats) -> Floats:
    """Of the fixes, at the times of samples, (n,), m/s."""
    velocity = velocity_of(log.fixes)
    return np.interp(time, log.fixes.time, np.hypot(velocity[:, 0], velocity[:, 1]))


def _check_gravity(force: Floats) -> Iterator[Finding]:
    mean = np.median(force, axis=0)
    if mean[2] < -5.0:
        yield Finding(
            "error",
            "imu.csv",
            f"the specific force points down: {mean[2]:.1f} m/s² upwards",
            "at rest it is 9.8 m/s² upwards, as it holds the vehicle: multiply ax_mps2, ay_mps2 and az_mps2 by -1, or "
            "turn imu_to_body_frd by 180 degrees",
            1,
        )
    magnitude = float(np.median(np.linalg.norm(force, axis=1)))
    if not GRAVITY[0] <= magnitude <= GRAVITY[1]:
        text = f"the median specific force is {magnitude:.3g} m/s², where gravity is 9.8"
        yield Finding("warning", "imu.csv", text, "scale, vibration or a bias of the accelerometer", 1)


def _check_holes(time: Floats) -> Iterator[Finding]:
    step = np.diff(time)
    holes = np.flatnonzero(step > HOLE)
    if len(holes):
        longest = holes[np.argmax(step[holes])]
        yield Finding(
            "note",  # a game that meets one is refused
            "imu.csv",
            f"{len(holes)} holes of more than {HOLE:g} s; the longest is {step[longest]:.3g} s at "
            f"{seconds(time[longest])} s",
            "a game must lie between them: start_s, onset= and horizon= choose its time",
        )


def _check_standstill(rate: Floats, speed: Floats) -> Iterator[Finding]:
    """Only a receiver's own velocity tells that a vehicle stands: differences of positions are small by chance, too."""
    still = speed < STILL
    if np.count_nonzero(still) < 100:
        return
    bias = np.abs(np.median(rate[still], axis=0))
    if bias.max() > LARGEST_BIAS:
        yield Finding(
            "warning",
            "imu.csv",
            f"the vehicle stands and the angular rate is {np.degrees(bias.max()):.2g} degrees per second",
            "subtract the median at a standstill from each axis, or look at the unit (rad/s)",
            1,
        )


def _check_repeated(log: Log, time: Floats, samples: Floats, speed: Floats) -> Iterator[Finding]:
    """A sensor that repeats its last sample for long while the vehicle moves."""
    same = np.concatenate([[False], (np.diff(samples, axis=0) == 0.0).all(axis=1)])
    starts = np.flatnonzero(~same)
    ends = np.concatenate([starts[1:], [len(time)]]) - 1
    long = (time[ends] - time[starts] > REPEATED) & (speed[starts] > MOVING)
    if long.any():
        first = starts[np.argmax(long)]
        line = int(np.searchsorted(log.imu_time, time[first])) + 2
        yield Finding(
            "warning",
            "imu.csv",
            f"the samples repeat for more than {REPEATED:g} s while the vehicle moves, {int(long.sum())} times",
            "the sensor or its recorder has stopped; leave these rows out and end the game before the hole",
            line,
        )
