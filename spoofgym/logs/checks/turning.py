"""Inertial samples against the motion that the fixes show: turns, accelerations, and the offset of their clocks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.checks.finding import Finding
from spoofgym.logs.log import Log, velocity_of
from spoofgym.logs.mounting import means_between, running_integral

SLOWEST = 3.0
"""Least speed whose course is used, m/s."""
LONGEST_STEP = 2.0
"""Longest time between two fixes that are compared, s; the shortest is about 1 s, so that noise matters less."""
FEWEST = 20
"""Least number of intervals that tell something."""
TURNING = 0.03
"""Least root mean square of the course rate that tells something, rad/s."""
SURE = 0.7
"""Correlation from which on turns, or accelerations, are the same motion."""
CERTAIN = 0.8
"""Correlation from which on another sign, or another time, is believed."""
FARTHEST = 25.0
"""Largest offset between the clocks that is looked for, s."""
FINEST = 0.1
"""Step of the offsets that are tried, s."""
OFFSET = 0.3
"""Least offset that is told, s."""
BETTER = 0.3
"""Largest share of the square of the motion left unexplained with an offset that is told, of that without."""
DEGREES = (30.0, 110.0)
"""Ratio of the yaw rate to the course rate where the gyroscope is in degrees per second: 57.3."""
FELT = 0.02
"""Least horizontal specific force that is compared, root mean square, m/s²: in a coordinated turn there is none."""
TURNED = np.radians(25.0)
"""Least angle about the vertical by which a mounting is said to be wrong, rad."""


@dataclass(frozen=True, eq=False)
class Motion:
    """What IMU and fixes say between consecutive fixes on the move, n intervals.

    Attributes:
        yaw: mean angular rate about down, (n,), rad/s.
        course: rate of the course, clockwise, (n,), rad/s.
        force: mean horizontal specific force, forward + i right, less its mean, (n,), m/s².
        acceleration: of the fixes, forward + i right, less its mean, (n,), m/s².
    """

    yaw: Floats
    course: Floats
    force: np.ndarray
    acceleration: np.ndarray

    @property
    def yaw_correlation(self) -> float:
        """Of yaw rate and course rate; 0 where one of them is constant."""
        return _correlation(self.yaw - self.yaw.mean(), self.course - self.course.mean())

    @property
    def force_correlation(self) -> float:
        """Magnitude of that of force and acceleration, whatever the direction of the axes."""
        norm = np.sqrt(np.sum(np.abs(self.force) ** 2) * np.sum(np.abs(self.acceleration) ** 2))
        return float(np.abs(np.sum(self.force * np.conj(self.acceleration))) / norm) if norm > 0.0 else 0.0


@dataclass(frozen=True, eq=False)
class Integrals:
    """Running integrals of the inertial samples of a log, each (n, 3)."""

    rate: Floats
    force: Floats


def integrals(log: Log) -> Integrals:
    """Of a log; `motion` takes them as often as offsets are tried."""
    return Integrals(
        running_integral(log.imu_time, log.angular_rate), running_integral(log.imu_time, log.specific_force)
    )


def motion(log: Log, whole: Integrals, delay: float = 0.0) -> Motion | None:
    """The motion from the log's start on with the fixes earlier by a delay, s; None = too little of it."""
    time, velocity = log.fixes.time - delay, velocity_of(log.fixes)
    stride = max(1, round(1.0 / max(float(np.median(np.diff(time))), 1e-3)))
    time, velocity = time[::stride], velocity[::stride]
    begin, end = time[:-1], time[1:]
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    used = (end - begin <= LONGEST_STEP) & (begin >= log.imu_time[0]) & (end <= log.imu_time[-1])
    used &= (np.minimum(speed[1:], speed[:-1]) >= SLOWEST) & (begin >= log.start - delay)
    if np.count_nonzero(used) < FEWEST:
        return None
    step = (end - begin)[used]
    turn = np.diff(np.arctan2(velocity[:, 0], velocity[:, 1]))[used]
    course = (turn - 2.0 * np.pi * np.round(turn / (2.0 * np.pi))) / step
    usual = np.abs(course) < 2.0  # a course that leaps at low speed is no turn
    rate = means_between(log.imu_time, whole.rate, begin[used], end[used])[usual]
    force = means_between(log.imu_time, whole.force, begin[used], end[used])[usual]
    forward = (np.diff(speed)[used] / step)[usual]
    right = (0.5 * (speed[1:] + speed[:-1])[used] * course)[usual]
    measured, moved = force[:, 1] + 1j * force[:, 0], forward + 1j * right
    if len(rate) < FEWEST:
        return None
    return Motion(-rate[:, 2], course[usual], measured - measured.mean(), moved - moved.mean())


def _correlation(one: Floats, other: Floats) -> float:
    norm = np.sqrt((one**2).sum() * (other**2).sum())
    return float((one * other).sum() / norm) if norm > 0.0 else 0.0


