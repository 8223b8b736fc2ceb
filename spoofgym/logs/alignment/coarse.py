"""Coarse alignment in motion, whichever way the vehicle looks: what the IMU felt is laid upon what the fixes show.

Over some tens of seconds the integrated specific force, in the axes that the vehicle had at the beginning, must be the
change of velocity plus gravity times time. The rotation that makes it so is Wahba's (velocity matching by optimisation:
Wu and Pan 2013, "Velocity/position integration formula part I"); a linear refinement gives its sigma, and takes the
error of the first velocity and the biases of the accelerometers along. The rotation of the Earth, 0.25 degrees a minute,
is left out.
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
STRIDE = 15.0
"""Between the beginnings that are tried, s."""
GOOD_SIGMA, LARGEST_SIGMA = np.radians(5.0), np.radians(15.0)
"""Of the heading: where the search ends, and beyond which nothing is known, rad."""
LEVEL_SIGMA = np.radians(2.0)
LEAST_HEADING_SIGMA = np.radians(2.0)
"""Floors of what is claimed, rad: tilt and bias of the accelerometer cannot be told apart."""
CORRELATED = 3.0
"""Factor on the sigma of residuals that are taken as white."""
FEWEST_FIXES = 8
ITERATIONS = 5
LEAST_VARIANCE = 1e-4
"""Of a residual, (m/s)²."""
SIGMA_OF_ACCELERATION = 0.3
"""Bias that the refinement allows an accelerometer, m/s²."""
SIGMA_OF_VELOCITY = 1.0
"""Error that it allows the first velocity, m/s."""


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
    while begin < log.fixes.time[-1] - WINDOWS[0]:
        for length in WINDOWS:
            found = match(log, begin, begin + length)
            if found is not None and (best is None or found.heading_sigma < best.heading_sigma):
                best = found
            if best is not None and best.heading_sigma <= GOOD_SIGMA:
                return _aligned(log, best)
        begin += STRIDE
    if best is None or best.heading_sigma > LARGEST_SIGMA:
        known = "not at all" if best is None else f"to {np.degrees(best.heading_sigma):.2g}°"
        raise ValueError(
            f"log {str(log.folder)!r}: alignment coarse: the accelerations after start_s = {seconds(log.start)} s tell "
            f"the heading {known}, needed are {np.degrees(LARGEST_SIGMA):g}°; the vehicle must speed up, brake or turn, "
            "or state heading_deg in log.toml"
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
    turned, felt = _integrate(log, time[fixes])
    spent = time[fixes] - time[fixes[0]]
    velocity = velocity_of(log.fixes)[fixes]
    place = log.fixes.position[fixes[0]]
    shown = velocity - velocity[0] + np.outer(spent, [0.0, 0.0, normal_gravity(place[0], place[2])])
    rotation, _ = Rotation.align_vectors(shown[1:], felt[1:])
    before, sigma = _refined(np.asarray(rotation.as_matrix()), shown, felt, spent)
    if not before[2] @ (felt[-1] / np.linalg.norm(felt[-1])) > np.cos(MAX_TILT):
        return None
    return Matched(int(fixes[0]), int(fixes[-1]), before, before @ turned, max(sigma, float(LEAST_HEADING_SIGMA)))


def _integrate(log: Log, time: Floats) -> tuple[Floats, Floats]:
    """From the first of some times on: attitude at the last one in the axes of the first, and what was felt until each.

    Args:
        log: with body axes.
        time: of fixes, (n,), s.

    Returns:
        Rotation (3, 3), and integrals of the specific force in the axes of the first time, (n, 3), m/s.
    """
    inside = (log.imu_time > time[0]) & (log.imu_time < time[-1])
    grid = np.union1d(log.imu_time[inside], time)
    turns, pushes = (
        _increments(grid, log.imu_time, running_integral(log.imu_time, samples))
        for samples in (log.angular_rate, log.specific_force)
    )
    steps, halves = (np.asarray(Rotation.from_rotvec(share * turns).as_matrix()) for share in (1.0, 0.5))
    attitude = np.empty((len(grid), 3, 3))
    attitude[0] = np.eye(3)
    for k, step in enumerate(steps):
        attitude[k + 1] = attitude[k] @ step
    pushed = np.einsum("nij,njk,nk->ni", attitude[:-1], halves, pushes)
    felt = np.concatenate([np.zeros((1, 3)), np.cumsum(pushed, axis=0)])
    return attitude[-1], felt[np.searchsorted(grid, time)]


def _increments(grid: Floats, time: Floats, integral: Floats) -> Floats:
    """Of a running integral at times, between the times of a grid, (len(grid) - 1, 3)."""
    return np.diff(np.column_stack([np.interp(grid, time, axis) for axis in integral.T]), axis=0)


def _refined(rotation: Floats, shown: Floats, felt: Floats, spent: Floats) -> tuple[Floats, float]:
    """The rotation by least squares that knows what may be wrong, and the sigma of its heading, rad.

    Unknown are the rotation (E, N, U), the error of the first velocity and a constant bias of the accelerations.
    """
    prior = np.diag([0.0] * 3 + [SIGMA_OF_VELOCITY**-2] * 3 + [SIGMA_OF_ACCELERATION**-2] * 3)
    variance, covariance = 1.0, np.eye(9)
    for _ in range(ITERATIONS):
        turned = felt[1:] @ rotation.T
        rows, residual = _design(turned, spent[1:]), (shown[1:] - turned).ravel()
        covariance = np.linalg.inv(rows.T @ rows / variance + prior)
        change = covariance @ (rows.T @ residual) / variance
        variance = max(float(np.mean((residual - rows @ change) ** 2)), LEAST_VARIANCE)
        rotation = np.asarray(Rotation.from_rotvec(change[:3]).as_matrix()) @ rotation
    return rotation, float(CORRELATED * np.sqrt(covariance[2, 2]))


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
