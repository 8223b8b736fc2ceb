"""When a filter at the IMU rate has diverged: its solution has left the range in which the mechanization holds.

A spoofer can push a nonlinear filter so far that attitude and velocity lose all meaning. What is computed from there on
grows without bound and ends in NaN. A diverged run is therefore held at its last valid solution, with the covariance
that it began with, so that every number that leaves the navigator stays finite, and it is marked.
"""

from __future__ import annotations

import math
from typing import NamedTuple

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


class Solution(NamedTuple):
    """Inertial solutions of N runs, or, without the leading axis, of one run.

    Attributes:
        attitude: C, body to ENU, (N, 3, 3).
        velocity: ENU, (N, 3), m/s.
        position: latitude rad, longitude rad, height m, (N, 3).
        bias: estimated gyro and accelerometer biases, (N, 6), rad/s and m/s².
    """

    attitude: Floats
    velocity: Floats
    position: Floats
    bias: Floats


@njit(cache=True, nogil=True, error_model="numpy")
def solution_of(run: int, solution: Solution) -> Solution:
    """The solution of one run: views of the arrays of all runs."""
    return Solution(solution.attitude[run], solution.velocity[run], solution.position[run], solution.bias[run])


@njit(cache=True, nogil=True, error_model="numpy")
def valid(solution: Solution, covariance: Floats) -> bool:
    """Whether the solution of one run can be carried on; covariance P, (n, n)."""
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += solution.attitude[i, j]
    for i in range(6):
        total += solution.bias[i]
    for i in range(len(covariance)):
        if not covariance[i, i] >= 0.0:
            return False
        total += covariance[i, i]
    velocity, position = solution.velocity, solution.position
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
    solution: Solution,
    covariance: Floats,
    auxiliary: Floats,
    prior_covariance: Floats,
    held: Floats,
    diverged: Flags,
) -> None:
    """Keep the solutions of runs that are valid, and put runs that have diverged back to their last valid one.

    Args:
        runs: which, (n,).
        solution: of all runs, in place.
        covariance: P, (N, n, n), in place.
        auxiliary: the unaided solution minus the filter's, (N, 15) or (N, 0), in place; zero in a diverged run.
        prior_covariance: that of a diverged run, (n, n).
        held: the last valid solutions, (N, 21), in place.
        diverged: whether each run has ever diverged in its episode, (N,), in place.
    """
    for run in runs:
        own, kept = solution_of(run, solution), held[run]
        if not diverged[run]:
            diverged[run] = not valid(own, covariance[run])
        if diverged[run]:
            auxiliary[run] = 0.0
            # element by element: a kernel that assigns an array to a part of another takes seconds more to compile
            for i in range(covariance.shape[1]):
                for j in range(covariance.shape[2]):
                    covariance[run, i, j] = prior_covariance[i, j]
            for i in range(9):
                own.attitude[i // 3, i % 3] = kept[i]
            for i in range(3):
                own.velocity[i], own.position[i] = kept[9 + i], kept[12 + i]
            for i in range(6):
                own.bias[i] = kept[15 + i]
        else:
            for i in range(9):
                kept[i] = own.attitude[i // 3, i % 3]
            for i in range(3):
                kept[9 + i], kept[12 + i] = own.velocity[i], own.position[i]
            for i in range(6):
                kept[15 + i] = own.bias[i]


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
