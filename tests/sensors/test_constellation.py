"""The 24-slot constellation of GPS: its slots, its motion, and the coverage that its standard promises."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spoofgym.sensors.constellation import (
    ARGUMENTS,
    EARTH_RATE,
    NODE_RATE,
    NODES,
    SIDEREAL_TIME,
    SLOT_NAMES,
    gps_24,
)
from spoofgym.sensors.geometry import dilution, view

SEMI_MAJOR_AXIS = 26_559.7e3
TIMES = np.linspace(-90_000.0, 200_000.0, 59)


def test_six_planes_of_four_slots():
    assert SLOT_NAMES[0] == "A1"
    assert SLOT_NAMES[-1] == "F4"
    np.testing.assert_array_equal(gps_24().satellites, np.arange(1, 25))
    np.testing.assert_allclose(np.mod(np.diff([*NODES, NODES[0]]), 360.0), 60.0, rtol=1e-12)
    assert np.shape(ARGUMENTS) == (6, 4)


def test_sidereal_time_is_that_of_the_epoch():
    """Greenwich mean sidereal time of 1982 at 0 h UT on 1 July 1993; UT1 was within 0.9 s of UTC, 0.004 degrees."""
    century = (2_449_169.5 - 2_451_545.0) / 36_525.0
    seconds = 24_110.54841 + 8_640_184.812866 * century + 0.093104 * century**2
    assert np.mod(seconds / 240.0, 360.0) == pytest.approx(SIDEREAL_TIME, abs=0.005)


def test_positions_are_turned_circles():
    orbits = gps_24()
    position, _ = orbits.states(TIMES)
    motion = np.sqrt(3.986005e14 / SEMI_MAJOR_AXIS**3)
    for k, satellite in ((0, 0), (17, 5), (58, 23)):
        plane, slot = divmod(satellite, 4)
        argument = np.deg2rad(ARGUMENTS[plane][slot]) + motion * TIMES[k]
        node = np.deg2rad(NODES[plane] - SIDEREAL_TIME) + (np.deg2rad(NODE_RATE) - EARTH_RATE) * TIMES[k]
        turned = Rotation.from_euler("ZXZ", [node, np.deg2rad(55.0), argument]).apply([SEMI_MAJOR_AXIS, 0.0, 0.0])
        np.testing.assert_allclose(position[k, satellite], turned, atol=1e-5)


def test_velocity_is_the_derivative_of_position():
    orbits, half = gps_24(), 0.5
    difference = orbits.states(TIMES + half)[0] - orbits.states(TIMES - half)[0]
    np.testing.assert_allclose(orbits.states(TIMES)[1], difference / (2.0 * half), atol=1e-5)


def test_a_time_for_every_satellite():
    orbits = gps_24()
    times = TIMES[:, None] + 0.001 * np.arange(24.0)
    position, velocity = orbits.states(times)
    for satellite in (0, 11, 23):
        expected = orbits.states(times[:, satellite])
        np.testing.assert_array_equal(position[:, satellite], expected[0][:, satellite])
        np.testing.assert_array_equal(velocity[:, satellite], expected[1][:, satellite])


def test_ground_tracks_repeat_when_the_earth_has_turned_once_below_the_orbits():
    orbits = gps_24()
    turn = 2.0 * np.pi / (EARTH_RATE - np.deg2rad(NODE_RATE))
    before, after = orbits.states(np.array([0.0, turn]))[0]
    moved = np.linalg.norm(after - before, axis=1) / SEMI_MAJOR_AXIS
    assert np.rad2deg(moved.max()) < 0.015


def test_coverage_is_what_the_standard_promises():
    """GPS SPS Performance Standard: PDOP of 6 or less at 98 % of all places and times; four in view above 5 degrees."""
    times = np.arange(0.0, 86_164.0, 1_200.0)
    spacing = np.pi * (3.0 - np.sqrt(5.0))
    good, fewest = [], 24
    for k in range(60):
        place = np.array([np.arcsin((k + 0.5) / 30.0 - 1.0), np.mod(k * spacing, 2.0 * np.pi) - np.pi, 0.0])
        geometry = view(gps_24(), place, times)
        good.append(dilution(geometry.line_of_sight, geometry.present)[:, 1] <= 6.0)
        fewest = min(fewest, int(geometry.present.sum(axis=1).min()))
    assert np.mean(good) >= 0.98
    assert fewest >= 4
