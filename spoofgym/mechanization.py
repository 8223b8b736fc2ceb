"""Strapdown mechanization in ENU with a right-forward-up body, one IMU step at a time, and its exact inverse.

One step of length dt with body rate w and specific force f (mean values over the step) does, in this order,

    C_half = Exp(-w_in dt/2) C Exp(w dt/2)
    v_half = v + dt/2 (C_half f + g - (2 w_ie + w_en) x v)
    v'     = v + dt (C_half f + g_half - (2 w_ie + w_en_half) x v_half)
    p'     = p moved by the mean of v and v'
    C'     = Exp(-w_in' dt/2) C_half Exp(w dt/2),   w_in' with the velocity v'

which is of second order in dt throughout. It can be solved for w and f, so the inertial measurements that belong to a
trajectory are exact: mechanized, they give the trajectory back to rounding.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spoofgym.geodesy import earth_rate, normal_gravity, radii_of_curvature, transport_rate
from spoofgym.kernels import njit

Vector = tuple[float, float, float]
Matrix = tuple[float, float, float, float, float, float, float, float, float]
"""A 3 x 3 matrix as nine scalars, row by row: kernels keep it in registers."""
_INVERSION_ITERATIONS = 3
"""Each shrinks the error of the force by the rotation of the frame in half a step, 1e-6 at 100 Hz."""
_S1, _S2, _S3, _S4 = -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362880.0
_C1, _C2, _C3, _C4 = -1.0 / 24.0, 1.0 / 720.0, -1.0 / 40320.0, 1.0 / 3628800.0


def attitude_matrix(
    pitch: float | NDArray[np.float64], roll: float | NDArray[np.float64], yaw: float | NDArray[np.float64]
) -> NDArray[np.float64]:
    """Attitude C_b^n, body (right, forward, up) to ENU (Liu 2018 eq A9).

    Args:
        pitch: rad, positive nose up, any shape.
        roll: rad, positive right wing down, same shape.
        yaw: rad, clockwise from north, same shape.

    Returns:
        (..., 3, 3). Its columns are the right, forward and up axes in ENU.
    """
    pitch, roll, yaw = np.broadcast_arrays(pitch, roll, yaw)
    sin_pitch, cos_pitch = np.sin(pitch), np.cos(pitch)
    sin_roll, cos_roll = np.sin(roll), np.cos(roll)
    sin_yaw, cos_yaw = np.sin(yaw), np.cos(yaw)
    matrix = np.empty((*pitch.shape, 3, 3))
    matrix[..., 0, 0] = cos_roll * cos_yaw + sin_roll * sin_yaw * sin_pitch
    matrix[..., 0, 1] = sin_yaw * cos_pitch
    matrix[..., 0, 2] = sin_roll * cos_yaw - cos_roll * sin_yaw * sin_pitch
    matrix[..., 1, 0] = -cos_roll * sin_yaw + sin_roll * cos_yaw * sin_pitch
    matrix[..., 1, 1] = cos_yaw * cos_pitch
    matrix[..., 1, 2] = -sin_roll * sin_yaw - cos_roll * cos_yaw * sin_pitch
    matrix[..., 2, 0] = -sin_roll * cos_pitch
    matrix[..., 2, 1] = sin_pitch
    matrix[..., 2, 2] = cos_roll * cos_pitch
    return matrix


@njit(cache=True, nogil=True, error_model="numpy")
def rotation(x: float, y: float, z: float) -> Matrix:
    """Exp of a rotation vector (Rodrigues; Groves 2013 eq 5.73): cos I + sin/angle [v x] + (1 - cos)/angle^2 v v^T.

    Series, exact to rounding, below 0.14 rad; the library's sine above.

    Args:
        x: rad.
        y: rad.
        z: rad.

    Returns:
        Rotation matrix, row by row.
    """
    square = x * x + y * y + z * z
    if square < 0.02:
        sine = 1.0 + square * (_S1 + square * (_S2 + square * (_S3 + square * _S4)))
        versine = 0.5 + square * (_C1 + square * (_C2 + square * (_C3 + square * _C4)))
    else:
        angle = math.sqrt(square)
        sine = math.sin(angle) / angle
        versine = 2.0 * (math.sin(0.5 * angle) / angle) ** 2
    cosine = 1.0 - versine * square
    xy, xz, yz = versine * x * y, versine * x * z, versine * y * z
    x_sine, y_sine, z_sine = sine * x, sine * y, sine * z
    return (
        cosine + versine * x * x,
        xy - z_sine,
        xz + y_sine,
        xy + z_sine,
        cosine + versine * y * y,
        yz - x_sine,
        xz - y_sine,
        yz + x_sine,
        cosine + versine * z * z,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def rotation_vector(matrix: Matrix) -> Vector:
    """Rotation vector of a rotation matrix by less than pi; the inverse of `rotation`.

    Args:
        matrix: Row by row.

    Returns:
        Rotation vector, rad.
    """
    x = 0.5 * (matrix[7] - matrix[5])
    y = 0.5 * (matrix[2] - matrix[6])
    z = 0.5 * (matrix[3] - matrix[1])
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 1.0
    if sine > 0.0:
        scale = math.atan2(sine, 0.5 * (matrix[0] + matrix[4] + matrix[8] - 1.0)) / sine
    return scale * x, scale * y, scale * z


@njit(cache=True, nogil=True, error_model="numpy")
def product(a: Matrix, b: Matrix) -> Matrix:
    """Product of two 3 x 3 matrices, row by row."""
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


@njit(cache=True, nogil=True, error_model="numpy")
def transpose(a: Matrix) -> Matrix:
    """Transpose of a 3 x 3 matrix, row by row."""
    return a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8]


@njit(cache=True, nogil=True, error_model="numpy")
def transform(a: Matrix, x: float, y: float, z: float) -> Vector:
    """Product of a 3 x 3 matrix and a vector."""
    return a[0] * x + a[1] * y + a[2] * z, a[3] * x + a[4] * y + a[5] * z, a[6] * x + a[7] * y + a[8] * z


@njit(cache=True, nogil=True, error_model="numpy")
def load_matrix(array: NDArray[np.float64]) -> Matrix:
    """Nine scalars of an array (3, 3), row by row."""
    a = array
    return a[0, 0], a[0, 1], a[0, 2], a[1, 0], a[1, 1], a[1, 2], a[2, 0], a[2, 1], a[2, 2]


@njit(cache=True, nogil=True, error_model="numpy")
def frame_rate(latitude: float, height: float, east_velocity: float, north_velocity: float) -> Vector:
    """Rotation of the ENU frame against inertial space, w_in = w_ie + w_en.

    Args:
        latitude: rad.
        height: m.
        east_velocity: m/s.
        north_velocity: m/s.

    Returns:
        East, north, up, rad/s.
    """
    earth = earth_rate(latitude)
    transport = transport_rate(latitude, height, east_velocity, north_velocity)
    return earth[0] + transport[0], earth[1] + transport[1], earth[2] + transport[2]


@njit(cache=True, nogil=True, error_model="numpy")
def gravity_and_coriolis(latitude: float, height: float, east: float, north: float, up: float) -> Vector:
    """Acceleration over the ground without specific force, g - (2 w_ie + w_en) x v (Groves 2013 eq 5.53).

    Args:
        latitude: rad.
        height: m.
        east: East velocity, m/s.
        north: North velocity, m/s.
        up: Up velocity, m/s.

    Returns:
        East, north, up, m/s^2.
    """
    earth = earth_rate(latitude)
    transport = transport_rate(latitude, height, east, north)
    x, y, z = 2.0 * earth[0] + transport[0], 2.0 * earth[1] + transport[1], 2.0 * earth[2] + transport[2]
    return (
        z * north - y * up,
        x * up - z * east,
        y * east - x * north - normal_gravity(latitude, height),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def mean_gravity_and_coriolis(
    latitude: float, height: float, east: float, north: float, up: float, force: Vector, dt: float
) -> Vector:
    """`gravity_and_coriolis` in the middle of a step, where the velocity is v_half (head of this file).

    Args:
        latitude: At the start, rad.
        height: At the start, m.
        east: Velocity at the start, m/s.
        north: Velocity at the start, m/s.
        up: Velocity at the start, m/s.
        force: Specific force east, north, up, mean over the step, m/s^2.
        dt: s.

    Returns:
        East, north, up, m/s^2.
    """
    half = 0.5 * dt
    other = gravity_and_coriolis(latitude, height, east, north, up)
    return gravity_and_coriolis(
        latitude,
        height + half * up,
        east + half * (force[0] + other[0]),
        north + half * (force[1] + other[1]),
        up + half * (force[2] + other[2]),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def advance_position(
    latitude: float, longitude: float, height: float, east: float, north: float, up: float, dt: float
) -> Vector:
    """Position after dt at a constant velocity, the mean of a step's ends (trapezoid rule; after Groves 2013 eq 5.56).

    Radii at the start, height and the cosine of the latitude in the middle of the step.

    Args:
        latitude: rad.
        longitude: rad.
        height: m.
        east: m/s.
        north: m/s.
        up: m/s.
        dt: s.

    Returns:
        Latitude rad, longitude rad, height m.
    """
    meridian, transverse = radii_of_curvature(latitude)
    middle = height + 0.5 * dt * up
    northward = dt * north / (meridian + middle)
    half = 0.5 * northward
    cosine = math.cos(latitude) * (1.0 - 0.5 * half * half) - math.sin(latitude) * half
    return latitude + northward, longitude + dt * east / ((transverse + middle) * cosine), height + dt * up


@njit(cache=True, nogil=True, error_model="numpy")
def mechanize(
    attitude: NDArray[np.float64],
    velocity: NDArray[np.float64],
    position: NDArray[np.float64],
    angular_rate: NDArray[np.float64],
    specific_force: NDArray[np.float64],
    dt: float,
    mean_force: NDArray[np.float64],
) -> None:
    """One IMU step in place (the scheme is at the head of this file; compare Groves 2013 section 5.4).

    Args:
        attitude: (3, 3) body to ENU, overwritten.
        velocity: (3,) ENU, m/s, overwritten.
        position: (3,) latitude rad, longitude rad, height m, overwritten.
        angular_rate: (3,) body against inertial space, right, forward, up, mean over the step, rad/s.
        specific_force: (3,) right, forward, up, mean over the step, m/s^2.
        dt: Length of the step, s.
        mean_force: (3,) dt times the specific force in ENU is added to it, m/s: over an epoch, its integral.
    """
    latitude, longitude, height = position[0], position[1], position[2]
    east, north, up = velocity[0], velocity[1], velocity[2]
    half = 0.5 * dt
    frame = frame_rate(latitude, height, east, north)
    left = rotation(-frame[0] * half, -frame[1] * half, -frame[2] * half)
    right = rotation(angular_rate[0] * half, angular_rate[1] * half, angular_rate[2] * half)
    middle = product(product(left, load_matrix(attitude)), right)
    force = transform(middle, specific_force[0], specific_force[1], specific_force[2])
    other = mean_gravity_and_coriolis(latitude, height, east, north, up, force, dt)
    new_east = east + dt * (force[0] + other[0])
    new_north = north + dt * (force[1] + other[1])
    new_up = up + dt * (force[2] + other[2])
    position[0], position[1], position[2] = advance_position(
        latitude, longitude, height, 0.5 * (east + new_east), 0.5 * (north + new_north), 0.5 * (up + new_up), dt
    )
    velocity[0], velocity[1], velocity[2] = new_east, new_north, new_up
    frame = frame_rate(latitude, height, new_east, new_north)
    left = rotation(-frame[0] * half, -frame[1] * half, -frame[2] * half)
    end = product(product(left, middle), right)
    attitude[0, 0], attitude[0, 1], attitude[0, 2] = end[0], end[1], end[2]
    attitude[1, 0], attitude[1, 1], attitude[1, 2] = end[3], end[4], end[5]
    attitude[2, 0], attitude[2, 1], attitude[2, 2] = end[6], end[7], end[8]
    mean_force[0] += dt * force[0]
    mean_force[1] += dt * force[1]
    mean_force[2] += dt * force[2]


@njit(cache=True, nogil=True, error_model="numpy")
def _invert(
    attitude: NDArray[np.float64],
    velocity: NDArray[np.float64],
    position: NDArray[np.float64],
    dt: float,
    angular_rate: NDArray[np.float64],
    specific_force: NDArray[np.float64],
) -> None:
    half = 0.5 * dt
    for i in range(angular_rate.shape[0]):
        latitude, height = position[i, 0], position[i, 2]
        east, north, up = velocity[i, 0], velocity[i, 1], velocity[i, 2]
        new_east, new_north, new_up = velocity[i + 1, 0], velocity[i + 1, 1], velocity[i + 1, 2]
        frame = frame_rate(latitude, height, east, north)
        start = product(rotation(-half * frame[0], -half * frame[1], -half * frame[2]), load_matrix(attitude[i]))
        frame = frame_rate(latitude, height, new_east, new_north)
        end = product(rotation(half * frame[0], half * frame[1], half * frame[2]), load_matrix(attitude[i + 1]))
        turn = rotation_vector(product(transpose(start), end))
        middle = product(start, rotation(0.5 * turn[0], 0.5 * turn[1], 0.5 * turn[2]))
        change = (new_east - east) / dt, (new_north - north) / dt, (new_up - up) / dt
        other = gravity_and_coriolis(latitude, height, east, north, up)
        for _ in range(_INVERSION_ITERATIONS):
            force = change[0] - other[0], change[1] - other[1], change[2] - other[2]
            other = mean_gravity_and_coriolis(latitude, height, east, north, up, force, dt)
        force = transform(transpose(middle), change[0] - other[0], change[1] - other[1], change[2] - other[2])
        for axis in range(3):
            angular_rate[i, axis] = turn[axis] / dt
            specific_force[i, axis] = force[axis]


def invert_mechanization(
    attitude: NDArray[np.float64], velocity: NDArray[np.float64], position: NDArray[np.float64], dt: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The inertial measurements that `mechanize` turns into a given trajectory.

    Attitude and velocity may be anything; the position must be the trapezoid integral of the velocity
    (`advance_position`), since nothing an IMU measures could reconcile the two.

    Args:
        attitude: (n + 1, 3, 3) body to ENU, less than half a turn from one to the next.
        velocity: (n + 1, 3) ENU, m/s.
        position: (n + 1, 3) latitude rad, longitude rad, height m.
        dt: Interval, s.

    Returns:
        Angular rate (n, 3) rad/s and specific force (n, 3) m/s^2, right, forward, up; row i spans samples i to i + 1.

    Raises:
        ValueError: Shapes do not fit, there are fewer than two samples, or dt is not positive.
    """
    samples = len(attitude)
    shapes = attitude.shape[1:], velocity.shape, position.shape
    if samples < 2 or shapes != ((3, 3), (samples, 3), (samples, 3)):
        raise ValueError(
            "expected attitude (n + 1, 3, 3), velocity (n + 1, 3) and position (n + 1, 3) with n >= 1, "
            f"got {attitude.shape}, {velocity.shape} and {position.shape}"
        )
    if not dt > 0.0:
        raise ValueError(f"dt must be positive, got {dt}")
    angular_rate, specific_force = np.empty((samples - 1, 3)), np.empty((samples - 1, 3))
    _invert(attitude, velocity, position, float(dt), angular_rate, specific_force)
    return angular_rate, specific_force
