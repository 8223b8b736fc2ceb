"""What a receiver sees: light time, directions, slots and dilution of precision."""

import math
from dataclasses import dataclass

import numpy as np
import pymap3d
import pytest
from scipy.constants import speed_of_light

from spoofgym.geodesy import geodetic_to_ecef
from spoofgym.sensors.constellation import EARTH_RATE, gps_24
from spoofgym.sensors.geometry import dilution, normal_inverse, received_states, view

CHICAGO = np.array([math.radians(41.836), math.radians(-87.625), 12_192.0])
TIME = np.arange(0.0, 1_800.0, 20.0)
DAY = np.arange(0.0, 86_400.0, 60.0)


def inertial(vector, time):
    """Earth-fixed components at ``time`` turned to a frame that does not turn."""
    sine, cosine = np.sin(EARTH_RATE * time), np.cos(EARTH_RATE * time)
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    return np.stack([cosine * x - sine * y, sine * x + cosine * y, z], axis=-1)


def travelled(time, receiver, iterations=6):
    """Distance of the signals received at ``time`` in a frame that does not turn, (E, n), by iteration of the delay."""
    orbits = gps_24()
    here = inertial(receiver[:, None], time[:, None])
    distance = np.full((len(time), 24), 2.2e7)
    for _ in range(iterations):
        sent = time[:, None] - distance / speed_of_light
        distance = np.linalg.norm(inertial(orbits.states(sent)[0], sent) - here, axis=2)
    return distance


def path(speed=0.0):
    """A straight line eastward at ``speed`` m/s, ECEF and geodetic."""
    start = geodetic_to_ecef(CHICAGO)
    east = np.array([-np.sin(CHICAGO[1]), np.cos(CHICAGO[1]), 0.0])
    ecef = start + speed * TIME[:, None] * east
    return ecef, np.stack(pymap3d.ecef2geodetic(*ecef.T, deg=False), axis=1), east


