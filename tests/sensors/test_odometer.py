"""The odometer: Song's equations against circles and polygons, and its errors one by one."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2

from spoofgym.sensors.odometer import (
    GRADES,
    Odometer,
    OdometerGrade,
    PlanarMotion,
    draw_displacement,
    encode,
    odometer_grade,
    step_displacement,
    wheel_travel,
)

STEPS, STEP, SPEED = 300, 0.1, 0.5
FINE = Odometer(counts_per_turn=10**9)
PERFECT = OdometerGrade(
    name="perfect", heading_offset=0.0, heading_drift=0.0, heading_random_walk=0.0, scale=0.0, slip=0.0, source="none"
)


def encoder_track(travel, odometer, yaw):
    """Dead reckoning by the encoders alone (Song 2021, eq 3).

    The paper prints the whole yaw increment within sine and cosine: the mean direction of a step is its middle's, with
    half of it.

    Args:
        travel: of the left and the right wheel in each step, (J, 2), m.
        odometer: gives the base.
        yaw: at the start, rad.

    Returns:
        Position from the start, (J+1, 2), east and north, m, and yaw, (J+1,), rad.
    """
    turned = (travel[:, 0] - travel[:, 1]) / odometer.wheel_base
    heading = yaw + np.concatenate([[0.0], np.cumsum(turned)])
    steps = step_displacement(travel, heading[:-1] + 0.5 * turned)
    return np.vstack([np.zeros(2), np.cumsum(steps, axis=0)]), heading


def circle(turn_rate):
    """A right turn of constant rate from north on, by its closed form."""
    time = STEP * np.arange(STEPS + 1)
    yaw, radius = turn_rate * time, SPEED / turn_rate
    position = radius * np.column_stack([1.0 - np.cos(yaw), np.sin(yaw)])
    velocity = SPEED * np.column_stack([np.sin(yaw), np.cos(yaw)])
    return PlanarMotion(position, yaw, velocity, np.full(STEPS, SPEED * STEP))


def straight():
    way = SPEED * STEP * np.arange(STEPS + 1)
    north = np.column_stack([np.zeros_like(way), way])
    return PlanarMotion(north, np.zeros(STEPS + 1), np.tile([0.0, SPEED], (STEPS + 1, 1)), np.full(STEPS, SPEED * STEP))


def rotated(vectors, angle):
    """Clockwise, as yaw turns."""
    east, north = vectors.T
    return np.column_stack(
        [east * np.cos(angle) + north * np.sin(angle), north * np.cos(angle) - east * np.sin(angle)]
    )


def test_a_turn_of_the_wheel_is_its_circumference():
    odometer = Odometer()
    assert wheel_travel(np.array([495.0, -990.0]), odometer) == pytest.approx(
        [2 * np.pi * 0.0325, -4 * np.pi * 0.0325]
    )


def test_counts_never_lose_more_than_one_mark():
    travel = np.random.default_rng(0).uniform(-0.01, 0.06, (5000, 2))
    odometer = Odometer()
    counts = encode(travel, odometer)
    np.testing.assert_array_equal(counts, np.round(counts))
    behind = np.cumsum(travel, axis=0) - np.cumsum(wheel_travel(counts, odometer), axis=0)
    assert behind.min() >= -1e-12
    assert behind.max() <= odometer.travel_per_count + 1e-12


@pytest.mark.parametrize("turn_rate", [0.02, -0.3, 1.0])
def test_encoders_alone_follow_a_circle(turn_rate):
    """With half the increment of yaw the chords of eq 3 point right, and are too long by x / sin x, x half a turn."""
    motion = circle(turn_rate)
    odometer = Odometer()
    left, right = motion.wheel_travel(odometer.wheel_base).T
    np.testing.assert_allclose((left - right) / odometer.wheel_base, np.diff(motion.yaw))
    np.testing.assert_allclose(0.5 * (left + right), motion.travel)
    position, yaw = encoder_track(np.column_stack([left, right]), odometer, 0.0)
    half = 0.5 * turn_rate * STEP
    np.testing.assert_allclose(yaw, motion.yaw, atol=1e-12)
    np.testing.assert_allclose(position, motion.position * half / np.sin(half), atol=1e-12)


def test_the_yaw_at_the_end_of_a_step_turns_the_track_by_half_a_step():
    """Eq 4 on a circle."""
    motion = circle(1.0)
    steps = step_displacement(motion.wheel_travel(0.2), motion.yaw[1:])
    half = 0.5 * STEP
    np.testing.assert_allclose(steps, rotated(motion.displacement, half) * half / np.sin(half), atol=1e-12)


def test_a_perfect_odometer_is_off_by_its_resolution():
    motion, odometer = straight(), Odometer()
    drawn = draw_displacement(motion, odometer, PERFECT, np.random.default_rng(0))
    assert np.abs(np.cumsum(drawn - motion.displacement, axis=0)).max() <= odometer.travel_per_count


def test_a_heading_offset_turns_the_track_and_a_scale_stretches_it():
    motion = straight()
    grade = dataclasses.replace(PERFECT, heading_offset=10.0, scale=0.05)
    offset, _, scale = np.random.default_rng(7).standard_normal(3)
    drawn = draw_displacement(motion, FINE, grade, np.random.default_rng(7))
    expected = rotated(motion.displacement, np.radians(10.0 * offset)) * (1.0 + 0.05 * scale)
    np.testing.assert_allclose(drawn, expected, atol=1e-9)


def test_a_drift_makes_an_arc():
    """Of the rate n degrees per second, 4 % of a step from the closed form: yaw is taken at the end of each."""
    motion = straight()
    drift = np.random.default_rng(3).standard_normal(3)[1]
    drawn = draw_displacement(motion, FINE, dataclasses.replace(PERFECT, heading_drift=1.0), np.random.default_rng(3))
    rate = np.radians(drift)
    half = 0.5 * rate * STEP
    arc = circle(rate)
    np.testing.assert_allclose(drawn, rotated(arc.displacement, half) * half / np.sin(half), atol=1e-9)


@pytest.mark.parametrize("kind", ["heading_random_walk", "slip"])
def test_random_walks_grow_with_time_and_way(kind):
    """Variance of 2000 runs after 30 s and 15 m; a correct one leaves the interval in 1e-8 of the cases."""
    motion, runs = straight(), 2000
    size = {"heading_random_walk": 0.2, "slip": 0.01}[kind]
    grade = dataclasses.replace(PERFECT, **{kind: size})
    drawn = np.array([draw_displacement(motion, FINE, grade, np.random.default_rng(i)) for i in range(runs)])
    if kind == "slip":
        value, variance = (drawn - motion.displacement)[:, :, 1].sum(axis=1), 0.5 * size**2 * 15.0
    else:
        value, variance = np.arctan2(drawn[:, -1, 0], drawn[:, -1, 1]), np.radians(size) ** 2 * 30.0
    low, high = chi2.ppf([5e-9, 1.0 - 5e-9], runs) / runs
    assert low < np.square(value).mean() / variance < high


def test_drift_sigma_is_what_an_epoch_goes_wrong():
    """The last second of 300 s on a straight line; set-b, 2000 runs, an interval that a correct one leaves in 1e-8."""
    grade, runs, seconds = GRADES["set-b"], 2000, 300
    way = SPEED * STEP * np.arange(10 * seconds + 1)
    motion = PlanarMotion(
        np.column_stack([0.0 * way, way]), 0.0 * way, np.tile([0.0, SPEED], (len(way), 1)), np.diff(way)
    )
    wrong = np.empty(runs)
    for i in range(runs):
        drawn = draw_displacement(motion, FINE, grade, np.random.default_rng(i))[-10:]
        error = (drawn - motion.displacement[-10:]).sum(axis=0)
        # small angles: the norm grows with 2 sin(x / 2) and not with x
        wrong[i] = 2.0 * np.arcsin(np.hypot(*error) / (2.0 * SPEED)) * SPEED
    low, high = chi2.ppf([5e-9, 1.0 - 5e-9], runs) / runs
    assert 0.98 * low < np.square(wrong).mean() / grade.drift_sigma(SPEED, 1.0, float(seconds)) ** 2 < 1.02 * high


def test_the_same_numbers_are_drawn_whatever_the_grade():
    used = []
    for name in GRADES:
        rng = np.random.default_rng(0)
        draw_displacement(straight(), Odometer(), odometer_grade(name), rng)
        used.append(rng.standard_normal())
    assert len(set(used)) == 1


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Odometer(wheel_radius=0.0), "odometer: wheel_radius must be a finite number greater than 0, got 0.0"),
        (lambda: Odometer(counts_per_turn=0), "counts_per_turn must be a whole number, 1 or more, got 0"),
        (lambda: dataclasses.replace(PERFECT, slip=-1.0), "'perfect': slip must be a finite number, 0 or more"),
        (lambda: odometer_grade("set-c"), "grade must be one of set-a, set-b, table-1, got 'set-c'"),
    ],
)
def test_bad_values_are_refused(build, message):
    with pytest.raises(ValueError, match=message):
        build()
