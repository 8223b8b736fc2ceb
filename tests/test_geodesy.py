"""Geodesy against pymap3d, pyins and published values of WGS-84."""

import numpy as np
import pymap3d
import pytest
from pyins import earth

from spoofgym import geodesy

XIAN = np.array([np.radians(34.6887), np.radians(108.1915), 2283.0])
LATITUDES = np.radians([-80.0, -33.0, 0.0, 34.6887, 45.0, 89.0])


@pytest.mark.parametrize("latitude", LATITUDES)
def test_radii_agree_with_two_libraries(latitude):
    meridian, transverse = geodesy.radii_of_curvature(latitude)
    assert meridian == pytest.approx(pymap3d.rcurve.meridian(latitude, deg=False), rel=1e-12)
    assert transverse == pytest.approx(pymap3d.rcurve.transverse(latitude, deg=False), rel=1e-12)
    north, east, _ = earth.principal_radii(np.degrees(latitude), 0.0)
    assert (meridian, transverse) == pytest.approx((north, east), rel=1e-12)


@pytest.mark.parametrize(("degrees", "published"), [(0.0, 9.7803253359), (45.0, 9.806197769), (90.0, 9.8321849378)])
def test_gravity_on_the_ellipsoid_has_its_published_values(degrees, published):
    assert geodesy.normal_gravity(np.radians(degrees), 0.0) == pytest.approx(published, abs=2e-9)


@pytest.mark.parametrize("latitude", LATITUDES)
def test_gravity_at_height_follows_the_exact_gradient(latitude):
    """Bruns: dg/dh = -g (1/R_M + 1/R_N) - 2 omega^2 on the ellipsoid; the model neglects the flattening squared."""
    meridian, transverse = geodesy.radii_of_curvature(latitude)
    surface = geodesy.normal_gravity(latitude, 0.0)
    bruns = -surface * (1.0 / meridian + 1.0 / transverse) - 2.0 * geodesy.EARTH_RATE**2
    gradient = (geodesy.normal_gravity(latitude, 1.0) - geodesy.normal_gravity(latitude, -1.0)) / 2.0
    assert gradient == pytest.approx(bruns, rel=4e-5)
    curvature = geodesy.normal_gravity(latitude, 1e4) + geodesy.normal_gravity(latitude, -1e4) - 2.0 * surface
    assert curvature == pytest.approx(surface * 6.0 * (1e4 / geodesy.SEMI_MAJOR_AXIS) ** 2, rel=1e-6)


def test_pyins_gravity_differs_by_its_height_factor_only():
    for height in (0.0, 2283.0):
        ratio = geodesy.normal_gravity(XIAN[0], height) / earth.gravity(np.degrees(XIAN[0]), height)
        assert ratio == pytest.approx(1.0 - 0.0085 * height / geodesy.SEMI_MAJOR_AXIS, abs=1e-6)


@pytest.mark.parametrize("latitude", LATITUDES)
def test_rates_agree_with_pyins(latitude):
    north, east, down = earth.rate_n(np.degrees(latitude))
    assert geodesy.earth_rate(latitude) == pytest.approx((east, north, -down), abs=1e-18)
    velocity = np.array([80.0, -120.0, 3.0])  # N, E, D
    north, east, down = earth.curvature_matrix(np.degrees(latitude), 1500.0) @ velocity
    ours = geodesy.transport_rate(latitude, 1500.0, velocity[1], velocity[0])
    assert ours == pytest.approx((east, north, -down), rel=1e-9)


def test_cartesian_conversions_agree_with_pymap3d_and_go_back():
    rng = np.random.default_rng(1)
    positions = rng.uniform([-1.5, -np.pi, -500.0], [1.5, np.pi, 20000.0], (200, 3))
    cartesian = geodesy.geodetic_to_ecef(positions)
    transverse = np.array([geodesy.radii_of_curvature(latitude)[1] for latitude in positions[:, 0]])
    vertical = (transverse * (1.0 - geodesy.ECCENTRICITY_SQUARED) + positions[:, 2]) * np.sin(positions[:, 0])
    np.testing.assert_allclose(cartesian[:, 2], vertical, atol=1e-8)
    np.testing.assert_allclose(geodesy.ecef_to_geodetic(cartesian), positions, rtol=0, atol=1e-8)
    assert np.abs(geodesy.geodetic_to_ecef(geodesy.ecef_to_geodetic(cartesian)) - cartesian).max() < 1e-8


def local_plane(position, origin):
    return np.array(pymap3d.geodetic2enu(*position, *origin, deg=False))


def test_the_rotation_turns_to_the_local_plane():
    there = XIAN + np.array([0.01, -0.02, 500.0])
    local = local_plane(there, XIAN)
    line = geodesy.geodetic_to_ecef(there) - geodesy.geodetic_to_ecef(XIAN)
    np.testing.assert_allclose(geodesy.ecef_to_enu_rotation(XIAN) @ line, local, atol=1e-7)


def test_small_differences_agree_with_the_local_plane():
    offset = np.array([30.0, -40.0, 12.0])
    there = geodesy.displace(XIAN, offset)
    np.testing.assert_allclose(local_plane(there, XIAN), offset, atol=1e-3)


def test_difference_and_displacement_are_inverse_of_each_other():
    rng = np.random.default_rng(2)
    offsets = rng.uniform(-4000.0, 4000.0, (50, 3))
    there = geodesy.displace(XIAN, offsets)
    np.testing.assert_allclose(geodesy.position_difference(there, XIAN), offsets, atol=1e-8)
    for offset, vectorised in zip(offsets, there, strict=True):
        scalar = geodesy.enu_displacement(*XIAN, *offset)
        np.testing.assert_allclose(scalar, vectorised, rtol=1e-15)
        np.testing.assert_allclose(geodesy.enu_difference(*scalar, *XIAN), offset, atol=1e-8)


def test_difference_takes_the_short_way_over_the_date_line():
    west, east = np.array([0.5, np.pi - 1e-6, 0.0]), np.array([0.5, -np.pi + 1e-6, 0.0])
    difference = geodesy.position_difference(east, west)
    assert 11.0 < difference[0] < 11.3
    np.testing.assert_allclose(geodesy.enu_difference(*east, *west), difference, atol=1e-8)


def test_a_position_without_three_components_is_refused():
    with pytest.raises(ValueError, match=r"three components, got shape \(2,\)"):
        geodesy.position_difference([0.5, 1.0], XIAN)
    with pytest.raises(ValueError, match="three components"):
        geodesy.geodetic_to_ecef(0.5)


@pytest.mark.parametrize("shape", [(3,), (1, 3), (2, 3), (1, 1, 3)])
def test_cartesian_conversions_keep_the_shape(shape):
    point = np.broadcast_to([4e6, 1e6, 4.8e6], shape)
    back = geodesy.geodetic_to_ecef(geodesy.ecef_to_geodetic(point))
    assert back.shape == shape
    np.testing.assert_allclose(back, point, atol=1e-6)


def test_compiled_cartesian_coordinates_are_pymap3ds():
    for latitude in LATITUDES:
        expected = pymap3d.geodetic2ecef(latitude, 0.7, 12_000.0, deg=False)
        np.testing.assert_allclose(geodesy.ecef(latitude, 0.7, 12_000.0), expected, atol=1e-8)
