"""The mechanization against its inverse, an independent truth and integrator (pyins), and scipy's rotations."""

import numpy as np
import pytest
from pyins import earth, sim, strapdown
from scipy.spatial.transform import Rotation

from spoofgym.geodesy import normal_gravity, position_difference
from spoofgym.kernels import njit
from spoofgym.mechanization import (
    attitude_matrix,
    gravity_and_coriolis,
    invert_mechanization,
    mechanize,
    rotation,
    rotation_vector,
)
from spoofgym.scenarios.liu_flight import liu_trajectory
from tests.attitudes import euler_angles

DEGREES = np.array([np.pi / 180.0, np.pi / 180.0, 1.0])


@njit(cache=True)
def integrate(attitude, velocity, position, angular_rate, specific_force, dt):
    """Mechanizes n samples from states [0], writing states 1..n."""
    mean_force = np.zeros(3)
    for i in range(len(angular_rate)):
        attitude[i + 1], velocity[i + 1], position[i + 1] = attitude[i], velocity[i], position[i]
        mechanize(attitude[i + 1], velocity[i + 1], position[i + 1], angular_rate[i], specific_force[i], dt, mean_force)
    return mean_force


def mechanized(attitude, velocity, position, angular_rate, specific_force, dt):
    """Attitude (n+1, 3, 3), velocity (n+1, 3) and position (n+1, 3) from a first state and n samples."""
    states = [np.empty((len(angular_rate) + 1, *np.shape(part))) for part in (attitude, velocity, position)]
    for state, first in zip(states, (attitude, velocity, position), strict=True):
        state[0] = first
    integrate(*states, np.ascontiguousarray(angular_rate), np.ascontiguousarray(specific_force), dt)
    return states


def to_right_forward_up(vectors):
    """Forward-right-down to right-forward-up (and, the swap being the same, NED to ENU)."""
    return np.ascontiguousarray(np.asarray(vectors)[:, [1, 0, 2]] * [1.0, 1.0, -1.0])


class PyinsMotion:
    """A ten-minute motion of pyins, true states and ideal increments turned to ENU and right-forward-up."""

    def __init__(self, dt, mean, amplitude, period):
        self.dt = dt
        self.trajectory, imu = sim.generate_sine_velocity_motion(
            dt, 600.0, [34.0, 108.0, 800.0], mean, amplitude, period, sensor_type="increment"
        )
        self.increments = strapdown.compute_increments_from_imu(imu, "increment")
        self.attitude, self.velocity, self.position = self.states(self.trajectory)
        self.angular_rate = to_right_forward_up(imu[["gyro_x", "gyro_y", "gyro_z"]])[1:] / dt
        self.specific_force = to_right_forward_up(imu[["accel_x", "accel_y", "accel_z"]])[1:] / dt

    @staticmethod
    def states(frame):
        pitch, roll, heading = np.radians(frame[["pitch", "roll", "heading"]].to_numpy().T)
        return (
            attitude_matrix(pitch, roll, heading),
            to_right_forward_up(frame[["VN", "VE", "VD"]]),
            frame[["lat", "lon", "alt"]].to_numpy() * DEGREES,
        )

    def under_our_gravity(self, specific_force):
        """What the accelerometers would measure on the same path if gravity were ours instead of pyins'."""
        middle = 0.5 * (self.position[1:] + self.position[:-1])
        ours = np.array([normal_gravity(latitude, height) for latitude, _, height in middle])
        more = ours - earth.gravity(np.degrees(middle[:, 0]), middle[:, 2])
        up = 0.5 * (self.attitude[1:, 2] + self.attitude[:-1, 2])
        return specific_force + more[:, None] * up

    def first(self):
        return self.attitude[0], self.velocity[0], self.position[0]


@pytest.fixture(scope="module")
def smooth_motion():
    return PyinsMotion(0.01, [100.0, 50.0, 0.0], [50.0, 30.0, 5.0], 300.0)


def test_liu_flight_comes_back_without_aid():
    flight = liu_trajectory()
    attitude, velocity, position = mechanized(
        flight.attitude[0],
        flight.velocity[0],
        flight.position[0],
        flight.angular_rate,
        flight.specific_force,
        flight.dt,
    )
    deviation = np.abs(position_difference(position, flight.position)).max(axis=0)
    assert deviation[:2].max() < 1e-3, "a pure INS must stay within a millimetre over 1100 s"
    assert deviation[:2].max() < 1e-6, "and the inverse is exact, so that only rounding is left"
    assert deviation[2] < 1e-4
    np.testing.assert_allclose(velocity, flight.velocity, atol=1e-7)
    np.testing.assert_allclose(attitude, flight.attitude, atol=1e-11)


def test_random_states_are_inverted_to_rounding():
    """Steps far larger than any vehicle's, so that no term of the scheme is too small to matter."""
    rng = np.random.default_rng(3)
    rates, forces = rng.uniform(-9.0, 9.0, (200, 3)), rng.uniform(-80.0, 80.0, (200, 3))
    states = mechanized(attitude_matrix(0.2, -0.4, 2.0), [200.0, -90.0, 10.0], [0.9, -2.0, 9000.0], rates, forces, 0.05)
    angular_rate, specific_force = invert_mechanization(*states, 0.05)
    np.testing.assert_allclose(angular_rate, rates, atol=1e-12)
    np.testing.assert_allclose(specific_force, forces, atol=1e-9)


