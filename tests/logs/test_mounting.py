"""The mounting of an IMU found from a drive: level roads, known rotations, and drives that do not tell it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from spoofgym.logs.log import read_log
from spoofgym.logs.mounting import find_delay, find_mounting

RATE = 50
LENGTH = 300.0
BIAS = np.array([0.004, -0.003, 0.002])
Profile = Callable[[np.ndarray], np.ndarray]


def speed_of_a_drive(time: np.ndarray) -> np.ndarray:
    """20 s at rest, then between 6 and 14 m/s."""
    moving = time > 20.0
    return np.where(moving, 10.0 * (1.0 - np.exp(-(time - 20.0) / 5.0)) + 4.0 * np.sin((time - 20.0) / 6.0), 0.0)


def turns_of_a_drive(time: np.ndarray) -> np.ndarray:
    """Yaw rate clockwise, rad/s, with right turns the longer ones."""
    return np.where(time > 40.0, 0.25 * np.sin(time / 4.0) + 0.02, 0.0)


def drive(
    rotation: Rotation,
    seed: int,
    speed: Profile = speed_of_a_drive,
    turns: Profile = turns_of_a_drive,
    delay: float = 0.0,
    velocity_noise: float = 0.1,
) -> tuple[np.ndarray, ...]:
    """A level car, in closed form: IMU time, rate and force in sensor axes, times and ENU velocities of the fixes."""
    generator = np.random.default_rng(seed)
    time = np.arange(0.0, LENGTH, 1.0 / RATE)
    fine = np.gradient(speed(time), time)
    course = np.concatenate([[0.0], np.cumsum(0.5 * (turns(time)[1:] + turns(time)[:-1]) / RATE)])
    zero = np.zeros_like(time)
    rate = np.column_stack([zero, zero, -turns(time)])
    force = np.column_stack([speed(time) * turns(time), fine, zero + 9.81])
    rate, force = rotation.apply(rate) + BIAS, rotation.apply(force)
    rate += 0.003 * generator.standard_normal(rate.shape)
    force += 0.3 * generator.standard_normal(force.shape)
    fixes = np.arange(0.0, LENGTH - 1.0)
    at, heading = speed(fixes), np.interp(fixes, time, course)
    velocity = np.column_stack([at * np.sin(heading), at * np.cos(heading), np.zeros_like(at)])
    velocity[:, :2] += velocity_noise * generator.standard_normal((len(at), 2)) * (at > 0.0)[:, None]
    return time, rate, force, fixes + delay, velocity


@pytest.mark.parametrize("seed", range(6))
def test_a_random_rotation_is_found(seed: int) -> None:
    rotation = Rotation.random(random_state=seed)
    time, rate, force, fixes, velocity = drive(rotation, seed, delay=0.3)
    delay = find_delay("drive", time, rate, force, fixes, velocity)
    assert delay == pytest.approx(0.3, abs=0.05)
    mounting = find_mounting("drive", time, rate, force, fixes - delay, velocity)
    error = Rotation.from_matrix(mounting.rotation @ rotation.as_matrix())
    assert np.degrees(error.magnitude()) < 1.5
    assert np.linalg.det(mounting.rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(mounting.gyro_bias, BIAS, atol=1e-3)
    assert mounting.yaw_correlation > 0.95


def test_the_stated_sigma_is_that_of_the_heading() -> None:
    """White noise of the force alone: squared errors over sigma are chi-square, false failures of 2e-7."""
    rotation = Rotation.from_euler("zyx", [0.4, 1.4, -0.2])
    drives = 60
    normalised = []
    for seed in range(drives):
        found = find_mounting("drive", *drive(rotation, seed, velocity_noise=0.0))
        forward = rotation.inv().apply(found.rotation[1])
        normalised.append(np.arctan2(forward[0], forward[1]) / found.heading_sigma)
    low, high = chi2.ppf(1e-7, drives), chi2.isf(1e-7, drives)
    assert low < np.square(normalised).sum() < high


def test_a_drive_without_accelerations_is_refused() -> None:
    straight = drive(Rotation.identity(), 1, speed=lambda t: np.full_like(t, 10.0), turns=np.zeros_like)
    with pytest.raises(ValueError, match=r"heading about the vertical is known to .*must accelerate, brake and turn"):
        find_mounting("drive", *straight)


def test_a_drive_without_turns_is_refused() -> None:
    with pytest.raises(ValueError, match=r"yaw rate and course rate .*the vehicle must turn"):
        find_mounting("drive", *drive(Rotation.identity(), 1, turns=np.zeros_like))


def test_a_vehicle_that_stands_is_refused() -> None:
    with pytest.raises(ValueError, match="0 intervals between fixes at 3 m/s or more, needed are 30"):
        find_mounting("drive", *drive(Rotation.identity(), 1, speed=np.zeros_like))


def test_left_handed_axes_of_the_gyro_are_refused() -> None:
    time, rate, force, fixes, velocity = drive(Rotation.identity(), 1)
    with pytest.raises(ValueError, match="the same right-handed axes"):
        find_mounting("drive", time, -rate, force, fixes, velocity)


def test_a_delay_of_seconds_is_refused() -> None:
    with pytest.raises(ValueError, match="1 s apart or more; set gnss_delay_s"):
        find_delay("drive", *drive(Rotation.identity(), 1, delay=1.6))


def test_no_standstill_no_bias() -> None:
    found = find_mounting("drive", *drive(Rotation.identity(), 1, speed=lambda t: 10.0 + 4.0 * np.sin(t / 6.0)))
    np.testing.assert_array_equal(found.gyro_bias, 0.0)


def test_a_log_of_unknown_mounting_comes_in_body_axes_and_on_one_clock(tmp_path) -> None:
    time, rate, force, fixes, velocity = drive(Rotation.random(random_state=9), 9, delay=0.3)
    degrees = np.degrees(np.cumsum(velocity, axis=0) / 6.4e6)
    tables = {
        "imu": ("t_s,gx_radps,gy_radps,gz_radps,ax_mps2,ay_mps2,az_mps2", np.column_stack([time, rate, force])),
        "gnss": (
            "t_s,lat_deg,lon_deg,h_m,vn_mps,ve_mps,vd_mps",
            np.column_stack([fixes, degrees[:, 1], degrees[:, 0], 0 * fixes, velocity[:, [1, 0, 2]]]),
        ),
    }
    for name, (columns, values) in tables.items():
        np.savetxt(tmp_path / f"{name}.csv", values, delimiter=",", header=columns, comments="", fmt="%.9f")
    (tmp_path / "log.toml").write_text("imu_to_body_frd = []\nstart_s = 0.0\n")
    log = read_log(tmp_path)
    np.testing.assert_allclose(log.fixes.time, fixes - 0.3, atol=0.05)
    turning = turns_of_a_drive(time)
    np.testing.assert_allclose(log.angular_rate.mean(axis=0), [0.0, 0.0, -turning.mean()], atol=2e-3)
    lateral = np.polyfit(speed_of_a_drive(time) * turning, log.specific_force[:, 0], 1)
    assert lateral[0] == pytest.approx(1.0, abs=0.05)
    (tmp_path / "log.toml").write_text("imu_to_body_frd = []\nstart_s = 0.0\ngnss_delay_s = 0.25\n")
    np.testing.assert_allclose(read_log(tmp_path).fixes.time, fixes - 0.25, atol=1e-9)