def test_the_range_is_the_way_of_light():
    ecef, geodetic, _ = path(233.0)
    position, _, flight_time = received_states(gps_24(), geodetic, TIME)
    expected = travelled(TIME, ecef)
    np.testing.assert_allclose(np.linalg.norm(position - ecef[:, None], axis=2), expected, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(flight_time, expected / speed_of_light, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(("speed", "tolerance"), [(0.0, 1e-6), (233.0, 1e-3)])
def test_the_range_rate_is_its_derivative(speed, tolerance):
    """Fourth-order differences over 2 s. A receiver that moves is 3e-6 of its speed off."""
    ecef, geodetic, east = path(speed)
    position, velocity, _ = received_states(gps_24(), geodetic, TIME)
    sight = position - ecef[:, None]
    sight /= np.linalg.norm(sight, axis=2, keepdims=True)
    rate = np.sum(sight * (velocity - speed * east), axis=2)
    near, far = (travelled(TIME + h, ecef + h * speed * east) for h in (1.0, 2.0))
    near_before, far_before = (travelled(TIME - h, ecef - h * speed * east) for h in (1.0, 2.0))
    derivative = (8.0 * (near - near_before) - (far - far_before)) / 12.0
    np.testing.assert_allclose(rate, derivative, rtol=0.0, atol=tolerance)


def test_directions_are_those_of_pymap3d():
    _, geodetic, _ = path(233.0)
    geometry = view(gps_24(), geodetic, TIME)
    for k in (0, 40, 89):
        seen = geometry.present[k]
        azimuth, elevation, _ = pymap3d.ecef2aer(*geometry.position[k, seen].T, *geodetic[k], deg=False)
        np.testing.assert_allclose(geometry.elevation[k, seen], elevation, atol=1e-9)
        np.testing.assert_allclose(geometry.azimuth[k, seen], azimuth, atol=1e-9)
        east = np.cos(elevation) * np.sin(azimuth)
        np.testing.assert_allclose(geometry.line_of_sight[k, seen, 0], east, atol=1e-9)


def test_every_satellite_above_the_mask_has_one_slot_and_keeps_it():
    mask = math.radians(7.5)
    geometry = view(gps_24(), CHICAGO, DAY, mask)
    position, _, _ = received_states(gps_24(), np.broadcast_to(CHICAGO, (len(DAY), 3)), DAY)
    elevation = np.stack([pymap3d.ecef2aer(*p.T, *CHICAGO, deg=False)[1] for p in position])
    visible = elevation >= mask
    assert geometry.num_slots == visible.sum(axis=1).max()
    slot_before = {}
    for k in range(len(DAY)):
        slot = {int(s): j for j, s in enumerate(geometry.satellite[k]) if s >= 0}
        assert sorted(slot) == (np.flatnonzero(visible[k]) + 1).tolist()
        assert len(slot) == geometry.present[k].sum()
        assert all(slot_before.get(s, j) == j for s, j in slot.items())
        started = {geometry.satellite[k, j] for j in np.flatnonzero(geometry.started[k])}
        assert started == set(slot) - set(slot_before)
        slot_before = slot


def test_with_few_slots_the_lowest_wait_until_one_is_free():
    few = view(gps_24(), CHICAGO, DAY, slots=6)
    every = view(gps_24(), CHICAGO, DAY)
    assert few.satellite.shape == (len(DAY), 6)
    highest = every.satellite[0][np.argsort(-every.elevation[0])][:6]
    np.testing.assert_array_equal(np.sort(few.satellite[0]), np.sort(highest))
    for k in range(1, len(DAY)):
        up = set(every.satellite[k]) - {-1}
        held, before = set(few.satellite[k]) - {-1}, set(few.satellite[k - 1]) - {-1}
        assert held <= up
        assert before & up <= held
        assert len(held) == min(6, len(up))
        waited = (up - before) - held
        if waited and held - before:
            elevation = dict(zip(every.satellite[k].tolist(), every.elevation[k], strict=True))
            assert max(elevation[s] for s in waited) <= min(elevation[s] for s in held - before)


def test_empty_slots_are_zero():
    geometry = view(gps_24(), CHICAGO, TIME, slots=20)
    empty = ~geometry.present
    assert empty.any()
    assert not geometry.started[empty].any()
    for name in ("position", "velocity", "line_of_sight", "elevation", "azimuth"):
        assert not getattr(geometry, name)[empty].any()


def test_an_epoch_does_not_depend_on_the_others():
    _, geodetic, _ = path(233.0)
    whole = view(gps_24(), geodetic, TIME)
    for k in (0, 7, 89):
        alone = view(gps_24(), geodetic[k : k + 1], TIME[k : k + 1])
        for satellite in alone.satellite[0]:
            j = np.flatnonzero(whole.satellite[k] == satellite)[0]
            i = np.flatnonzero(alone.satellite[0] == satellite)[0]
            for name in ("position", "velocity", "line_of_sight", "elevation"):
                np.testing.assert_array_equal(getattr(whole, name)[k, j], getattr(alone, name)[0, i])


def test_another_constellation_will_do():
    @dataclass(frozen=True)
    class Hanging:
        satellites = np.array([7], dtype=np.int64)

        def states(self, time):
            place = np.broadcast_to([2.6e7, 0.0, 0.0], (len(time), 1, 3)).copy()
            return place, np.zeros_like(place)

    geometry = view(Hanging(), np.zeros(3), TIME)
    np.testing.assert_array_equal(geometry.satellite, 7)
    # the signal needs 65 ms, in which the Earth turns eastward: the satellite appears in the west, by ω τ of its radius
    lag = EARTH_RATE * np.linalg.norm(geometry.position - [6_378_137.0, 0.0, 0.0], axis=2) / speed_of_light
    np.testing.assert_allclose(geometry.position[..., 1], -2.6e7 * np.sin(lag), rtol=1e-9)
    assert geometry.azimuth[0, 0] == pytest.approx(1.5 * np.pi, abs=1e-6)


def test_dilution_of_a_regular_tetrahedron():
    """Σ e e' = (4/3) I and Σ e = 0, so every axis has 3/4 and the clock 1/4."""
    sights = np.array([[[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]]]) / np.sqrt(3.0)
    expected = np.sqrt([2.5, 2.25, 1.5, 0.75, 0.25])
    np.testing.assert_allclose(dilution(sights, np.ones((1, 4), bool))[0], expected, rtol=1e-14)


def test_dilution_of_the_zenith_and_three_on_the_horizon():
    angles = 2.0 * np.pi * np.arange(3.0) / 3.0
    horizon = np.stack([np.sin(angles), np.cos(angles), np.zeros(3)], axis=1)
    sights = np.vstack([[0.0, 0.0, 1.0], horizon, [0.3, 0.1, 0.2]])[None]
    expected = np.sqrt([3.0, 8.0 / 3.0, 4.0 / 3.0, 4.0 / 3.0, 1.0 / 3.0])
    present = np.array([[True, True, True, True, False]])
    np.testing.assert_allclose(dilution(sights, present)[0], expected, rtol=1e-14)


def test_dilution_is_that_of_rtklib():
    rtklib = pytest.importorskip("pyrtklib")
    geometry = view(gps_24(), CHICAGO, DAY[::60])
    ours = dilution(geometry.line_of_sight, geometry.present)
    for k in range(len(geometry.time)):
        seen = np.flatnonzero(geometry.present[k])
        directions, figures = rtklib.Arr1Ddouble(2 * len(seen)), rtklib.Arr1Ddouble(4)
        for i, j in enumerate(seen):
            directions[2 * i], directions[2 * i + 1] = geometry.azimuth[k, j], geometry.elevation[k, j]
        rtklib.dops(len(seen), directions, 0.0, figures)
        np.testing.assert_allclose(ours[k, :4], [figures[i] for i in range(4)], rtol=1e-9)


def test_no_fix_without_four_satellites_of_different_directions():
    rng = np.random.default_rng(0)
    sights = rng.standard_normal((3, 6, 3))
    sights /= np.linalg.norm(sights, axis=2, keepdims=True)
    angles = 2.0 * np.pi * np.arange(6.0) / 6.0
    # on a cone up and clock cannot be told apart
    sights[1] = np.stack([0.6 * np.sin(angles), 0.6 * np.cos(angles), np.full(6, 0.8)], axis=1)
    present = np.ones((3, 6), bool)
    present[0, 3:] = False
    figures = dilution(sights, present)
    assert np.isnan(figures[:2]).all()
    assert np.isfinite(figures[2]).all()


def test_cofactors_are_the_inverse_of_the_normal_matrix():
    rng = np.random.default_rng(1)
    sights = rng.standard_normal((50, 8, 3))
    sights /= np.linalg.norm(sights, axis=2, keepdims=True)
    weight = rng.uniform(0.1, 4.0, (50, 8))
    inverse = normal_inverse(sights, weight)
    rows = np.concatenate([-sights, np.ones((50, 8, 1))], axis=2)
    np.testing.assert_allclose(inverse, np.linalg.inv(np.einsum("esi,es,esj->eij", rows, weight, rows)), rtol=1e-9)
    np.testing.assert_array_equal(inverse[7:8], normal_inverse(sights[7:8], weight[7:8]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time": np.zeros((2, 1))}, "time must be one axis"),
        ({"time": np.zeros(0)}, "time must be one axis"),
        ({"mask": 2.0}, "mask must be from"),
        ({"mask": math.nan}, "mask must be a finite number"),
        ({"slots": 0}, "slots must be a whole number, 1 or more"),
    ],
)
def test_refusals_name_the_value(change, message):
    with pytest.raises(ValueError, match=message):
        view(**{"constellation": gps_24(), "receiver_position": CHICAGO, "time": TIME, **change})
