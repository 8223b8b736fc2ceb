"""Coarse alignment in motion, whichever way the vehicle looks: what the IMU felt is laid upon what the fixes show.

Over some tens of seconds the integrated specific force, in the axes that the vehicle had at the beginning, must be the
change of velocity plus gravity times time. The rotation that makes it so is Wahba's (velocity matching by optimisation:
Wu and Pan 2013, "Velocity/position integration formula part I"); a linear refinement gives its sigma, and takes the
error of the first velocity and the biases of accelerometers and gyro along. The rotation of the Earth, 0.25 degrees a
minute, is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from spoofgym.arrays import Floats
from spoofgym.geodesy import normal_gravity
from spoofgym.logs.alignment.base import MAX_TILT, Alignment
from spoofgym.logs.log import Log, velocity_of
from spoofgym.logs.mounting import running_integral
from spoofgym.logs.table import seconds

METHOD = "coarse"
WINDOWS = (10.0, 20.0, 30.0, 45.0, 60.0)
"""Lengths that are tried, s."""
MOST_SHARE = 0.5
"""Of a log that may be spent until it is aligned."""
STRIDE = 15.0
"""Between the beginnings that are tried, s."""
GOOD_SIGMA, LARGEST_SIGMA = np.radians(5.0), np.radians(15.0)
"""Of the heading: where the search ends, and beyond which nothing is known, rad."""
LEVEL_SIGMA = np.radians(2.0)
LEAST_HEADING_SIGMA = float(np.radians(3.0))
"""Floors of what is claimed, rad: tilt and bias of the accelerometer cannot be told apart."""
CORRELATED = 3.0
"""Factor on the sigma of residuals that are taken as white."""
FEWEST_FIXES = 8
ITERATIONS, CONVERGED = 20, 1e-3
"""Most of them, and the change of the rotation at which they end, rad."""
LEAST_VARIANCE = 1e-4
"""Of a residual, (m/s)²."""
SIGMA_OF_ACCELERATION = 0.3
"""Bias that the refinement allows an accelerometer, m/s²."""
SIGMA_OF_VELOCITY = 1.0
"""Error that it allows the first velocity, m/s."""
SIGMA_OF_RATE = 0.03
"""Bias that it allows a gyro, rad/s: that of a phone before its calibration."""
PRIOR = np.repeat([0.0, SIGMA_OF_VELOCITY**-2, SIGMA_OF_ACCELERATION**-2, SIGMA_OF_RATE**-2], 3)
BIAS_STEP = 1e-5
"""For slopes by differences, rad/s."""


@dataclass(frozen=True, eq=False)
class Matched:
    """Attitudes that a window of a log tells.

    Attributes:
        first: index of the fix at its beginning.
        last: index of the fix at its end.
        before: attitude at its beginning, body R, F, U to ENU, (3, 3).
        after: attitude at its end, (3, 3).
        heading_sigma: rad.
    """

    first: int
    last: int
    before: Floats
    after: Floats
    heading_sigma: float


def coarse(log: Log) -> Alignment:
    """Align after the first stretch from the log's start on whose accelerations tell the heading.

    Raises:
        ValueError: there is none.
    """
    best = None
    begin = max(log.start, float(log.imu_time[0]), float(log.fixes.time[0]))
    last = begin + MOST_SHARE * (log.fixes.time[-1] - begin)
    while begin + WINDOWS[0] < last:
        for length in WINDOWS:
            if begin + length > last:
                break
            found = match(log, begin, begin + length)
            if found is not None and (best is None or found.heading_sigma < best.heading_sigma):
                best = found
            if best is not None and best.heading_sigma <= GOOD_SIGMA:
                return _aligned(log, best)
        begin += STRIDE
    if best is None or best.heading_sigma > LARGEST_SIGMA:
        known = "not at all" if best is None else f"to {np.degrees(best.heading_sigma):.2g}°"
        raise ValueError(
            f"log {str(log.folder)!r}: alignment coarse: in its first half the accelerations after start_s = "
            f"{seconds(log.start)} s tell the heading {known}, needed are {np.degrees(LARGEST_SIGMA):g}°; the vehicle "
            "must speed up, brake or turn, or state heading_deg in log.toml"
        )
    return _aligned(log, best)


def _aligned(log: Log, found: Matched) -> Alignment:
    sigma = np.array([LEVEL_SIGMA, LEVEL_SIGMA, found.heading_sigma])
    return Alignment(METHOD, found.last, found.after, velocity_of(log.fixes)[found.last].copy(), sigma)


def match(log: Log, begin: float, end: float) -> Matched | None:
    """The attitudes of a stretch of a log; None = its fixes are too few, or the specific force does not point up.

    Args:
        log: with body axes.
        begin: s.
        end: s.
    """
    time = log.fixes.time
    fixes = np.flatnonzero((time >= max(begin, log.imu_time[0])) & (time <= min(end, log.imu_time[-1])))
    fixes = fixes[(fixes > 0) & (fixes < len(time) - 1)]
    if len(fixes) < FEWEST_FIXES:
        return None
    spent = time[fixes] - time[fixes[0]]
    velocity = velocity_of(log.fixes)[fixes]
    place = log.fixes.position[fixes[0]]
    shown = velocity - velocity[0] + np.outer(spent, [0.0, 0.0, normal_gravity(place[0], place[2])])
    motion = _Motion(log, time[fixes])
    solved = _solve(motion, shown, spent)
    before, felt = solved.rotation, solved.felt
    if not before[2] @ (felt[-1] / np.linalg.norm(felt[-1])) > np.cos(MAX_TILT):
        return None
    sigma = max(solved.sigma, LEAST_HEADING_SIGMA)
    return Matched(int(fixes[0]), int(fixes[-1]), before, before @ solved.turned, sigma)


class _Motion:
    """What the IMU felt between some times, for any bias of its gyro."""

    def __init__(self, log: Log, time: Floats) -> None:
        inside = (log.imu_time > time[0]) & (log.imu_time < time[-1])
        grid = np.union1d(log.imu_time[inside], time)
        self._step = np.diff(grid)[:, None]
        self._turns, self._pushes = (
            _increments(grid, log.imu_time, running_integral(log.imu_time, samples))
            for samples in (log.angular_rate, log.specific_force)
        )
        self._places = np.searchsorted(grid, time)

    def __call__(self, bias: Floats) -> tuple[Floats, Floats]:
        """From the first time on: attitude at the last one in the axes of the first, and what was felt until each.

        Args:
            bias: of the gyro, (3,), rad/s.

        Returns:
            Rotation (3, 3), and integrals of the specific force in the axes of the first time, (n, 3), m/s.
        """
        turns = self._turns - bias * self._step
        steps, halves = (np.asarray(Rotation.from_rotvec(share * turns).as_matrix()) for share in (1.0, 0.5))
        attitude = np.empty((len(turns) + 1, 3, 3))
        attitude[0] = np.eye(3)
        for k, step in enumerate(steps):
            attitude[k + 1] = attitude[k] @ step
        pushed = np.einsum("nij,njk,nk->ni", attitude[:-1], halves, self._pushes)
        felt = np.concatenate([np.zeros((1, 3)), np.cumsum(pushed, axis=0)])
        return attitude[-1], felt[self._places]


def _increments(grid: Floats, time: Floats, integral: Floats) -> Floats:
    """Of a running integral at times, between the times of a grid, (len(grid) - 1, 3)."""
    return np.diff(np.column_stack([np.interp(grid, time, axis) for axis in integral.T]), axis=0)


@dataclass(frozen=True, eq=False)
class _Solved:
    """A rotation that lays what was felt upon what the fixes show.

    Attributes:
        rotation: axes of the beginning to ENU, (3, 3).
        turned: attitude at the end in the axes of the beginning, (3, 3).
        felt: in these axes, (n, 3), m/s.
        sigma: of the heading, rad.
    """

    rotation: Floats
    turned: Floats
    felt: Floats
    sigma: float


def _solve(motion: _Motion, shown: Floats, spent: Floats) -> _Solved:
    """Wahba's rotation, refined by least squares that know what may be wrong.

    Unknown are the rotation (E, N, U), the error of the first velocity, and constant biases of accelerations and gyro.
    """
    bias = np.zeros(3)
    turned, felt = motion(bias)
    rotation = _wahba(shown[1:], felt[1:])
    variance, sigma = 1.0, np.inf
    for k in range(ITERATIONS):
        steeper = [(motion(bias + BIAS_STEP * axis)[1] - felt) / BIAS_STEP for axis in np.eye(3)]
        slopes = np.stack([slope[1:] @ rotation.T for slope in steeper], axis=2)
        rows = np.hstack([_design(felt[1:] @ rotation.T, spent[1:]), slopes.reshape(-1, 3)])
        residual = (shown - felt @ rotation.T)[1:].ravel()
        # the prior of the gyro's bias is about zero, wherever the iteration stands
        covariance = np.linalg.inv(rows.T @ rows / variance + np.diag(PRIOR))
        known = np.concatenate([np.zeros(9), -bias]) * PRIOR
        change = covariance @ (rows.T @ residual / variance + known)
        variance = max(float(np.mean((residual - rows @ change) ** 2)), LEAST_VARIANCE)
        rotation = np.asarray(Rotation.from_rotvec(change[:3]).as_matrix()) @ rotation
        bias = bias + change[9:]
        turned, felt = motion(bias)
        sigma = float(CORRELATED * np.sqrt(covariance[2, 2]))
        if k and np.linalg.norm(change[:3]) < CONVERGED:  # the first variance was a guess
            break
    return _Solved(rotation, turned, felt, sigma)


def _wahba(shown: Floats, felt: Floats) -> Floats:
    """The rotation that brings vectors (n, 3) nearest to others, (3, 3); about a common direction it is any.

    By singular values (Markley 1988).
    """
    left, _, right = np.linalg.svd(shown.T @ felt)
    return np.asarray(left @ np.diag([1.0, 1.0, np.linalg.det(left) * np.linalg.det(right)]) @ right)


def _design(turned: Floats, spent: Floats) -> Floats:
    """How the unknowns move what was felt, (3 n, 9); a small rotation θ moves a vector v by θ x v."""
    east, north, up = turned.T
    zero = np.zeros(len(turned))
    design = np.zeros((len(turned), 3, 9))
    design[:, 0, :3] = np.column_stack([zero, up, -north])
    design[:, 1, :3] = np.column_stack([-up, zero, east])
    design[:, 2, :3] = np.column_stack([north, -east, zero])
    design[:, :, 3:6] = np.eye(3)
    design[:, :, 6:] = spent[:, None, None] * np.eye(3)
    return design.reshape(-1, 9)
