"""WGS-84: the ellipsoid, gravity, the rotation of the Earth and of the navigation frame, and conversions of position.

A position is (latitude rad, longitude rad, ellipsoidal height m). Vectors are east, north, up (ENU). The functions a
kernel needs are compiled and take and return scalars; the others wrap pymap3d and work on arrays of any leading shape.
Kernels divide as NumPy does: without ZeroDivisionError the compiler inlines them, which saves a third of the time.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pymap3d
from numpy.typing import ArrayLike, NDArray

from spoofgym.kernels import njit

AXES = ("east", "north", "up")
"""Names of the components of a vector."""
AXIS_LETTERS = "enu"
"""One letter for each of `AXES`, as specifications spell them."""
SEMI_MAJOR_AXIS = 6378137.0
"""Equatorial radius a, m (WGS-84)."""
FLATTENING = 1.0 / 298.257223563
"""Flattening f (WGS-84)."""
ECCENTRICITY_SQUARED = FLATTENING * (2.0 - FLATTENING)
"""First eccentricity squared e^2."""
EARTH_RATE = 7.292115e-5
"""Rotation rate of the Earth, rad/s (WGS-84)."""
GRAVITATIONAL_PARAMETER = 3.986004418e14
"""GM, m^3/s^2 (WGS-84)."""
EQUATORIAL_GRAVITY = 9.7803253359
"""Normal gravity on the ellipsoid at the equator, m/s^2 (WGS-84)."""
SOMIGLIANA = 1.931852652458e-3
"""Somigliana's constant k (WGS-84)."""
CENTRIFUGAL_RATIO = EARTH_RATE**2 * SEMI_MAJOR_AXIS**3 * (1.0 - FLATTENING) / GRAVITATIONAL_PARAMETER
"""m = omega^2 a^2 b / GM, centrifugal over gravitational acceleration."""


@njit(cache=True, nogil=True, error_model="numpy")
def radii_of_curvature(latitude: float) -> tuple[float, float]:
    """Radii of curvature on the ellipsoid, without height (Groves 2013 eqs 2.105, 2.106).

    Args:
        latitude: rad.

    Returns:
        Meridian radius R_M and transverse (prime vertical) radius R_N, m.
    """
    sine = math.sin(latitude)
    remainder = 1.0 - ECCENTRICITY_SQUARED * sine * sine
    transverse = SEMI_MAJOR_AXIS / math.sqrt(remainder)
    return transverse * (1.0 - ECCENTRICITY_SQUARED) / remainder, transverse


@njit(cache=True, nogil=True, error_model="numpy")
def normal_gravity(latitude: float, height: float) -> float:
    """Magnitude of normal gravity: Somigliana, second order in height (Groves 2013 eqs 2.134, 2.139).

    Its direction is taken as down; the part toward the equator that grows with height (8.1e-9 m/s^2 per metre at 45
    degrees) is left out. pyins uses the height factor 1 - 2 h / a instead.

    Args:
        latitude: rad.
        height: Ellipsoidal height, m.

    Returns:
        Gravity, m/s^2.
    """
    sine_squared = math.sin(latitude) ** 2
    surface = (
        EQUATORIAL_GRAVITY * (1.0 + SOMIGLIANA * sine_squared) / math.sqrt(1.0 - ECCENTRICITY_SQUARED * sine_squared)
    )
    ratio = height / SEMI_MAJOR_AXIS
    linear = 2.0 * (1.0 + FLATTENING + CENTRIFUGAL_RATIO - 2.0 * FLATTENING * sine_squared)
    return surface * (1.0 - linear * ratio + 3.0 * ratio * ratio)


@njit(cache=True, nogil=True, error_model="numpy")
def earth_rate(latitude: float) -> tuple[float, float, float]:
    """Rotation of the Earth against inertial space, in ENU (Groves 2013 eq 2.123).

    Args:
        latitude: rad.

    Returns:
        East, north, up, rad/s.
    """
    return 0.0, EARTH_RATE * math.cos(latitude), EARTH_RATE * math.sin(latitude)


