"""True motion from a list of manoeuvres, smooth to jerk, with the inertial measurements that belong to it.

Each manoeuvre changes one thing (speed, height or heading) from rest to rest by the seventh-order step, whose first
three derivatives vanish at both ends: acceleration and jerk are continuous where manoeuvres meet, and so are roll rate
and pitch rate. Turns are coordinated (bank from speed and turn rate), pitch is the climb angle, without sideslip.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import make_interp_spline

from spoofgym import validation
from spoofgym.geodesy import normal_gravity, position_difference
from spoofgym.kernels import njit
from spoofgym.mechanization import advance_position, attitude_matrix, invert_mechanization
from spoofgym.validation import written

MOST_STEPS = 20_000_000
"""IMU intervals of a trajectory: it stays in memory, 200 bytes each."""
MAX_LATITUDE = math.radians(89.0)
"""ENU turns without bound at a pole: trajectories stay below this latitude, rad."""
FEWEST_POINTS = 6
"""A spline of the fifth order, whose jerk is continuous, needs so many."""
SLOWEST = 0.005
"""Speed over ground below which a velocity gives no heading, m/s."""


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """True motion and the exact inertial measurements along it.

    Attributes:
        rate: IMU samples per second.
        time: (n + 1,) s.
        attitude: (n + 1, 3, 3) body (right, forward, up) to ENU.
        velocity: (n + 1, 3) ENU, m/s.
        position: (n + 1, 3) latitude rad, longitude rad, height m.
        angular_rate: (n, 3) body against inertial space, right, forward, up, rad/s; row i spans time[i] to time[i + 1].
        specific_force: (n, 3) right, forward, up, m/s^2; rows as in `angular_rate`.
    """

    rate: float
    time: NDArray[np.float64]
    attitude: NDArray[np.float64]
    velocity: NDArray[np.float64]
    position: NDArray[np.float64]
    angular_rate: NDArray[np.float64]
    specific_force: NDArray[np.float64]

    def __post_init__(self) -> None:
        validation.above("trajectory", "rate", self.rate)
        n = len(self.angular_rate)
        expected = {
            "time": (n + 1,),
            "attitude": (n + 1, 3, 3),
            "velocity": (n + 1, 3),
            "position": (n + 1, 3),
            "angular_rate": (n, 3),
            "specific_force": (n, 3),
        }
        for name, shape in expected.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} must have shape {shape}, got {getattr(self, name).shape}")

    @property
    def dt(self) -> float:
        """IMU interval, s."""
        return 1.0 / self.rate

    @property
    def num_steps(self) -> int:
        """Number n of IMU steps."""
        return len(self.angular_rate)

    @property
    def duration(self) -> float:
        """Time from the first to the last sample, s."""
        return self.num_steps / self.rate


@dataclass(frozen=True)
class Straight:
    """Straight and level at constant speed.

    Attributes:
        duration: s.
    """

    duration: float

    def __post_init__(self) -> None:
        validation.above(type(self).__name__, "duration", self.duration)


@dataclass(frozen=True)
class Accelerate:
    """A change of speed, straight and level.

    Attributes:
        speed_change: m/s, negative to slow down.
        duration: s.
    """

    speed_change: float
    duration: float

    def __post_init__(self) -> None:
        validation.finite(type(self).__name__, "speed_change", self.speed_change)
        validation.above(type(self).__name__, "duration", self.duration)


@dataclass(frozen=True)
class Climb:
    """A change of height at constant speed along the path and constant heading.

    Attributes:
        height_change: m, negative to descend.
        duration: s.
    """

    height_change: float
    duration: float

    def __post_init__(self) -> None:
        validation.finite(type(self).__name__, "height_change", self.height_change)
        validation.above(type(self).__name__, "duration", self.duration)


@dataclass(frozen=True)
class Turn:
    """A level, coordinated turn at constant speed.

    Attributes:
        angle: Change of heading, rad, positive to the right.
        duration: s.
    """

    angle: float
    duration: float

    def __post_init__(self) -> None:
        validation.finite(type(self).__name__, "angle", self.angle)
        validation.above(type(self).__name__, "duration", self.duration)


Manoeuvre = Straight | Accelerate | Climb | Turn


def smooth_step(fraction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Seventh-order step from 0 to 1: 35 x^4 - 84 x^5 + 70 x^6 - 20 x^7, three derivatives zero at both ends.

    Args:
        fraction: Elapsed part of the manoeuvre; held at the ends outside [0, 1].

    Returns:
        Same shape.
    """
    x = np.clip(fraction, 0.0, 1.0)
    return x**4 * (35.0 + x * (-84.0 + x * (70.0 - 20.0 * x)))


