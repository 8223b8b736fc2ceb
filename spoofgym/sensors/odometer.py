"""A differential-drive odometer with the yaw of an INS: encoders, their errors, and dead reckoning (Song 2021).

Yaw is clockwise from north as in Song's equations, so the east component is the sine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats


@dataclass(frozen=True, kw_only=True)
class Odometer:
    """Encoders on the two wheels of a differential drive.

    Attributes:
        rate: of the readings, Hz (Song 2021, table 1).
        counts_per_turn: L, of a wheel (Song 2021, table 1).
        wheel_radius: W_r, m; ours.
        wheel_base: L_w, between the wheels, m; ours.
    """

    rate: float = 10.0
    counts_per_turn: int = 495
    wheel_radius: float = 0.0325
    wheel_base: float = 0.20

    def __post_init__(self) -> None:
        for name in ("rate", "wheel_radius", "wheel_base"):
            validation.above("odometer", name, getattr(self, name))
        validation.whole("odometer", "counts_per_turn", self.counts_per_turn, 1)

    @property
    def step(self) -> float:
        """Time between readings, s."""
        return 1.0 / self.rate

    @property
    def travel_per_count(self) -> float:
        """2π W_r / L, m."""
        return 2.0 * math.pi * self.wheel_radius / self.counts_per_turn


@dataclass(frozen=True, kw_only=True)
class OdometerGrade:
    """The errors of wheels and yaw, one sigma; each is drawn anew in every episode.

    Attributes:
        name: of the grade.
        heading_offset: constant error of the yaw, deg.
        heading_drift: constant rate of its drift, deg/s, from the first reading on.
        heading_random_walk: deg/√s.
        scale: relative calibration error of the wheel radius, the same on both wheels.
        slip: random walk of each wheel's travel, m/√m.
        source: where the figures come from.
    """

    name: str
    heading_offset: float
    heading_drift: float
    heading_random_walk: float
    scale: float
    slip: float
    source: str

    def __post_init__(self) -> None:
        for item in ("heading_offset", "heading_drift", "heading_random_walk", "scale", "slip"):
            validation.non_negative(f"odometer grade {self.name!r}", item, getattr(self, item))

    def drift_sigma(self, speed: float, interval: float, elapsed: float) -> float:
        """One sigma of what dead reckoning goes wrong in an interval, m: heading error times way, and scale.

        Args:
            speed: of the vehicle, m/s.
            interval: s.
            elapsed: since the first reading, s; the heading error grows with it.
        """
        walked = self.heading_random_walk * math.sqrt(elapsed)
        heading = math.radians(math.hypot(self.heading_offset, self.heading_drift * elapsed, walked))
        way = speed * interval
        return math.hypot(heading * way, self.scale * way, self.slip * math.sqrt(way / 2.0))


GRADES = {
    item.name: item
    for item in (
        OdometerGrade(
            name="set-a",
            heading_offset=1.0,
            heading_drift=0.03,
            heading_random_walk=0.05,
            scale=0.01,
            slip=0.01,
            source="ours: a yaw known to a degree that drifts by 9 deg in 300 s, wheels known to a hundredth",
        ),
        OdometerGrade(
            name="set-b",
            heading_offset=2.0,
            heading_drift=0.08,
            heading_random_walk=0.2,
            scale=0.02,
            slip=0.01,
            source="a prototype outside this package, in which it was tuned to the 5 m that Song's robot is off at "
            "most while it leaves GNSS out for 150 s",
        ),
        OdometerGrade(
            name="table-1",
            heading_offset=0.0,
            heading_drift=0.0,
            heading_random_walk=0.01,
            scale=0.0,
            slip=0.0,
            source="Song et al. 2021, table 1: the gyro's noise, 0.01 deg/s/√Hz, and the encoder's resolution, alone; "
            "no bias, no calibration error, no slip are printed",
        ),
    )
}


def odometer_grade(name: str) -> OdometerGrade:
    """The grade of that name.

    Raises:
        ValueError: unknown name; the message lists the valid ones.
    """
    return GRADES[validation.one_of("odometer", "grade", name, tuple(GRADES))]


@dataclass(frozen=True, eq=False)
class PlanarMotion:
    """True motion in the plane, sample by sample of an odometer.

    Attributes:
        position: at samples 0..J, (J+1, 2), east and north, m.
        yaw: clockwise from north, continuous, (J+1,), rad.
        velocity: (J+1, 2), east and north, m/s.
        travel: way along the path in each step, (J,), m.
    """

    position: Floats
    yaw: Floats
    velocity: Floats
    travel: Floats

    @property
    def num_steps(self) -> int:
        """J."""
        return len(self.travel)

    @cached_property
    def displacement(self) -> Floats:
        """In each step, (J, 2), m."""
        return np.diff(self.position, axis=0)

    def wheel_travel(self, base: float) -> Floats:
        """Way of the left and the right wheel, ``base`` m apart, in each step, (J, 2), m: the outer one goes farther.

        The inverse of eq 3's (s_l - s_r) / L_w = Δyaw.
        """
        half = 0.5 * base * np.diff(self.yaw)
        return np.stack([self.travel + half, self.travel - half], axis=1)


def wheel_travel(counts: Floats, odometer: Odometer) -> Floats:
    """s = o 2π W_r / L: the way of a wheel that has turned by ``counts``, m (Song 2021, eq 2).

    The paper prints a product with L, the counts of a turn.
    """
    return np.asarray(counts * odometer.travel_per_count)


def encode(travel: Floats, odometer: Odometer) -> Floats:
    """Counts that each step adds, (J, 2): the encoder counts whole marks of the angle, so that nothing is lost."""
    marks = np.floor(np.cumsum(travel, axis=0) / odometer.travel_per_count)
    return np.diff(marks, axis=0, prepend=0.0)


def step_displacement(travel: Floats, yaw: Floats) -> Floats:
    """½ (s_l + s_r) (sin yaw, cos yaw) of each step, (J, 2), m: with the yaw of the INS at its end, Song 2021, eq 4.

    Over the step it is eq 5's velocity; the third row, the height, has no error here. Eq 6 takes the velocity of the
    step before, and would lag behind eq 4 by one step.
    """
    mean = 0.5 * (travel[:, 0] + travel[:, 1])
    return np.stack([mean * np.sin(yaw), mean * np.cos(yaw)], axis=1)


def draw_displacement(
    motion: PlanarMotion, odometer: Odometer, grade: OdometerGrade, rng: np.random.Generator
) -> Floats:
    """What odometer and yaw make of each step of a motion, (J, 2), east and north, m.

    Args:
        motion: the truth.
        odometer: the encoders.
        grade: of the errors.
        rng: source of randomness; the same numbers are drawn whatever the grade.
    """
    offset, drift, scale = rng.standard_normal(3)
    walk, slip = rng.standard_normal(motion.num_steps), rng.standard_normal((motion.num_steps, 2))
    elapsed = odometer.step * np.arange(1, motion.num_steps + 1)
    heading_error = np.radians(
        grade.heading_offset * offset
        + grade.heading_drift * drift * elapsed
        + grade.heading_random_walk * math.sqrt(odometer.step) * np.cumsum(walk)
    )
    true = motion.wheel_travel(odometer.wheel_base)
    turned = true * (1.0 + grade.scale * scale) + grade.slip * np.sqrt(np.abs(true)) * slip
    travel = wheel_travel(encode(turned, odometer), odometer)
    return step_displacement(travel, motion.yaw[1:] + heading_error)