def check_turning(log: Log) -> Iterator[Finding]:
    """Findings about gyroscope, accelerometer, mounting and clocks of a log, in body axes; none without motion."""
    whole = integrals(log)
    now = motion(log, whole)
    if now is None:
        return
    turning = float(np.sqrt(np.mean(np.square(now.course - now.course.mean())))) > TURNING
    offset = _offset(log, whole, now)
    if offset is not None:
        yield _offset_finding(*offset)
        now = motion(log, whole, offset[0]) or now
    if turning:
        yield from _check_yaw(now)
    if offset is None and (not turning or abs(now.yaw_correlation) >= SURE):
        yield from _check_force(now)


def _check_yaw(now: Motion) -> Iterator[Finding]:
    correlation = now.yaw_correlation
    if correlation <= -CERTAIN:
        yield Finding(
            "error",
            "imu.csv",
            f"the vehicle turns to the other side than the fixes say (yaw rate and course rate have a correlation of "
            f"{correlation:.2f})",
            "either a sign of gx_radps, gy_radps, gz_radps or imu_to_body_frd is wrong, or lat_deg and lon_deg (or "
            "vn_mps and ve_mps) are swapped",
        )
    elif correlation >= SURE:
        yaw, course = now.yaw - now.yaw.mean(), now.course - now.course.mean()
        ratio = float(np.sqrt((yaw**2).sum() / (course**2).sum()))
        if DEGREES[0] < ratio < DEGREES[1]:
            yield Finding(
                "error",
                "imu.csv",
                f"the angular rate is in degrees per second: it is {ratio:.1f} times the course rate",
                "divide gx_radps, gy_radps and gz_radps by 57.29578",
                1,
            )
        elif not 0.5 < ratio < 2.0:
            yield Finding(
                "error",
                "imu.csv",
                f"the angular rate is {ratio:.3g} times the course rate of the fixes",
                "look at its unit (rad/s), the unit of t_s and the rows that are there twice",
                1,
            )


def _check_force(now: Motion) -> Iterator[Finding]:
    """Where forward points, by a regression of the horizontal force on the acceleration, and how large it is."""
    power = float(np.sum(np.abs(now.acceleration) ** 2))
    felt = float(np.sqrt(np.mean(np.abs(now.force) ** 2)))
    if now.force_correlation < SURE or power == 0.0 or felt < FELT:
        return
    gain = np.sum(now.force * np.conj(now.acceleration)) / power
    angle = float(np.angle(gain))
    if abs(angle) > TURNED:
        yield Finding(
            "warning",
            "log.toml",
            f"imu_to_body_frd is turned by {np.degrees(angle):.0f} degrees about the vertical, as accelerations of the "
            "fixes show",
            "imu_to_body_frd = [] finds the mounting from the drive; a vehicle that goes sideways has none",
        )
    elif not 0.5 < abs(gain) < 2.0:
        yield Finding(
            "warning",
            "imu.csv",
            f"the specific force is {abs(gain):.2g} times the acceleration that the fixes show",
            "look at its unit (m/s²) and at the velocity of the fixes",
            1,
        )


def _offset(log: Log, whole: Integrals, now: Motion) -> tuple[float, float, float] | None:
    """Offset of the fixes against the IMU, s, and correlation with it and without; None = no clear one."""
    here = _fit(now)
    delays = np.arange(-FARTHEST, FARTHEST + FINEST / 2.0, FINEST)
    shifted = (motion(log, whole, float(delay)) for delay in delays)
    fits = np.array([0.0 if each is None else _fit(each) for each in shifted])
    best = int(np.argmax(fits))
    delay = float(delays[best])
    rivals = fits[np.abs(delays - delay) > 3.0]
    clear = fits[best] > CERTAIN and 1.0 - fits[best] ** 2 < BETTER * (1.0 - max(here, 0.0) ** 2)
    clear = clear and fits[best] > rivals.max(initial=0.0) + 0.05
    return (delay, float(fits[best]), here) if clear and abs(delay) >= OFFSET else None


def _fit(now: Motion) -> float:
    """How well turns fit; where the vehicle hardly turns, how well accelerations do."""
    turning = float(np.sqrt(np.mean(np.square(now.course - now.course.mean())))) > TURNING
    return now.yaw_correlation if turning else now.force_correlation


def _offset_finding(delay: float, best: float, here: float) -> Finding:
    reason = "UTC against GPS time differ by 18 s; " if abs(abs(delay) - 18.0) < 0.3 else ""
    whole = abs(delay - round(delay)) < 0.15 and abs(delay) > 0.5
    reason = reason or (f"a clock that is off by {round(delay):d} s; " if whole else "")
    advice = f"{reason}add {delay:.1f} to gnss_delay_s in log.toml"
    text = (
        f"the fixes are {abs(delay):.1f} s {'later' if delay > 0 else 'earlier'} than the IMU: turns and accelerations "
        f"then have a correlation of {best:.2f}, now {here:.2f}"
    )
    return Finding("error" if here < 0.5 else "warning", "gnss.csv", text, advice)
