"""Position, velocity and clock of a receiver by weighted least squares of its ranges and range rates.

A range is |satellite - receiver| + clock + error. The satellite's position is in the Earth-fixed frame at the moment of
reception (`received_states`), and the receiver's clock is a length. An error is estimate minus truth. If an epoch has
fewer than four satellites, or their geometry gives no fix, its results are NaN and its ``solved`` is False; this raises
no exception.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.geodesy import ecef_to_geodetic, geodetic_to_ecef
from spoofgym.kernels import njit
from spoofgym.sensors.geometry import invert_normal, lines_of_sight, normal_inverse

ITERATIONS = 20
CONVERGED = 1e-4
"""Length of the last Gauss-Newton step, m: what it leaves is of the order of its square over the range, 1e-15 m."""


@dataclass(frozen=True)
class Fix:
    """Fixes of n epochs or runs.

    Attributes:
        position: latitude rad, longitude rad, height m, (n, 3).
        clock: offset of the receiver's clock as a range, (n,), m.
        residual: measured minus predicted range, 0 where absent, (n, S), m.
        covariance: of (E, N, U, clock) under the given sigmas, (n, 4, 4), m².
        solved: (n,); all else is NaN where False.
    """

    position: Floats
    clock: Floats
    residual: Floats
    covariance: Floats
    solved: Flags


@dataclass(frozen=True)
class VelocityFix:
    """Velocities of n epochs or runs.

    Attributes:
        velocity: of the receiver against the Earth, ENU, (n, 3), m/s.
        clock_drift: of the receiver's clock as a range rate, (n,), m/s.
        residual: measured minus predicted range rate, 0 where absent, (n, S), m/s.
        covariance: of (E, N, U, clock drift) under the given sigmas, (n, 4, 4), m²/s².
        solved: (n,); all else is NaN where False.
    """

    velocity: Floats
    clock_drift: Floats
    residual: Floats
    covariance: Floats
    solved: Flags


def fix(position: Floats, pseudorange: Floats, present: Flags, sigma: Floats, start: Floats) -> Fix:
    """Position and clock from pseudoranges by Gauss-Newton (Groves 2013, section 9.4.1), every epoch by itself.

    Args:
        position: of the satellites, ECEF at reception, (n, S, 3), m.
        pseudorange: corrected for the satellites' clocks and what else is known, (n, S), m.
        present: ranges to use, (n, S).
        sigma: of the ranges, (n, S), m.
        start: where to begin, latitude rad, longitude rad, height m, (n, 3) or (3,); any place on Earth will do.

    Raises:
        ValueError: a shape does not fit, or a sigma of a range to use is not greater than 0.
    """
    number, slots = pseudorange.shape
    weight = _weights("fix", present, sigma, (number, slots))
    _shape("fix", "position", position, (number, slots, 3))
    begin = np.broadcast_to(np.asarray(start, dtype=np.float64), (number, 3))
    state = np.zeros((number, 4))
    state[:, :3] = geodetic_to_ecef(begin)
    residual = np.zeros((number, slots))
    _gauss_newton(
        np.ascontiguousarray(position), np.ascontiguousarray(pseudorange, dtype=np.float64), weight, state, residual
    )
    solved = np.isfinite(state[:, 0])
    place = ecef_to_geodetic(np.where(solved[:, None], state[:, :3], geodetic_to_ecef(begin)))
    sight = lines_of_sight(position, place)
    covariance = normal_inverse(sight, weight)
    solved &= np.isfinite(covariance[:, 0, 0])
    for values in (place, state, residual, covariance):
        values[~solved] = np.nan
    return Fix(place, state[:, 3], residual, covariance, solved)


def velocity_fix(
    position: Floats, velocity: Floats, range_rate: Floats, present: Flags, sigma: Floats, receiver_position: Floats
) -> VelocityFix:
    """Velocity and clock drift from range rates (Groves 2013, section 9.4.1), every epoch by itself.

    Args:
        position: of the satellites, ECEF at reception, (n, S, 3), m.
        velocity: its rate of change for a receiver at rest, as in `SatelliteGeometry`: with the turn of the Earth while
            the signal flies, (n, S, 3), m/s.
        range_rate: corrected for the drift of the satellites' clocks, (n, S), m/s.
        present: range rates to use, (n, S).
        sigma: of the range rates, (n, S), m/s.
        receiver_position: latitude rad, longitude rad, height m, (n, 3).

    Raises:
        ValueError: a shape does not fit, or a sigma of a range rate to use is not greater than 0.
    """
    weight = _weights("velocity fix", present, sigma, range_rate.shape)
    for name, values in (("position", position), ("velocity", velocity)):
        _shape("velocity fix", name, values, (*range_rate.shape, 3))
    sight = np.ascontiguousarray(lines_of_sight(position, receiver_position))
    away = position - geodetic_to_ecef(receiver_position)[:, None]
    distance = np.sqrt(away[..., 0] ** 2 + away[..., 1] ** 2 + away[..., 2] ** 2)
    product = away * velocity
    at_rest = (product[..., 0] + product[..., 1] + product[..., 2]) / distance
    misfit = np.where(weight > 0.0, range_rate - at_rest, 0.0)
    covariance = normal_inverse(sight, weight)
    solution = np.empty((len(misfit), 4))
    residual = np.empty(misfit.shape)
    _solve(sight, weight, covariance, misfit, solution, residual)
    solved = np.isfinite(solution[:, 0])
    residual[~solved] = np.nan
    return VelocityFix(solution[:, :3], solution[:, 3], residual, covariance, solved)


def projection(line_of_sight: Floats, present: Flags, weight: Floats) -> Floats:
    """The matrix (G' W G)⁻¹ G' W that turns errors of ranges into the error of the fix.

    G has the rows [-line of sight, 1]: a range that is measured too long pulls the fix away from its satellite.

    Args:
        line_of_sight: (E, S, 3), ENU.
        present: (E, S).
        weight: 1/σ² of every range, (E, S).

    Returns:
        (E, 4, S): error of (E, N, U, clock) in m per m of every range; absent ones have 0, all is NaN where there is no
        fix.

    Raises:
        ValueError: a shape does not fit.
    """
    used = np.where(present, weight, 0.0)
    _shape("projection", "line_of_sight", line_of_sight, (*used.shape, 3))
    matrix = np.empty((len(used), 4, used.shape[1]))
    _project(np.ascontiguousarray(line_of_sight), used, normal_inverse(line_of_sight, used), matrix)
    return matrix


@njit(cache=True, nogil=True, error_model="numpy")
def _gauss_newton(position: Floats, pseudorange: Floats, weight: Floats, state: Floats, residual: Floats) -> None:
    """Iterate ``state`` (ECEF, clock) of every epoch from its start; NaN where it does not converge."""
    slots = weight.shape[1]
    sight = np.zeros((slots, 3))
    inverse = np.empty((4, 4))
    step = np.empty(4)
    for k in range(len(state)):
        converged = False
        for _ in range(ITERATIONS):
            _misfit(position[k], pseudorange[k], weight[k], state[k], sight, residual[k])
            invert_normal(sight, weight[k], inverse)
            _estimate(sight, weight[k], inverse, residual[k], step)
            state[k] += step
            length = math.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
            if not length >= CONVERGED:
                converged = length < CONVERGED
                break
        _misfit(position[k], pseudorange[k], weight[k], state[k], sight, residual[k])
        if not converged:
            state[k] = np.nan


@njit(cache=True, nogil=True, error_model="numpy")
def _misfit(
    position: Floats, pseudorange: Floats, weight: Floats, state: Floats, sight: Floats, residual: Floats
) -> None:
    """Lines of sight (S, 3) and measured minus predicted range (S,) of one epoch."""
    for s in range(len(weight)):
        if weight[s] == 0.0:
            residual[s] = 0.0
            continue
        x, y, z = position[s, 0] - state[0], position[s, 1] - state[1], position[s, 2] - state[2]
        distance = math.sqrt(x * x + y * y + z * z)
        sight[s, 0], sight[s, 1], sight[s, 2] = x / distance, y / distance, z / distance
        residual[s] = pseudorange[s] - distance - state[3]


@njit(cache=True, nogil=True, error_model="numpy")
def _estimate(sight: Floats, weight: Floats, inverse: Floats, misfit: Floats, solution: Floats) -> None:
    """(G' W G)⁻¹ G' W times the misfit of one epoch."""
    pull = np.zeros(4)
    for s in range(len(weight)):
        if weight[s] > 0.0:
            pull[:3] -= weight[s] * misfit[s] * sight[s]
            pull[3] += weight[s] * misfit[s]
    for i in range(4):
        solution[i] = (
            inverse[i, 0] * pull[0] + inverse[i, 1] * pull[1] + inverse[i, 2] * pull[2] + inverse[i, 3] * pull[3]
        )


@njit(cache=True, nogil=True, error_model="numpy")
def _solve(sight: Floats, weight: Floats, inverse: Floats, misfit: Floats, solution: Floats, residual: Floats) -> None:
    """Linear least squares of every epoch, and what it leaves of the misfit."""
    for k in range(len(solution)):
        _estimate(sight[k], weight[k], inverse[k], misfit[k], solution[k])
        for s in range(weight.shape[1]):
            residual[k, s] = 0.0
            if weight[k, s] > 0.0:
                residual[k, s] = misfit[k, s] - solution[k, 3]
                for i in range(3):
                    residual[k, s] += sight[k, s, i] * solution[k, i]


@njit(cache=True, nogil=True, error_model="numpy")
def _project(sight: Floats, weight: Floats, inverse: Floats, matrix: Floats) -> None:
    for k in range(len(matrix)):
        for s in range(weight.shape[1]):
            for i in range(4):
                value = inverse[k, i, 3]
                for j in range(3):
                    value -= inverse[k, i, j] * sight[k, s, j]
                matrix[k, i, s] = weight[k, s] * value


def _weights(owner: str, present: Flags, sigma: Floats, shape: tuple[int, ...]) -> Floats:
    """1/σ² of the ranges to use, 0 of the others."""
    _shape(owner, "present", present, shape)
    _shape(owner, "sigma", sigma, shape)
    if not (sigma[present] > 0.0).all():
        raise ValueError(f"{owner}: sigma must be greater than 0 where a range is present, got {sigma[present].min()}")
    return np.where(present, 1.0 / np.where(present, sigma, 1.0) ** 2, 0.0)


def _shape(owner: str, name: str, values: Floats | Flags, shape: tuple[int, ...]) -> None:
    if values.shape != shape:
        raise ValueError(f"{owner}: {name} must have the shape {shape}, got {values.shape}")