def smooth_step_rate(fraction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivative of `smooth_step` with respect to `fraction`: 140 x^3 (1 - x)^3, at most 35/16."""
    x = np.clip(fraction, 0.0, 1.0)
    return 140.0 * (x * (1.0 - x)) ** 3


def coordinated_bank(speed: ArrayLike, turn_rate: ArrayLike, gravity: float) -> NDArray[np.float64]:
    """Roll of a coordinated level turn, tan(roll) = speed turn_rate / gravity.

    Args:
        speed: m/s.
        turn_rate: rad/s, positive to the right.
        gravity: m/s^2.

    Returns:
        Roll, rad, positive right wing down.
    """
    return np.arctan(np.multiply(speed, turn_rate) / gravity)


def fly(
    manoeuvres: Sequence[Manoeuvre], *, position: ArrayLike, speed: float, heading: float, rate: float = 100.0
) -> Trajectory:
    """Flies (or drives) a list of manoeuvres one after the other.

    The trajectory ends with the last whole IMU interval of the last manoeuvre.

    Args:
        manoeuvres: In order, at least one.
        position: (3,) start: latitude rad, longitude rad, height m.
        speed: Speed along the path at the start, m/s.
        heading: At the start, rad clockwise from north.
        rate: IMU samples per second.

    Returns:
        The trajectory; mechanizing its measurements from its first state reproduces it to rounding.

    Raises:
        ValueError: No manoeuvre, all together shorter than one IMU interval, a position that is none, a speed that is
            not positive or is slowed to zero, a climb steeper than the speed allows, or a value that is not finite.
    """
    if len(manoeuvres) == 0:
        raise ValueError("manoeuvres is empty: give at least one of Straight, Accelerate, Climb, Turn")
    for item in manoeuvres:
        if not isinstance(item, Manoeuvre):
            raise ValueError(f"a manoeuvre is one of Straight, Accelerate, Climb, Turn, got {item!r}")
    speed = validation.above("fly", "speed", speed)
    rate = validation.above("fly", "rate", rate)
    heading = validation.finite("fly", "heading", heading)
    start = _start(position)
    num_steps = math.floor(sum(item.duration for item in manoeuvres) * rate * (1.0 + 1e-12))
    if num_steps < 1:
        raise ValueError(f"manoeuvres must last at least one IMU interval of {1.0 / rate} s together")
    if num_steps > MOST_STEPS:
        raise ValueError(
            f"fly: manoeuvres must last {MOST_STEPS} IMU intervals at most together, which are "
            f"{written(MOST_STEPS / rate)} s at a rate of {written(rate)} Hz, got {num_steps} intervals"
        )
    time = np.arange(num_steps + 1) / rate
    path_speed, climb_rate, heading_along, turn_rate = _profiles(manoeuvres, time, speed, heading)
    if np.any(np.abs(climb_rate) >= path_speed):
        i = int(np.argmax(np.abs(climb_rate) - path_speed))
        raise ValueError(
            f"climb rate {climb_rate[i]:.6g} m/s at {written(time[i])} s is not below the speed "
            f"{path_speed[i]:.6g} m/s: make the climb longer or lower"
        )
    climb_angle = np.arcsin(climb_rate / path_speed)
    ground_speed = path_speed * np.cos(climb_angle)
    velocity = np.stack(
        [ground_speed * np.sin(heading_along), ground_speed * np.cos(heading_along), climb_rate], axis=-1
    )
    bank = coordinated_bank(ground_speed, turn_rate, normal_gravity(start[0], start[2]))
    return _trajectory(start, velocity, attitude_matrix(climb_angle, bank, heading_along), rate)


def fly_through(times: ArrayLike, positions: ArrayLike, *, rate: float = 100.0) -> Trajectory:
    """Flies (or drives) through given positions at given times, without sideslip and with coordinated turns.

    A spline of the fifth order passes through all points: noise of measured positions becomes acceleration, so smooth
    them first. Points a second apart are dense enough for a vehicle that turns within some seconds. The trajectory
    begins at time 0 with the first point.

    Args:
        times: (n,) of the points, increasing, s.
        positions: (n, 3) latitude rad, longitude rad, height m. `spoofgym.geodesy.displace` makes them from metres
            east, north and up of a place.
        rate: IMU samples per second.

    Returns:
        The trajectory; mechanizing its measurements from its first state reproduces it to rounding.

    Raises:
        ValueError: fewer than six points, times that do not increase, positions that are none, or a vehicle that
            moves too slowly for its velocity to give a heading.
    """
    rate = validation.above("fly_through", "rate", rate)
    moments, places = _points(times, positions)
    num_steps = math.floor(moments[-1] * rate * (1.0 + 1e-12))
    if not 1 <= num_steps <= MOST_STEPS:
        raise ValueError(f"fly_through: times must span 1 to {MOST_STEPS} IMU intervals, got {num_steps}")
    time = np.arange(num_steps + 1) / rate
    path = make_interp_spline(moments, places, k=5)
    # where it would be a second later, at the rates of the angles: metres per second
    velocity = position_difference(path(time) + path(time, 1), path(time))
    ground_speed = np.hypot(velocity[:, 0], velocity[:, 1])
    if np.any(ground_speed < SLOWEST):
        i = int(np.argmin(ground_speed))
        raise ValueError(
            f"fly_through: at {written(time[i])} s the speed over ground is {ground_speed[i]:.3g} m/s, which gives no "
            f"heading: it must be {SLOWEST} m/s or more"
        )
    heading = np.unwrap(np.arctan2(velocity[:, 0], velocity[:, 1]))
    turn_rate = np.gradient(heading, 1.0 / rate) if num_steps > 1 else np.zeros_like(heading)
    bank = coordinated_bank(ground_speed, turn_rate, normal_gravity(places[0, 0], places[0, 2]))
    attitude = attitude_matrix(np.arctan2(velocity[:, 2], ground_speed), bank, heading)
    return _trajectory(places[0], velocity, attitude, rate)


def _points(times: ArrayLike, positions: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times from the first one on (n,), s, and positions (n, 3), checked."""
    moments, places = validation.real_array(times), validation.real_array(positions)
    if moments is None or moments.ndim != 1 or len(moments) < FEWEST_POINTS or not np.all(np.isfinite(moments)):
        raise ValueError(
            f"times must be {FEWEST_POINTS} or more finite numbers, one per point, got {validation.shown(times)}"
        )
    if np.any(np.diff(moments) <= 0.0):
        raise ValueError("times must increase from each point to the next")
    if places is None or places.shape != (len(moments), 3):
        raise ValueError(
            f"positions must have shape ({len(moments)}, 3), as many as times: latitude rad, longitude rad, height m; "
            f"got {validation.shown(positions)}"
        )
    for place in places:
        _start(place)
    places = np.array(places, dtype=np.float64)
    places[:, 1] = np.unwrap(places[:, 1])
    return np.asarray(moments - moments[0], dtype=np.float64), places


def _trajectory(
    start: NDArray[np.float64], velocity: NDArray[np.float64], attitude: NDArray[np.float64], rate: float
) -> Trajectory:
    """The trajectory of a velocity (n + 1, 3), ENU, m/s, and an attitude (n + 1, 3, 3), from ``start`` (3,).

    Raises:
        ValueError: it comes too near to a pole.
    """
    positions = np.empty_like(velocity)
    _integrate_position(start, velocity, 1.0 / rate, positions)
    if not np.all(np.abs(positions[:, 0]) <= MAX_LATITUDE):
        raise ValueError(f"the trajectory leaves latitudes within +-{math.degrees(MAX_LATITUDE):.0f} degrees")
    angular_rate, specific_force = invert_mechanization(attitude, velocity, positions, 1.0 / rate)
    return Trajectory(
        rate=float(rate),
        time=np.arange(len(velocity)) / rate,
        attitude=attitude,
        velocity=velocity,
        position=positions,
        angular_rate=angular_rate,
        specific_force=specific_force,
    )


def _profiles(
    manoeuvres: Sequence[Manoeuvre], time: NDArray[np.float64], speed: float, heading: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Speed along the path m/s, climb rate m/s, heading rad and turn rate rad/s, each (n + 1,), at `time`."""
    path_speed = np.full_like(time, speed)
    climb_rate = np.zeros_like(time)
    heading_along = np.full_like(time, heading)
    turn_rate = np.zeros_like(time)
    final_speed = float(speed)
    begin = 0.0
    for item in manoeuvres:
        fraction = (time - begin) / item.duration
        if isinstance(item, Accelerate):
            final_speed += item.speed_change
            validation.above("fly", f"speed after {item}", final_speed)
            path_speed += item.speed_change * smooth_step(fraction)
        elif isinstance(item, Climb):
            climb_rate += item.height_change / item.duration * smooth_step_rate(fraction)
        elif isinstance(item, Turn):
            heading_along += item.angle * smooth_step(fraction)
            turn_rate += item.angle / item.duration * smooth_step_rate(fraction)
        begin += item.duration
    return path_speed, climb_rate, heading_along, turn_rate


@njit(cache=True, nogil=True, error_model="numpy")
def _integrate_position(
    start: NDArray[np.float64], velocity: NDArray[np.float64], dt: float, position: NDArray[np.float64]
) -> None:
    """Fills `position` (n + 1, 3) from `start` (3,) by the mechanization's own trapezoid rule, velocity (n + 1, 3)."""
    latitude, longitude, height = start[0], start[1], start[2]
    for i in range(position.shape[0]):
        position[i, 0], position[i, 1], position[i, 2] = latitude, longitude, height
        if i + 1 < position.shape[0]:
            east = 0.5 * (velocity[i, 0] + velocity[i + 1, 0])
            north = 0.5 * (velocity[i, 1] + velocity[i + 1, 1])
            up = 0.5 * (velocity[i, 2] + velocity[i + 1, 2])
            latitude, longitude, height = advance_position(latitude, longitude, height, east, north, up, dt)


def _start(position: ArrayLike) -> NDArray[np.float64]:
    given = validation.real_array(position)
    if given is None or given.shape != (3,) or not np.all(np.isfinite(given)):
        raise ValueError(
            "position must be three finite numbers (latitude rad, longitude rad, height m), got "
            f"{validation.shown(position)}"
        )
    start = np.array(given, dtype=np.float64)
    if abs(start[0]) > MAX_LATITUDE:
        raise ValueError(
            f"latitude must lie within +-{MAX_LATITUDE:.4f} rad, got {written(start[0])}: are these degrees or is it a "
            "pole?"
        )
    return start
