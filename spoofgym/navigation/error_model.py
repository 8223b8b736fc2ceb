"""Error dynamics of the strapdown mechanization: F, the transition matrix and the process noise.

The error is estimate minus truth, in the order attitude φ (E, N, U), velocity, position in metres, gyro bias,
accelerometer bias (R, F, U); a bias error is the true bias minus the estimated one, as it enters the compensated
measurement. The computed attitude is (I - [φ x]) C. With x = [n; b], nine navigation and six bias states,

    n' = A n + B b + noise,      A (9, 9) `navigation_dynamics`,      B (9, 6): -C on φ, +C on the velocity,      b' =
    0.

Sources: Liu 2018, appendix A, with its rows 3 and 9 rescaled from radians to metres; the gradient of gravity in the
vertical channel, which Liu omits, as in Groves 2013 eq 14.63.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.geodesy import earth_rate, normal_gravity, radii_of_curvature
from spoofgym.kernels import njit

NUM_NAVIGATION = 9
"""Attitude, velocity and position."""
NUM_INERTIAL = 15
"""These and the biases of the inertial unit. A filter with more states has the inertial ones first."""
INERTIAL = slice(0, NUM_INERTIAL)
VELOCITY = slice(3, 6)
POSITION = slice(6, 9)
BIAS = slice(NUM_NAVIGATION, NUM_INERTIAL)


@njit(cache=True, nogil=True)
def navigation_dynamics(velocity: Floats, position: Floats, force: Floats, dynamics: Floats) -> None:
    """Fill A, the dynamics of attitude, velocity and position errors.

    Args:
        velocity: (3,) ENU, m/s.
        position: (3,) latitude rad, longitude rad, height m.
        force: specific force resolved in ENU, (3,), m/s².
        dynamics: (9, 9), overwritten; 1/s between states of equal kind.
    """
    latitude, height = position[0], position[2]
    meridian, normal = radii_of_curvature(latitude)
    rm, rn = meridian + height, normal + height
    tan, sec = np.tan(latitude), 1.0 / np.cos(latitude)
    ve, vn, vu = velocity[0], velocity[1], velocity[2]
    _, earth_n, earth_u = earth_rate(latitude)
    en_e, en_n, en_u = -vn / rm, ve / rn, ve * tan / rn

    dynamics[:, :] = 0.0
    # the earth-rate and transport-rate errors per metre north and per metre up
    earth_per_north = (0.0, -earth_u / rm, earth_n / rm)
    transport_per_north = (0.0, 0.0, ve * sec * sec / (rn * rm))
    transport_per_up = (vn / (rm * rm), -ve / (rn * rn), -ve * tan / (rn * rn))

    _put_cross(dynamics, 0, 0, -(en_e), -(earth_n + en_n), -(earth_u + en_u))
    dynamics[0, 4] = -1.0 / rm
    dynamics[1, 3] = 1.0 / rn
    dynamics[2, 3] = tan / rn
    for i in range(3):
        dynamics[i, 7] = earth_per_north[i] + transport_per_north[i]
        dynamics[i, 8] = transport_per_up[i]

    _put_cross(dynamics, 3, 0, force[0], force[1], force[2])
    _put_cross(dynamics, 3, 3, -en_e, -(2.0 * earth_n + en_n), -(2.0 * earth_u + en_u))
    # v x (transport-rate error caused by the velocity error)
    for column, (de, dn, du) in ((3, (0.0, 1.0 / rn, tan / rn)), (4, (-1.0 / rm, 0.0, 0.0))):
        dynamics[3, column] += vn * du - vu * dn
        dynamics[4, column] += vu * de - ve * du
        dynamics[5, column] += ve * dn - vn * de
    north = (
        2.0 * earth_per_north[0] + transport_per_north[0],
        2.0 * earth_per_north[1] + transport_per_north[1],
        2.0 * earth_per_north[2] + transport_per_north[2],
    )
    for column, (de, dn, du) in ((7, north), (8, transport_per_up)):
        dynamics[3, column] = vn * du - vu * dn
        dynamics[4, column] = vu * de - ve * du
        dynamics[5, column] = ve * dn - vn * de
    gravity = normal_gravity(latitude, height)
    dynamics[5, 8] += gravity - normal_gravity(latitude, height + 1.0)

    dynamics[6, 3] = dynamics[7, 4] = dynamics[8, 5] = 1.0
    dynamics[6, 6] = (vu - vn * tan) / rn
    dynamics[6, 7] = ve * tan / rn
    dynamics[6, 8] = -ve / rn
    dynamics[7, 7] = vu / rm
    dynamics[7, 8] = -vn / rm


@njit(cache=True, nogil=True)
def _put_cross(matrix: Floats, row: int, column: int, x: float, y: float, z: float) -> None:
    """Write the cross-product matrix [a x] of a = (x, y, z) at (row, column)."""
    matrix[row, column + 1], matrix[row, column + 2] = -z, y
    matrix[row + 1, column], matrix[row + 1, column + 2] = z, -x
    matrix[row + 2, column], matrix[row + 2, column + 1] = -y, x


@njit(cache=True, nogil=True)
def transition_matrix(dynamics: Floats, attitude: Floats, interval: float, transition: Floats, work: Floats) -> None:
    """Fill the first nine rows of Φ = exp(F T), to third order in T, for F constant over the interval.

    Args:
        dynamics: A, (9, 9), destroyed.
        attitude: C, body to ENU, (3, 3).
        interval: T, s.
        transition: (9, 15), overwritten: [exp(AT), (T + AT²/2 + A²T³/6) B].
        work: (2, 9, 9), overwritten.
    """
    square, series = work[0], work[1]
    for i in range(NUM_NAVIGATION):
        for j in range(NUM_NAVIGATION):
            dynamics[i, j] *= interval
    _multiply(dynamics, dynamics, square)
    # series = I + AT/2 + (AT)²/6, so that exp(AT) = I + AT series and the bias columns are T series B
    for i in range(NUM_NAVIGATION):
        for j in range(NUM_NAVIGATION):
            series[i, j] = 0.5 * dynamics[i, j] + square[i, j] / 6.0
        series[i, i] += 1.0
    _multiply(dynamics, series, square)
    for i in range(NUM_NAVIGATION):
        for j in range(NUM_NAVIGATION):
            transition[i, j] = square[i, j]
        transition[i, i] += 1.0
        for j in range(3):
            gyro = accelerometer = 0.0
            for k in range(3):
                gyro -= series[i, k] * attitude[k, j]
                accelerometer += series[i, 3 + k] * attitude[k, j]
            transition[i, 9 + j] = interval * gyro
            transition[i, 12 + j] = interval * accelerometer


@njit(cache=True, nogil=True)
def _multiply(a: Floats, b: Floats, product: Floats) -> None:
    """Product = a b for square (9, 9) matrices."""
    for i in range(NUM_NAVIGATION):
        for j in range(NUM_NAVIGATION):
            product[i, j] = 0.0
        for k in range(NUM_NAVIGATION):
            left = a[i, k]
            for j in range(NUM_NAVIGATION):
                product[i, j] += left * b[k, j]
