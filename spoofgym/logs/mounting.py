"""The mounting of an IMU whose axes in the vehicle are unknown, and the delay of its receiver, found from the drive.

Up is the mean specific force less the acceleration that the fixes show. Heading about it follows from the horizontal
specific force against the change of speed (forward) and speed times course rate (to the right), a regression in the
complex plane. The yaw rate against the course rate gives the delay of the fixes and confirms the sense of rotation.
Level is as in Groves 2013, section 5.6.2; the regression is ours. A drive forward is assumed; the whole log is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Flags, Floats

MIN_SPEED = 3.0
"""Slowest speed whose course is used, m/s."""
STANDSTILL_SPEED = 0.3
"""Fastest speed at which the vehicle may be said to stand, m/s."""
MIN_STANDSTILL = 5
"""Intervals at a standstill, fewest of which give a bias."""
MIN_INTERVALS = 30
"""Intervals between fixes on the move, fewest that give a mounting."""
MAX_INTERVAL = 2.0
"""Longest time between two fixes that are compared with the IMU, s."""
MAX_HEADING_SIGMA = np.radians(3.0)
"""Largest 1 sigma of the heading about the vertical, by the residuals of the regression taken as white, rad."""
MIN_YAW_CORRELATION = 0.5
"""Smallest correlation of yaw rate and course rate."""
DELAYS = np.linspace(-1.0, 1.0, 41)
"""Delays of the fixes that are tried, s."""
ITERATIONS = 10
NO_MOUNTING = "the mounting of the IMU cannot be found"
NO_RANGE_DELAY = (
    "the delay of the ranges against the IMU cannot be found by the velocities from range_rate_mps, which may have a "
    "wrong sign or unit, or be on another clock than the IMU"
)
"""What the drive does not tell, for messages."""


@dataclass(frozen=True, eq=False)
class Mounting:
    """How an IMU sits in the vehicle.

    Attributes:
        rotation: sensor axes to body right, forward, up, (3, 3).
        heading_sigma: of the rotation about the vertical, rad, by residuals taken as white; slopes of the road are not,
            so that the true one is larger.
        gyro_bias: median angular rate at a standstill, sensor axes, (3,), rad/s; the rotation of the Earth is in it.
            Zero where the vehicle hardly stands.
        yaw_correlation: of the yaw rate with the course rate.
    """

    rotation: Floats
    heading_sigma: float
    gyro_bias: Floats
    yaw_correlation: float


@dataclass(frozen=True, eq=False)
class _Intervals:
    """What the fixes and the IMU say between successive fixes, n of them.

    Attributes:
        moving: course is known, (n,).
        standing: (n,).
        forward: acceleration, (n,), m/s².
        right: centripetal acceleration, (n,), m/s².
        course_rate: clockwise, (n,), rad/s.
        angular_rate: mean, sensor axes, (n, 3), rad/s.
        specific_force: mean, sensor axes, (n, 3), m/s².
    """

    moving: Flags
    standing: Flags
    forward: Floats
    right: Floats
    course_rate: Floats
    angular_rate: Floats
    specific_force: Floats


def find_delay(
    owner: str,
    imu_time: Floats,
    angular_rate: Floats,
    specific_force: Floats,
    fix_time: Floats,
    velocity: Floats,
    failure: str = NO_MOUNTING,
) -> float:
    """How much later than the IMU the fixes are stamped, s: where yaw rate and course rate correlate best.

    Args:
        owner: whom an error names.
        imu_time: (n,), s, increasing.
        angular_rate: sensor axes, (n, 3), rad/s.
        specific_force: sensor axes, (n, 3), m/s².
        fix_time: (f,), s, increasing.
        velocity: of the fixes, (f, 3), ENU, m/s.
        failure: what an error says that the drive does not tell.

    Raises:
        ValueError: too little motion, no turns, or a delay of a second or more.
    """
    blame = f"{owner}: {failure}"
    turned, pushed = running_integral(imu_time, angular_rate), running_integral(imu_time, specific_force)
    correlation = []
    for delay in DELAYS:
        intervals = _intervals(blame, imu_time, turned, pushed, fix_time - delay, velocity)
        correlation.append(_yaw_correlation(intervals, _direction(intervals.specific_force[intervals.moving])))
    best = int(np.argmax(correlation))
    _check_yaw(blame, correlation[best])
    if best in (0, len(DELAYS) - 1):
        raise ValueError(
            f"{owner}: fixes and IMU are {abs(DELAYS[best]):g} s apart or more; set gnss_delay_s (of ranges: "
            "imu_delay_s)"
        )
    before, at, after = correlation[best - 1 : best + 2]
    vertex = 0.5 * (before - after) / (before - 2.0 * at + after)
    return float(DELAYS[best] + vertex * (DELAYS[1] - DELAYS[0]))


def find_mounting(
    owner: str, imu_time: Floats, angular_rate: Floats, specific_force: Floats, fix_time: Floats, velocity: Floats
) -> Mounting:
    """The mounting of an IMU, its fixes without delay; arguments as for `find_delay`.

    Raises:
        ValueError: the drive does not determine it: too little motion, too little acceleration, no turns, or an angular
            rate that does not fit the course.
    """
    blame = f"{owner}: {NO_MOUNTING}"
    turned, pushed = running_integral(imu_time, angular_rate), running_integral(imu_time, specific_force)
    intervals = _intervals(blame, imu_time, turned, pushed, fix_time, velocity)
    moving = intervals.moving
    rotation, heading_sigma = _rotation(intervals)
    if not heading_sigma <= MAX_HEADING_SIGMA:
        raise ValueError(
            f"{blame}: its heading about the vertical is known to "
            f"{np.degrees(heading_sigma):.2g}° (1 sigma), needed are {np.degrees(MAX_HEADING_SIGMA):g}° or less; the "
            f"vehicle must accelerate, brake and turn, or set imu_to_body_frd"
        )
    correlation = _yaw_correlation(intervals, rotation[2])
    _check_yaw(blame, correlation)
    standing = intervals.angular_rate[intervals.standing & ~moving]
    bias = np.median(standing, axis=0) if len(standing) >= MIN_STANDSTILL else np.zeros(3)
    return Mounting(rotation, heading_sigma, bias, correlation)


def _check_yaw(blame: str, correlation: float) -> None:
    if not correlation >= MIN_YAW_CORRELATION:
        raise ValueError(
            f"{blame}: yaw rate and course rate have a correlation of {correlation:.2f}, needed is "
            f"{MIN_YAW_CORRELATION:g} or more; the vehicle must turn, and gyro and "
            f"accelerometer must have the same right-handed axes"
        )


def _intervals(
    blame: str, imu_time: Floats, turned: Floats, pushed: Floats, fix_time: Floats, velocity: Floats
) -> _Intervals:
    """Of consecutive fixes; ``turned`` and ``pushed`` are the running integrals of angular rate and specific force."""
    begin, end = fix_time[:-1], fix_time[1:]
    step = end - begin
    used = (step <= MAX_INTERVAL) & (begin >= imu_time[0]) & (end <= imu_time[-1])
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    slower, faster = np.minimum(speed[:-1], speed[1:]), np.maximum(speed[:-1], speed[1:])
    turn = np.diff(np.arctan2(velocity[:, 0], velocity[:, 1]))
    course_rate = (turn - 2.0 * np.pi * np.round(turn / (2.0 * np.pi))) / step
    moving = used & (slower >= MIN_SPEED)
    if np.count_nonzero(moving) < MIN_INTERVALS:
        raise ValueError(
            f"{blame}: {np.count_nonzero(moving)} intervals between fixes at {MIN_SPEED:g} m/s or more, needed are "
            f"{MIN_INTERVALS}"
        )
    return _Intervals(
        moving=moving[used],
        standing=(faster <= STANDSTILL_SPEED)[used],
        forward=(np.diff(speed) / step)[used],
        right=(0.5 * (speed[:-1] + speed[1:]) * course_rate)[used],
        course_rate=course_rate[used],
        angular_rate=means_between(imu_time, turned, begin[used], end[used]),
        specific_force=means_between(imu_time, pushed, begin[used], end[used]),
    )


def interval_means(time: Floats, samples: Floats, begin: Floats, end: Floats) -> Floats:
    """Of the straight lines between the samples, over each interval, (n, 3)."""
    return means_between(time, running_integral(time, samples), begin, end)


def running_integral(time: Floats, samples: Floats) -> Floats:
    """Of the straight lines between the samples (n, 3), from the first sample to each, (n, 3)."""
    areas = 0.5 * (samples[1:] + samples[:-1]) * np.diff(time)[:, None]
    return np.vstack([np.zeros(3), np.cumsum(areas, axis=0)])


def means_between(time: Floats, integral: Floats, begin: Floats, end: Floats) -> Floats:
    """What `interval_means` gives, from the running integral."""
    change = [np.interp(end, time, integral[:, a]) - np.interp(begin, time, integral[:, a]) for a in range(3)]
    return np.stack(change, axis=1) / (end - begin)[:, None]


def _direction(vectors: Floats) -> Floats:
    """Unit vector along the mean of vectors, (3,)."""
    mean = np.mean(vectors, axis=0)
    return np.asarray(mean / np.linalg.norm(mean))


def _yaw_correlation(intervals: _Intervals, up: Floats) -> float:
    """Of the angular rate about down with the course rate, on the move; 0 where one of them is constant."""
    yaw = -(intervals.angular_rate[intervals.moving] * up).sum(axis=1)
    course = intervals.course_rate[intervals.moving]
    yaw, course = yaw - yaw.mean(), course - course.mean()
    norm = np.sqrt((yaw**2).sum() * (course**2).sum())
    return float((yaw * course).sum() / norm) if norm > 0.0 else 0.0


def _rotation(intervals: _Intervals) -> tuple[Floats, float]:
    """Sensor axes to body right, forward, up, and the 1 sigma of the heading; level and heading by turns."""
    force = intervals.specific_force[intervals.moving]
    acceleration = np.column_stack([intervals.right, intervals.forward])[intervals.moving]
    rotation = np.zeros((3, 3))
    for _ in range(ITERATIONS):
        up = _direction(force - acceleration @ rotation[:2])
        rotation, heading_sigma = _heading(force, acceleration, up)
    return rotation, heading_sigma


def _heading(force: Floats, acceleration: Floats, up: Floats) -> tuple[Floats, float]:
    """The rotation with this up that turns the horizontal force best into the acceleration, and its 1 sigma, rad.

    With forward + i right for both, force = gain x acceleration + noise, and the argument of the gain is the angle from
    a chosen axis to forward.
    """
    right = np.cross(np.eye(3)[np.argmin(np.abs(up))], up)
    right /= np.linalg.norm(right)
    forward = np.cross(up, right)
    measured = force @ forward + 1j * (force @ right)
    moved = acceleration[:, 1] + 1j * acceleration[:, 0]
    power = float(np.sum(np.abs(moved) ** 2))
    if power == 0.0:
        return np.stack([right, forward, up]), np.inf
    gain = np.sum(measured * np.conj(moved)) / power
    residual = np.sum(np.abs(measured - gain * moved) ** 2)
    sigma = float(np.sqrt(residual / (2.0 * (len(force) - 1) * power)) / np.abs(gain))
    cosine, sine = np.cos(np.angle(gain)), np.sin(np.angle(gain))
    return np.stack([cosine * right - sine * forward, cosine * forward + sine * right, up]), sigma
