"""The kernels of the tightly coupled filter against the textbook's dense equations, and H against real distances."""

import numpy as np
import pytest

from spoofgym.geodesy import displace, geodetic_to_ecef
from spoofgym.navigation import kalman
from spoofgym.navigation.batch import Weights
from spoofgym.navigation.tight import kalman as tight_filter
from spoofgym.navigation.tight.states import (
    CLOCK,
    DRIFT,
    NUM_COMMON,
    num_states,
    observation_columns,
    observation_values,
    slot_states,
)
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.ranging import obliquity, troposphere_mapping

SHORT = "kujur-flight:onset=30,horizon=20"


@pytest.fixture(scope="module")
def scenario():
    return make_scenario(SHORT)


def dense_observation(dynamics, k):
    """H, (m, n), with the repeated columns added up."""
    matrix = np.zeros((dynamics.dimension, dynamics.num_states))
    for a in range(dynamics.dimension):
        np.add.at(matrix[a], dynamics.columns[a], dynamics.values[k, a])
    return matrix


def dense_transition(dynamics, k):
    matrix = np.diag(dynamics.decay)
    matrix[:9, :9] = 0.0
    matrix[:9, :15] = dynamics.transition[k]
    matrix[CLOCK, DRIFT] = dynamics.interval
    return matrix


def dense_noise(dynamics, k):
    matrix = np.diag(dynamics.variance)
    matrix[:9, :9] = dynamics.process_noise[k]
    matrix[CLOCK : DRIFT + 1, CLOCK : DRIFT + 1] = dynamics.clock_noise
    return matrix


def some_covariance(n, seed):
    root = np.random.default_rng(seed).standard_normal((n, n))
    return root @ root.T / n + np.eye(n)


@pytest.mark.parametrize("observable", ["carrier", "rate"])
def test_rows_of_h_are_the_derivatives_of_the_ranges(scenario, observable):
    """Central differences of the distance over 20 m, exact to the fourth power of 10 m / 20 000 km."""
    geometry, slots = scenario.family.geometry, scenario.slots
    columns, values = observation_columns(slots, observable), observation_values(geometry, observable)
    k = 7
    time = geometry.time[k] - scenario.family.start_time
    truth = scenario.truth.trajectory.position[round(time * scenario.truth.trajectory.rate)]
    present = geometry.present[k]
    for axis in range(3):
        step = 10.0 * np.eye(3)[axis]
        distances = [
            np.linalg.norm(geometry.position[k] - geodetic_to_ecef(displace(truth, sign * step)), axis=1)
            for sign in (1.0, -1.0)
        ]
        slope = (distances[0] - distances[1]) / 20.0
        np.testing.assert_allclose(values[k, :slots, axis][present], slope[present], atol=2e-6)
        np.testing.assert_array_equal(values[k, slots:, axis], values[k, :slots, axis])
    assert (columns[:slots, :3] == [6, 7, 8]).all()
    assert (columns[slots:, :3] == ([6, 7, 8] if observable == "carrier" else [3, 4, 5])).all()
    assert not values[k, np.tile(~present, 2)].any()


def test_code_and_carrier_see_the_ionosphere_with_opposite_signs(scenario):
    dynamics, elevation = scenario.tight_model().dynamics, scenario.family.geometry.elevation
    first = round(scenario.truth.onset * scenario.truth.rate) - 1
    matrix, states, slots = dense_observation(dynamics, 0), slot_states(scenario.slots), scenario.slots
    for s in np.flatnonzero(dynamics.present[0]):
        slant, mapping = obliquity(elevation[first, s]), troposphere_mapping(elevation[first, s])
        code, carrier = matrix[s], matrix[slots + s]
        np.testing.assert_allclose(code[states[s]], [0.0, 1.0, 0.0, slant, 1.0])
        np.testing.assert_allclose(carrier[states[s]], [1.0, 0.0, 1.0, -slant, 1.0])
        np.testing.assert_allclose([code[CLOCK], carrier[CLOCK], code[DRIFT], code[17]], [1.0, 1.0, 0.0, mapping])
        assert np.count_nonzero(code) == 8
        assert np.count_nonzero(carrier) == 9


