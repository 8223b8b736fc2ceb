"""Kinematic consistency, smoothness and coordination of trajectories, and what bad input is told."""

import dataclasses
import time

import numpy as np
import pytest

from spoofgym.geodesy import EARTH_RATE, displace, position_difference
from spoofgym.scenarios.liu_flight import LIU_END, liu_trajectory
from spoofgym.trajectory import (
    Accelerate,
    Climb,
    Straight,
    Turn,
    coordinated_bank,
    fly,
    fly_through,
    smooth_step,
    smooth_step_rate,
)
from tests.attitudes import euler_angles

START = (0.6, 1.9, 500.0)
MANOEUVRES = (
    Straight(3.0),
    Accelerate(20.0, 20.0),
    Climb(150.0, 25.0),
    Turn(np.pi / 2, 30.0),
    Straight(2.0),
    Turn(-np.pi / 3, 20.0),
    Climb(-100.0, 20.0),
)
RATE = 100.0


@pytest.fixture(scope="module")
def flight():
    return fly(MANOEUVRES, position=START, speed=60.0, heading=0.3, rate=RATE)


@pytest.fixture(scope="module")
def liu():
    return liu_trajectory()


def test_manoeuvres_do_what_they_say(flight):
    assert flight.num_steps == 12000
    assert flight.duration == 120.0
    assert flight.dt == 0.01
    pitch, roll, yaw = euler_angles(flight.attitude[-1])
    assert (pitch, roll) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert yaw == pytest.approx(0.3 + np.pi / 2 - np.pi / 3, abs=1e-12)
    assert np.linalg.norm(flight.velocity[-1]) == pytest.approx(80.0, abs=1e-9)
    assert flight.position[-1, 2] == pytest.approx(550.0, abs=1e-9)


def test_speed_is_constant_outside_the_acceleration(flight):
    speed = np.linalg.norm(flight.velocity, axis=1)
    np.testing.assert_allclose(speed[:301], 60.0, rtol=1e-13)
    np.testing.assert_allclose(speed[2300:], 80.0, rtol=1e-13)


def test_there_is_no_sideslip(flight):
    forward = np.linalg.norm(flight.velocity, axis=1)
    body = np.einsum("kji,kj->ki", flight.attitude, flight.velocity)
    np.testing.assert_allclose(body, np.stack([0 * forward, forward, 0 * forward], axis=-1), atol=1e-11)


def test_attitude_is_a_rotation(flight):
    identity = np.einsum("kij,klj->kil", flight.attitude, flight.attitude)
    np.testing.assert_allclose(identity, np.broadcast_to(np.eye(3), identity.shape), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(flight.attitude), 1.0, atol=1e-13)


def test_position_is_the_integral_of_velocity(flight):
    """Against central differences over two steps: their error is dt^2/6 times the jerk, below 2e-4 m/s here."""
    moved = position_difference(flight.position[2:], flight.position[:-2]) / (2.0 * flight.dt)
    np.testing.assert_allclose(moved, flight.velocity[1:-1], atol=2e-3)
    np.testing.assert_allclose(moved[:, 2], flight.velocity[1:-1, 2], atol=2e-4)


def test_speed_height_and_heading_follow_the_smooth_step():
    x = np.linspace(-0.2, 1.2, 1401)
    np.testing.assert_allclose(np.gradient(smooth_step(x), x)[1:-1], smooth_step_rate(x)[1:-1], atol=2e-5)
    np.testing.assert_array_equal(smooth_step(np.array([-1.0, 0.0, 0.5, 1.0, 2.0])), [0.0, 0.0, 0.5, 1.0, 1.0])
    assert smooth_step_rate(x).max() == pytest.approx(35.0 / 16.0)


def largest_step_of_jerk(rate):
    """Largest change of the numerical jerk from one sample to the next, m/s^3; halves with dt if jerk is continuous."""
    trajectory = fly(MANOEUVRES, position=START, speed=60.0, heading=0.3, rate=rate)
    jerk = np.diff(trajectory.velocity, n=2, axis=0) * rate**2
    return np.abs(np.diff(jerk, axis=0)).max()


def test_jerk_is_continuous():
    """A step of jerk would stay where it is as the interval shrinks; without one the largest change shrinks with it."""
    coarse, fine = largest_step_of_jerk(50.0), largest_step_of_jerk(100.0)
    assert fine == pytest.approx(0.5 * coarse, rel=0.02)
    assert fine < 0.05


