"""The error dynamics against central differences of the mechanization, and the discretisation against scipy's expm."""

import numpy as np
import pytest
from scipy.linalg import expm

from spoofgym.geodesy import displace, position_difference
from spoofgym.mechanization import attitude_matrix, mechanize
from spoofgym.navigation.error_model import navigation_dynamics, transition_matrix

DT = 1e-3
ATTITUDE = attitude_matrix(0.08, -0.3, 1.1)
VELOCITY = np.array([110.0, 85.0, 4.0])
POSITION = np.array([0.61, 1.88, 2283.0])
RATE = np.array([0.02, -0.01, 0.05])
FORCE = np.array([1.5, -0.7, 9.9])
STEPS = np.concatenate([np.full(3, 1e-5), np.full(3, 1e-2), np.full(3, 10.0)])


def perturbed(error):
    """A state that is off by an error (9,): attitude (I - [φ x]) C, velocity, position in metres."""
    phi = error[:3]
    cross = np.array([[0, -phi[2], phi[1]], [phi[2], 0, -phi[0]], [-phi[1], phi[0], 0]])
    return expm(-cross) @ ATTITUDE, VELOCITY + error[3:6], displace(POSITION, error[6:])


def mechanized(state, rate=RATE, force=FORCE):
    attitude, velocity, position = (np.array(part, dtype=float) for part in state)
    mean_force = np.zeros(3)
    mechanize(attitude, velocity, position, rate, force, DT, mean_force)
    return (attitude, velocity, position), mean_force / DT


def error_between(state, reference):
    rotation = reference[0] @ state[0].T  # I + [φ x]
    odd = 0.5 * (rotation - rotation.T)
    phi = np.array([odd[2, 1], odd[0, 2], odd[1, 0]])
    return np.concatenate([phi, state[1] - reference[1], position_difference(state[2], reference[2])])


@pytest.fixture(scope="module")
def dynamics():
    (_, velocity, position), force = mechanized((ATTITUDE, VELOCITY, POSITION))
    matrix = np.empty((9, 9))
    middle = [0.5 * (a + b) for a, b in ((VELOCITY, velocity), (POSITION, position))]
    navigation_dynamics(*middle, force, matrix)
    return matrix


@pytest.fixture(scope="module")
def differences():
    """Columns (error after one step - error before) / dt, by central differences."""
    reference, _ = mechanized((ATTITUDE, VELOCITY, POSITION))
    columns = []
    for i, size in enumerate(STEPS):
        step = np.zeros(9)
        step[i] = size
        ends = [error_between(mechanized(perturbed(sign * step))[0], reference) for sign in (1, -1)]
        columns.append(((ends[0] - ends[1]) / (2 * size) - np.eye(9)[i]) / DT)
    return np.array(columns).T


@pytest.mark.parametrize("rows", [slice(0, 3), slice(3, 6), slice(6, 9)], ids=["attitude", "velocity", "position"])
@pytest.mark.parametrize("columns", [slice(0, 3), slice(3, 6), slice(6, 9)], ids=["attitude", "velocity", "position"])
def test_dynamics_are_the_derivative_of_the_mechanization(dynamics, differences, rows, columns):
    """A step of 1 ms leaves terms of second order; dR/dlatitude is neglected in the position columns."""
    expected, got = differences[rows, columns], dynamics[rows, columns]
    scale = np.max(np.abs(expected))
    assert scale > 0 or np.max(np.abs(got)) == 0
    # attitude from attitude etc. are rates of 1e-4 rad/s: rounding of the difference quotient allows 1e-9 of the state
    second_order = DT * np.max(np.abs(dynamics @ dynamics)[rows, columns])
    np.testing.assert_allclose(got, expected, atol=4e-3 * scale + second_order)


def test_transition_is_the_exponential(dynamics):
    interval = 1.0
    full = np.zeros((15, 15))
    full[:9, :9] = dynamics
    full[:3, 9:12], full[3:6, 12:15] = -ATTITUDE, ATTITUDE
    transition = np.empty((9, 15))
    transition_matrix(dynamics.copy(), ATTITUDE, interval, transition, np.empty((2, 9, 9)))
    exact = expm(full * interval)[:9]
    # third order: the first term left out is (A T)^4 / 24
    np.testing.assert_allclose(transition, exact, atol=np.max(np.abs(np.linalg.matrix_power(full, 4))) / 20 + 1e-12)


def test_bias_columns_follow_the_mechanization():
    """A gyro or accelerometer bias of one sample acts through the bias columns of Φ."""
    reference, force = mechanized((ATTITUDE, VELOCITY, POSITION))
    matrix, transition = np.empty((9, 9)), np.empty((9, 15))
    navigation_dynamics(VELOCITY, POSITION, force, matrix)
    transition_matrix(matrix, ATTITUDE, DT, transition, np.empty((2, 9, 9)))
    for i in range(6):
        bias = np.zeros(6)
        bias[i] = 1e-3
        state, _ = mechanized((ATTITUDE, VELOCITY, POSITION), RATE + bias[:3], FORCE + bias[3:])
        error = error_between(state, reference)
        np.testing.assert_allclose(error[:6] / 1e-3, transition[:6, 9 + i], atol=2e-3 * DT)