def test_time_update_is_the_textbooks(scenario):
    dynamics = scenario.tight_model().dynamics
    n = dynamics.num_states
    transition = dense_transition(dynamics, 3)
    covariance, error = some_covariance(n, 0), np.random.default_rng(1).standard_normal(n)
    expected = transition @ covariance @ transition.T + dense_noise(dynamics, 3)
    noise = np.random.default_rng(2).standard_normal(n)
    expected_error = transition @ error + noise
    tight_filter.predict_covariance(
        dynamics.transition[3],
        dynamics.process_noise[3],
        dynamics.decay,
        dynamics.variance,
        dynamics.clock_noise,
        dynamics.interval,
        covariance,
        np.empty((9, n)),
    )
    tight_filter.predict_error(
        dynamics.transition_columns[3], dynamics.decay, dynamics.interval, noise, error, np.empty(9)
    )
    np.testing.assert_allclose(covariance, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_allclose(error, expected_error, rtol=1e-12, atol=1e-12 * np.abs(expected_error).max())


def test_measurement_update_is_josephs(scenario):
    dynamics = scenario.tight_model().dynamics
    n, m = dynamics.num_states, dynamics.dimension
    matrix, noise = dense_observation(dynamics, 3), np.diag(dynamics.noise_variance[3])
    covariance, error = some_covariance(n, 3), np.random.default_rng(4).standard_normal(n)
    residual = np.random.default_rng(5).standard_normal(m)
    inverse = np.linalg.inv(matrix @ covariance @ matrix.T + noise)
    gain = covariance @ matrix.T @ inverse
    left = np.eye(n) - gain @ matrix
    expected = left @ covariance @ left.T + gain @ noise @ gain.T
    whitened_gain, formed = np.empty((m, n)), tight_filter.empty_innovations(1, m)
    formed.residual[0] = residual
    weights, work = Weights(np.ones(1), np.ones((1, m // 2), dtype=bool)), tight_filter.workspace(dynamics.ranges, n)
    tight_filter.form_innovation(0, 3, dynamics.ranges, weights, covariance, whitened_gain, formed, work)
    innovation, response, whitened = formed.covariance[0], formed.response[0], formed.whitened[0]
    corrected = error.copy()
    tight_filter.correct_error(whitened_gain, whitened, corrected)
    tight_filter.update_covariance(whitened_gain, covariance)
    np.testing.assert_allclose(np.linalg.inv(innovation), inverse, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(corrected, error - gain @ residual, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(covariance, expected, rtol=1e-8, atol=1e-9)
    np.testing.assert_array_equal(covariance, covariance.T)
    assert formed.nis[0] == pytest.approx(residual @ inverse @ residual, rel=1e-9)
    np.testing.assert_allclose(response.T @ response, matrix[:, 6:9].T @ inverse @ matrix[:, 6:9], rtol=1e-9)
    np.testing.assert_allclose(response.T @ whitened, matrix[:, 6:9].T @ inverse @ residual, rtol=1e-9, atol=1e-12)


def test_joint_update_is_one_measurement_after_the_other(scenario):
    """Sequential scalar updates give the whitened innovation one by one (Bierman 1977)."""
    dynamics = scenario.tight_model().dynamics
    n, m = dynamics.num_states, dynamics.dimension
    covariance, residual = some_covariance(n, 6), np.random.default_rng(7).standard_normal(m)
    matrix, variance = dense_observation(dynamics, 3), dynamics.noise_variance[3]
    error, before, expected = np.zeros(n), covariance.copy(), np.empty(m)
    for a in range(m):
        cross = before @ matrix[a]
        sigma = np.sqrt(matrix[a] @ cross + variance[a])
        expected[a] = (residual[a] + matrix[a] @ error) / sigma
        error -= cross / sigma * expected[a]
        before -= np.outer(cross, cross) / sigma**2
    cross, innovation, factor, whitened = np.empty((m, n)), np.empty((m, m)), np.empty((m, m)), np.empty(m)
    tight_filter.innovation_covariance(covariance, dynamics.columns, dynamics.values[3], variance, cross, innovation)
    kalman.cholesky(innovation, factor)
    kalman.whiten(factor, residual, whitened)
    np.testing.assert_allclose(whitened, expected, rtol=1e-9, atol=1e-9)


def test_a_new_satellite_starts_from_its_prior(scenario):
    n = num_states(4)
    covariance, started = some_covariance(n, 8), np.array([False, True, False, False])
    before, sigma = covariance.copy(), np.array([100.0, 5.0, 0.02, 4.5, 1.8])
    tight_filter.start_satellites(started, sigma, covariance)
    block = slice(NUM_COMMON + 5, NUM_COMMON + 10)
    np.testing.assert_array_equal(covariance[block, block], np.diag(sigma**2))
    covariance[block], covariance[:, block] = 0.0, 0.0
    before[block], before[:, block] = 0.0, 0.0
    np.testing.assert_array_equal(covariance, before)