def test_angular_rate_is_continuous(flight):
    """The largest angular acceleration in the list of manoeuvres is 0.13 rad/s^2."""
    assert np.abs(np.diff(flight.angular_rate, axis=0)).max() * RATE < 0.2


def test_turns_are_coordinated(flight, liu):
    """What is left on the right axis is the Coriolis acceleration, at most 2 (omega + v/R tan(latitude)/2) v."""
    for trajectory in (flight, liu):
        speed = np.linalg.norm(trajectory.velocity, axis=1).max()
        coriolis = 2.0 * EARTH_RATE * speed + speed**2 / 6.37e6
        assert np.abs(trajectory.specific_force[:, 0]).max() < 1.1 * coriolis
    uncoordinated = np.tan(np.abs(euler_angles(liu.attitude)[1]).max()) * 9.8
    assert uncoordinated > 5.0


def test_bank_balances_the_turn():
    assert coordinated_bank(100.0, 0.0981, 9.81) == pytest.approx(np.pi / 4)
    assert coordinated_bank(100.0, -0.0981, 9.81) == pytest.approx(-np.pi / 4)


def test_standing_measurements_are_gravity_and_earth_rate():
    slow = fly([Straight(1.0)], position=START, speed=1e-9, heading=0.0)
    np.testing.assert_allclose(
        slow.angular_rate[0], [0.0, EARTH_RATE * np.cos(0.6), EARTH_RATE * np.sin(0.6)], atol=1e-13
    )
    np.testing.assert_allclose(slow.specific_force[0], [0.0, 0.0, 9.7947], atol=1e-3)


def test_a_right_turn_heads_and_banks_right():
    turn = fly([Turn(np.pi / 2, 30.0)], position=START, speed=60.0, heading=0.0)
    assert turn.velocity[-1] == pytest.approx([60.0, 0.0, 0.0], abs=1e-9)
    roll = euler_angles(turn.attitude)[1]
    assert roll.max() > 0.3
    assert roll.min() > -1e-12
    assert turn.angular_rate[1500, 2] < 0.0  # yaw is clockwise, the up axis counts the other way


def test_a_part_of_an_interval_at_the_end_is_left_out():
    assert fly([Straight(1.005)], position=START, speed=10.0, heading=0.0).num_steps == 100
    assert fly([Straight(0.1)] * 3, position=START, speed=10.0, heading=0.0).num_steps == 30


def test_liu_flight_is_where_the_paper_puts_it(liu):
    assert liu.num_steps == 110_000
    assert liu.rate == 100.0
    np.testing.assert_allclose(position_difference(liu.position[-1], LIU_END), 0.0, atol=1e-3)
    assert liu.position[0, 2] == 783.0
    speed = np.linalg.norm(liu.velocity, axis=1)
    assert (speed[0], speed[-1]) == pytest.approx((100.0, 150.0))
    np.testing.assert_allclose(liu.velocity[77_000:], np.broadcast_to([0.0, 150.0, 0.0], (33_001, 3)), atol=1e-9)
    heading = np.degrees(np.unwrap(euler_angles(liu.attitude)[2]))
    at = [0, 150, 240, 330, 420, 480, 660, 680, 770]
    np.testing.assert_allclose(heading[[100 * t for t in at]], [90, 90, 0, 0, 90, 90, -90, -90, 0], atol=1e-9)


def test_building_the_liu_flight_is_fast(liu):
    begin = time.process_time()
    liu_trajectory()
    assert time.process_time() - begin < 3.0


