"""When a filter at the IMU rate has diverged: its solution has left the range in which the mechanization holds.

A spoofer can push a nonlinear filter so far that attitude and velocity lose all meaning. What is computed from there on
grows without bound and ends in NaN. A diverged run is therefore held at its last valid solution, with the covariance
that it began with, so that every number that leaves the navigator stays finite, and it is marked.
"""

from __future__ import annotations

import math

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.kernels import njit

MAX_LATITUDE = math.radians(89.9)
"""East has no meaning at a pole: the transport rate grows with the tangent of the latitude, rad."""
MIN_HEIGHT, MAX_HEIGHT = -3e6, 1e8
"""Radii of curvature plus height stay positive, m."""
MAX_SPEED = 1e6
"""Per axis, m/s; the frame turns by 0.16 rad/s then."""
NUM_HELD = 21
"""Attitude (9), velocity (3), position (3) and biases (6)."""


class FilterDivergedError(ArithmeticError):
    """The solution of a run has left the range in which the mechanization holds."""


def diverged_error(run: int, time: float) -> FilterDivergedError:
    """The error of a run that diverged at ``time``, s."""
    return FilterDivergedError(
        f"the filter of run {run} diverged at {time!r} s: its solution has left the range in which the mechanization "
        f"holds (latitude within {math.degrees(MAX_LATITUDE):.1f} degrees, height from {MIN_HEIGHT:.0f} to "
        f"{MAX_HEIGHT:.0f} m, speed up to {MAX_SPEED:.0f} m/s), or its covariance is no longer positive; the offsets "
        "are too large for this filter"
    )


@njit(cache=True, nogil=True, error_model="numpy")
def valid(attitude: Floats, velocity: Floats, position: Floats, bias: Floats, covariance: Floats) -> bool:
    """Whether the solution of one run can be carried on; shapes (3, 3), (3,), (3,), (6,), (n, n)."""
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += attitude[i, j]
    for i in range(6):
        total += bias[i]
    for i in range(len(covariance)):
        if not covariance[i, i] >= 0.0:
            return False
        total += covariance[i, i]
    fast = max(abs(velocity[0]), max(abs(velocity[1]), abs(velocity[2])))
    return (
        math.isfinite(total)
        and math.isfinite(position[1])
        and fast <= MAX_SPEED
        and abs(position[0]) <= MAX_LATITUDE
        and MIN_HEIGHT <= position[2] <= MAX_HEIGHT
    )


@njit(cache=True, nogil=True, error_model="numpy")
def hold(
    runs: Runs,
    attitude: Floats,
    velocity: Floats,
    position: Floats,
    bias: Floats,
    covariance: Floats,
    auxiliary: Floats,
    prior_covariance: Floats,
    held: Floats,
    diverged: Flags,
) -> None:
    """Keep the solutions of runs that are valid, and put runs that have diverged back to their last valid one.

    Args:
        runs: which, (n,).
        attitude: of all runs, (N, 3, 3), in place.
        velocity: (N, 3), m/s, in place.
        position: (N, 3), latitude rad, longitude rad, height m, in place.
        bias: (N, 6), in place.
        covariance: P, (N, n, n), in place.
        auxiliary: the unaided solution minus the filter's, (N, 15) or (N, 0), in place; zero in a diverged run.
        prior_covariance: that of a diverged run, (n, n).
        held: the last valid solutions, (N, 21), in place.
        diverged: whether each run has ever diverged in its episode, (N,), in place.
    """
    for run in runs:
        if not diverged[run]:
            diverged[run] = not valid(attitude[run], velocity[run], position[run], bias[run], covariance[run])
        solution = held[run]
        if diverged[run]:
            covariance[run], auxiliary[run] = prior_covariance, 0.0
            for i in range(9):
                attitude[run, i // 3, i % 3] = solution[i]
            for i in range(3):
                velocity[run, i], position[run, i] = solution[9 + i], solution[12 + i]
            for i in range(6):
                bias[run, i] = solution[15 + i]
        else:
            for i in range(9):
                solution[i] = attitude[run, i // 3, i % 3]
            for i in range(3):
                solution[9 + i], solution[12 + i] = velocity[run, i], position[run, i]
            for i in range(6):
                solution[15 + i] = bias[run, i]


def blank(places: Runs, residual: Floats, covariance: Floats, whitened: Floats, nis: Floats) -> None:
    """Put zeros, and a unit covariance, in place of innovations that are not finite.

    Args:
        places: where they stand, (k,).
        residual: (n, m), in place.
        covariance: (n, m, m), in place.
        whitened: (n, m), in place.
        nis: (n,), in place.
    """
    residual[places], whitened[places], nis[places] = 0.0, 0.0, 0.0
    covariance[places] = np.eye(residual.shape[1])