@njit(cache=True, nogil=True, error_model="numpy")
def transport_rate(
    latitude: float, height: float, east_velocity: float, north_velocity: float
) -> tuple[float, float, float]:
    """Rotation of the ENU frame against the Earth as the vehicle moves over it (Groves 2013 eq 5.44).

    Args:
        latitude: rad, not at a pole.
        height: Ellipsoidal height, m.
        east_velocity: m/s.
        north_velocity: m/s.

    Returns:
        East, north, up, rad/s.
    """
    meridian, transverse = radii_of_curvature(latitude)
    about_north = east_velocity / (transverse + height)
    return -north_velocity / (meridian + height), about_north, about_north * math.sin(latitude) / math.cos(latitude)


@njit(cache=True, nogil=True, error_model="numpy")
def enu_difference(
    latitude: float, longitude: float, height: float, from_latitude: float, from_longitude: float, from_height: float
) -> tuple[float, float, float]:
    """One position minus another in metres, by the radii of curvature at the second.

    First order in the distance: over 1 km of east it leaves out about 0.1 m of north at mid-latitudes.
    The shorter way round is taken where the two lie on both sides of the 180 degree meridian.

    Args:
        latitude: First position, rad.
        longitude: First position, rad.
        height: First position, m.
        from_latitude: Second position, rad.
        from_longitude: Second position, rad.
        from_height: Second position, m.

    Returns:
        East, north, up, m.
    """
    meridian, transverse = radii_of_curvature(from_latitude)
    angle = longitude - from_longitude
    angle -= 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)
    return (
        angle * (transverse + from_height) * math.cos(from_latitude),
        (latitude - from_latitude) * (meridian + from_height),
        height - from_height,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def enu_displacement(
    latitude: float, longitude: float, height: float, east: float, north: float, up: float
) -> tuple[float, float, float]:
    """The position that lies (east, north, up) metres from another; the inverse of `enu_difference`.

    Args:
        latitude: Where from, rad.
        longitude: Where from, rad.
        height: Where from, m.
        east: m.
        north: m.
        up: m.

    Returns:
        Latitude rad, longitude rad, height m.
    """
    meridian, transverse = radii_of_curvature(latitude)
    return (
        latitude + north / (meridian + height),
        longitude + east / ((transverse + height) * math.cos(latitude)),
        height + up,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def ecef(latitude: float, longitude: float, height: float) -> tuple[float, float, float]:
    """Earth-centred Earth-fixed coordinates of one position (Groves 2013 eq 2.112).

    Args:
        latitude: rad.
        longitude: rad.
        height: m.

    Returns:
        x, y, z, m.
    """
    _, transverse = radii_of_curvature(latitude)
    radius = (transverse + height) * math.cos(latitude)
    polar = ((1.0 - ECCENTRICITY_SQUARED) * transverse + height) * math.sin(latitude)
    return radius * math.cos(longitude), radius * math.sin(longitude), polar


def position_difference(position_a: ArrayLike, position_b: ArrayLike) -> NDArray[np.float64]:
    """`position_a` minus `position_b` in metres, by the radii of curvature at `position_b` (see `enu_difference`).

    Args:
        position_a: (..., 3) latitude rad, longitude rad, height m.
        position_b: (..., 3) the same, broadcast against `position_a`.

    Returns:
        (..., 3) east, north, up, m.

    Raises:
        ValueError: A position does not end in three components.
    """
    a, b = _positions(position_a), _positions(position_b)
    meridian, transverse = _radii(b[..., 0])
    angle = a[..., 1] - b[..., 1]
    angle = angle - 2.0 * np.pi * np.floor(angle / (2.0 * np.pi) + 0.5)
    east = angle * (transverse + b[..., 2]) * np.cos(b[..., 0])
    north = (a[..., 0] - b[..., 0]) * (meridian + b[..., 2])
    return np.stack([east, north, a[..., 2] - b[..., 2]], axis=-1)


def displace(position: ArrayLike, enu: ArrayLike) -> NDArray[np.float64]:
    """The position that lies `enu` metres from `position`; the inverse of `position_difference`.

    Args:
        position: (..., 3) latitude rad, longitude rad, height m.
        enu: (..., 3) east, north, up, m, broadcast against `position`.

    Returns:
        (..., 3) latitude rad, longitude rad (not wrapped to +-pi), height m.

    Raises:
        ValueError: An argument does not end in three components.
    """
    start, step = _positions(position), _positions(enu)
    meridian, transverse = _radii(start[..., 0])
    latitude = start[..., 0] + step[..., 1] / (meridian + start[..., 2])
    longitude = start[..., 1] + step[..., 0] / ((transverse + start[..., 2]) * np.cos(start[..., 0]))
    return np.stack([latitude, longitude, start[..., 2] + step[..., 2]], axis=-1)


def geodetic_to_ecef(position: ArrayLike) -> NDArray[np.float64]:
    """Earth-centred, Earth-fixed Cartesian coordinates of a position.

    Args:
        position: (..., 3) latitude rad, longitude rad, height m.

    Returns:
        (..., 3) x, y, z, m.

    Raises:
        ValueError: The argument does not end in three components.
    """
    return _stack(pymap3d.geodetic2ecef(*_columns(position), deg=False))


def ecef_to_geodetic(ecef: ArrayLike) -> NDArray[np.float64]:
    """Geodetic position of Earth-centred, Earth-fixed Cartesian coordinates.

    Args:
        ecef: (..., 3) x, y, z, m.

    Returns:
        (..., 3) latitude rad, longitude rad, height m.

    Raises:
        ValueError: The argument does not end in three components.
    """
    # pymap3d drops the axis of a latitude that stands alone
    return _stack(pymap3d.ecef2geodetic(*_columns(ecef), deg=False)).reshape(np.shape(ecef))


def horizontal(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Length of the horizontal part, (...), of vectors (..., 2 or more) that begin with east and north."""
    length: NDArray[np.float64] = np.sqrt(vectors[..., 0] ** 2 + vectors[..., 1] ** 2)
    return length


def ecef_to_enu_rotation(position: ArrayLike) -> NDArray[np.float64]:
    """Matrix that turns an ECEF vector into ENU at a position (Groves 2013 eq 2.150, reordered from NED).

    Args:
        position: (..., 3) latitude rad, longitude rad, height m (not used).

    Returns:
        (..., 3, 3).

    Raises:
        ValueError: The argument does not end in three components.
    """
    latitude, longitude, _ = _columns(position)
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    east = np.stack([-sin_lon, cos_lon, np.zeros_like(latitude)], axis=-1)
    north = np.stack([-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat], axis=-1)
    up = np.stack([cos_lat * cos_lon, cos_lat * sin_lon, sin_lat], axis=-1)
    return np.stack([east, north, up], axis=-2)


def _radii(latitude: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    remainder = 1.0 - ECCENTRICITY_SQUARED * np.sin(latitude) ** 2
    transverse = SEMI_MAJOR_AXIS / np.sqrt(remainder)
    return transverse * (1.0 - ECCENTRICITY_SQUARED) / remainder, transverse


def _positions(values: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise ValueError(f"expected an array whose last axis has three components, got shape {array.shape}")
    return array


def _columns(values: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    array = _positions(values)
    return array[..., 0], array[..., 1], array[..., 2]


def _stack(columns: tuple[Any, ...]) -> NDArray[np.float64]:
    return np.stack(np.broadcast_arrays(*(np.asarray(column, dtype=np.float64) for column in columns)), axis=-1)