def start(manoeuvres=MANOEUVRES, *, position=START, speed=9.0, heading=0.0, rate=RATE):
    return fly(manoeuvres, position=position, speed=speed, heading=heading, rate=rate)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Straight(-1.0), "duration must be a finite number greater than 0, got -1.0"),
        (lambda: Turn(np.nan, 1.0), "angle must be a finite number, got nan"),
        (lambda: Climb(1.0, 0.0), "duration must be a finite number greater than 0, got 0.0"),
        (lambda: Accelerate(np.inf, 1.0), "speed_change must be a finite number, got inf"),
        (lambda: start([]), "manoeuvres is empty: give at least one of Straight"),
        (lambda: start(speed=0.0), "speed must be a finite number greater than 0, got 0.0"),
        (lambda: start(rate=-1.0), "rate must be a finite number greater than 0"),
        (lambda: start(heading=np.nan), "heading must be a finite number, got nan"),
        (lambda: start(position=(34.0, 108.0, 0.0)), "are these degrees"),
        (lambda: start(position=(0.5, 1.0)), "position must be three finite numbers"),
        (lambda: start(["turn"]), "one of Straight, Accelerate, Climb, Turn, got 'turn'"),
        (lambda: start([Straight(1e-3)]), "at least one IMU interval of 0.01 s"),
        (lambda: start([Accelerate(-9.0, 5.0)]), r"speed after Accelerate\(.*got 0.0"),
        (lambda: start([Climb(90.0, 5.0)]), "make the climb longer or lower"),
        (lambda: start([Straight(3e5)], position=(1.5, 0.0, 0.0), rate=0.1), "leaves latitudes"),
    ],
)
def test_bad_input_is_told_what_is_valid(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_arrays_that_do_not_fit_are_refused(flight):
    with pytest.raises(ValueError, match=r"velocity must have shape \(12001, 3\), got \(12000, 3\)"):
        dataclasses.replace(flight, velocity=flight.velocity[1:])


CIRCLE = np.linspace(0.0, 60.0, 61)
"""Times of points on a circle of radius 200 m, once round in 60 s, climbing 1 m/s, s."""


def circle(times):
    angle = 2.0 * np.pi * times / 60.0
    east, north = 200.0 * np.sin(angle), 200.0 * (1.0 - np.cos(angle))
    return displace(START, np.stack([east, north, times], axis=-1))


def test_it_flies_through_points_with_the_velocity_and_the_bank_of_the_circle():
    """Points of a known circle: v = 2πR/T, and a coordinated bank with tan φ = v²/(R g); the ends of a spline bend."""
    flown = fly_through(CIRCLE, circle(CIRCLE), rate=50.0)
    missed = position_difference(flown.position[::50], circle(CIRCLE))
    np.testing.assert_allclose(missed, 0.0, atol=2e-3)
    speed = np.hypot(flown.velocity[:, 0], flown.velocity[:, 1])
    np.testing.assert_allclose(speed[250:-250], 2.0 * np.pi * 200.0 / 60.0, rtol=1e-4)
    np.testing.assert_allclose(flown.velocity[:, 2], 1.0, atol=1e-6)
    pitch, roll, _ = euler_angles(flown.attitude[1500])
    assert roll == pytest.approx(-np.arctan((2.0 * np.pi / 60.0) ** 2 * 200.0 / 9.795), rel=2e-3)
    assert pitch == pytest.approx(np.arctan2(1.0, 2.0 * np.pi * 200.0 / 60.0), rel=1e-3)


def test_points_on_a_straight_line_give_the_straight_flight():
    """Along a meridian, where straight and level means due north."""
    flown = fly((Straight(30.0),), position=START, speed=40.0, heading=0.0, rate=50.0)
    through = fly_through(flown.time[::50], flown.position[::50], rate=50.0)
    np.testing.assert_allclose(through.velocity, flown.velocity, atol=1e-4)
    np.testing.assert_allclose(through.attitude, flown.attitude, atol=1e-4)
    np.testing.assert_allclose(through.specific_force[100:-100], flown.specific_force[100:-100], atol=1e-3)


def test_it_crosses_the_date_line():
    path = displace((0.2, np.pi, 0.0), np.stack([np.linspace(-500.0, 500.0, 51), np.zeros(51), np.zeros(51)], axis=-1))
    path[:, 1] = (path[:, 1] + np.pi) % (2.0 * np.pi) - np.pi
    flown = fly_through(np.arange(51.0), path)
    np.testing.assert_allclose(flown.velocity[:, 0], 20.0, atol=1e-3)


@pytest.mark.parametrize(
    ("times", "positions", "words"),
    [
        (np.arange(5.0), circle(np.arange(5.0)), "times must be 6 or more"),
        (np.zeros(6), circle(np.arange(6.0)), "times must increase"),
        (np.arange(6.0), circle(np.arange(7.0)), r"shape \(6, 3\)"),
        (np.arange(6.0), np.degrees(circle(np.arange(6.0))), "are these degrees"),
        (np.arange(6.0), np.tile(START, (6, 1)), "gives no heading"),
        (np.arange(6.0) * 1e-4, circle(np.arange(6.0)), "must span 1 to"),
    ],
)
def test_points_that_are_no_path_are_refused(times, positions, words):
    with pytest.raises(ValueError, match=words):
        fly_through(times, positions)