def test_ten_minutes_of_independent_truth(smooth_motion):
    motion = smooth_motion
    force = motion.under_our_gravity(motion.specific_force)
    attitude, velocity, position = mechanized(*motion.first(), motion.angular_rate, force, motion.dt)
    assert np.abs(position_difference(position, motion.position)).max() < 3e-3
    assert np.abs(velocity - motion.velocity)[1:].max() < 2e-5
    turned = np.einsum("kji,kjl->kil", motion.attitude, attitude)
    assert np.linalg.norm(Rotation.from_matrix(turned).as_rotvec(), axis=1).max() < 1e-7


def test_step_by_step_against_an_independent_integrator():
    """The same increments; a hard motion that turns its heading once a minute and changes velocity by 80 m/s.

    What is left is that pyins takes the Coriolis acceleration at the start of a step: 1 mm of height in a minute.
    """
    motion = PyinsMotion(0.01, [5.0, -3.0, 0.0], [40.0, 30.0, 2.0], 60.0)
    theta = motion.increments[["theta_x", "theta_y", "theta_z"]].to_numpy(copy=True)
    change = motion.increments[["dv_x", "dv_y", "dv_z"]].to_numpy(copy=True)  # resolved at the start of each step
    change = Rotation.from_rotvec(0.5 * theta).apply(change, inverse=True)  # ours: in the middle
    rate, force = to_right_forward_up(theta) / motion.dt, to_right_forward_up(change) / motion.dt
    theirs = strapdown.Integrator(motion.trajectory.iloc[0]).integrate(motion.increments)
    attitude, velocity, position = PyinsMotion.states(theirs)
    ours = mechanized(*motion.first(), rate, motion.under_our_gravity(force), motion.dt)
    minute = round(60.0 / motion.dt) + 1
    assert np.abs(position_difference(ours[2], position))[:minute].max() < 2e-3
    assert np.abs(ours[1] - velocity)[1:minute].max() < 5e-5
    assert np.abs(ours[0] - attitude)[:minute].max() < 1e-7
    assert np.abs(position_difference(ours[2], position)).max() < 2e-2


def test_scheme_is_of_second_order():
    """Halving the step quarters the distance to a finely stepped solution of constant rate and force."""
    rate, force = np.array([0.01, -0.02, 0.06]), np.array([2.0, 0.5, 9.9])

    def end(steps):
        duration, shape = 30.0, (steps, 3)
        states = mechanized(
            attitude_matrix(0.05, 0.1, 0.7), [120.0, 60.0, 2.0], [0.6, 1.9, 900.0],
            np.broadcast_to(rate, shape), np.broadcast_to(force, shape), duration / steps,
        )  # fmt: skip
        return states[2][-1]

    exact = end(96_000)
    coarse, fine = (np.linalg.norm(position_difference(end(steps), exact)) for steps in (1500, 3000))
    assert fine == pytest.approx(coarse / 4.0, rel=0.05)


def test_mean_force_is_added_up():
    """Over one step the velocity changes by the integral of the force and by gravity and Coriolis acceleration."""
    attitude, velocity, position = (
        attitude_matrix(0.1, 0.2, 0.3),
        np.array([90.0, 60.0, 3.0]),
        np.array([0.6, 1.9, 900.0]),
    )
    before, start, mean_force = velocity.copy(), position.copy(), np.array([1.0, 2.0, 3.0])
    mechanize(attitude, velocity, position, np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 9.0]), 0.01, mean_force)
    other = np.array(gravity_and_coriolis(start[0], start[2], *before))
    np.testing.assert_allclose(mean_force - [1.0, 2.0, 3.0], velocity - before - 0.01 * other, atol=1e-7)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 1e-3, 0.1414, 0.1415, 1.0, 3.0])
def test_rotations_agree_with_scipy(angle):
    """An entry is within 1 and rounds some four times on either side; the way back divides by sin(angle) / angle."""
    vector = angle * np.array([2.0, -1.0, 2.0]) / 3.0
    matrix = np.array(rotation(*vector))
    rounding = 4.0 * np.finfo(float).eps
    np.testing.assert_allclose(matrix.reshape(3, 3), Rotation.from_rotvec(vector).as_matrix(), rtol=0, atol=rounding)
    np.testing.assert_allclose(rotation_vector(tuple(matrix)), vector, rtol=0, atol=rounding / np.sinc(angle / np.pi))


def test_attitude_is_yaw_then_pitch_then_roll_of_a_right_forward_up_body():
    pitch, roll, yaw = 0.3, -0.7, 2.5
    expected = Rotation.from_euler("ZXY", [-yaw, pitch, roll]).as_matrix()
    # entries within 1 of two or three products each, by another way on the other side: eight roundings
    np.testing.assert_allclose(attitude_matrix(pitch, roll, yaw), expected, atol=8.0 * np.finfo(float).eps)


def test_euler_angles_go_back():
    rng = np.random.default_rng(4)
    angles = rng.uniform([[-1.5], [-3.1], [-3.1]], [[1.5], [3.1], [3.1]], (3, 100))
    np.testing.assert_allclose(euler_angles(attitude_matrix(*angles)), angles, atol=1e-13)


def test_shapes_that_do_not_fit_are_refused():
    attitude, vectors = np.broadcast_to(np.eye(3), (5, 3, 3)), np.zeros((5, 3))
    with pytest.raises(ValueError, match=r"got \(5, 3, 3\), \(4, 3\) and \(5, 3\)"):
        invert_mechanization(attitude, vectors[1:], vectors, 0.01)
    with pytest.raises(ValueError, match="n >= 1"):
        invert_mechanization(attitude[:1], vectors[:1], vectors[:1], 0.01)
    with pytest.raises(ValueError, match=r"dt must be positive, got 0.0"):
        invert_mechanization(attitude, vectors, vectors, 0.0)
