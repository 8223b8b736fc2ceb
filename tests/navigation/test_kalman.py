"""The kernels of the filter against dense NumPy and the Joseph form of pyins."""

import numpy as np
import pytest
from pyins import kalman as oracle
from scipy.linalg import solve_triangular

from spoofgym.navigation import kalman

CASES = [(seed, m) for seed in range(4) for m in (3, 6)]


def positive_definite(rng, size, scale=1.0):
    root = rng.standard_normal((size, size + 3))
    return scale * root @ root.T / size


def problem(seed, m):
    """P, Φ (dense), Q, H (dense), R, z; the biases stay constant and are not measured, as the kernels assume."""
    rng = np.random.default_rng(seed)
    transition = np.eye(15)
    transition[:9] += 0.3 * rng.standard_normal((9, 15))
    observation = np.zeros((m, 15))
    observation[:, :9] = rng.standard_normal((m, 9))
    sizes = 10.0 ** rng.uniform(-3, 2, 15)
    covariance = positive_definite(rng, 15) * np.outer(sizes, sizes)
    return (
        covariance,
        transition,
        positive_definite(rng, 15, 0.1),
        observation,
        positive_definite(rng, m, 2.0),
        rng.standard_normal(m) * 5.0,
    )


def whitened(covariance, observation, noise, residual):
    """S, L, U, w and NIS by the kernels."""
    m = len(residual)
    cross, innovation, factor = np.empty((m, 15)), np.empty((m, m)), np.full((m, m), np.nan)
    gain, white = np.empty((m, 15)), np.empty(m)
    kalman.innovation_covariance(covariance, np.ascontiguousarray(observation[:, :9]), noise, cross, innovation)
    kalman.cholesky(innovation, factor)
    kalman.whitened_gain(cross, factor, gain)
    return innovation, factor, gain, white, kalman.whiten(factor, residual, white)


@pytest.mark.parametrize(("seed", "m"), CASES)
def test_prediction_is_dense_algebra(seed, m):
    covariance, transition, noise, *_ = problem(seed, m)
    expected = transition @ covariance @ transition.T + noise
    got = covariance.copy()
    kalman.predict_covariance(np.ascontiguousarray(transition[:9]), noise, got, np.empty((9, 15)))
    np.testing.assert_allclose(got, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_array_equal(got[:9], got[:, :9].T)
    rng = np.random.default_rng(seed)
    error, disturbance = rng.standard_normal(15), rng.standard_normal(15)
    moved = error.copy()
    kalman.predict_error(np.ascontiguousarray(transition[:9].T), disturbance, moved, np.empty(9))
    np.testing.assert_allclose(moved, transition @ error + disturbance, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize(("seed", "m"), CASES)
def test_innovation_is_whitened_by_the_lower_factor(seed, m):
    covariance, _, _, observation, noise, residual = problem(seed, m)
    innovation, factor, gain, white, nis = whitened(covariance, observation, noise, residual)
    expected = observation @ covariance @ observation.T + noise
    np.testing.assert_allclose(innovation, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_allclose(factor, np.linalg.cholesky(expected), rtol=1e-8, atol=1e-10 * np.abs(factor).max())
    np.testing.assert_array_equal(np.triu(factor, 1), 0.0)
    np.testing.assert_allclose(white, solve_triangular(factor, residual, lower=True), rtol=1e-9)
    assert nis == pytest.approx(residual @ np.linalg.solve(expected, residual), rel=1e-6)
    dense = covariance @ observation.T @ np.linalg.inv(expected)
    np.testing.assert_allclose(gain.T @ np.linalg.inv(factor), dense, rtol=1e-5, atol=1e-8 * np.abs(dense).max())


@pytest.mark.parametrize(("seed", "m"), CASES)
def test_update_is_the_joseph_form(seed, m):
    covariance, _, _, observation, noise, residual = problem(seed, m)
    _, _, gain, white, _ = whitened(covariance, observation, noise, residual)
    state, joseph, standardised = oracle.correct(np.zeros(15), covariance, residual, observation, noise)
    updated = covariance.copy()
    kalman.update_covariance(gain, updated)
    scale = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(updated / np.outer(scale, scale), joseph / np.outer(scale, scale), atol=1e-9)
    corrected = np.zeros(15)
    kalman.correct_error(gain, white, corrected)
    np.testing.assert_allclose(-corrected / scale, state / scale, atol=1e-8)
    np.testing.assert_allclose(white, standardised, rtol=1e-7)


@pytest.mark.parametrize("m", [3, 6])
def test_covariance_stays_symmetric_and_positive_over_many_epochs(m):
    covariance, transition, noise, observation, measured, residual = problem(11, m)
    transition[:9, :9] = 0.9 * np.linalg.qr(transition[:9, :9])[0]
    for _ in range(2000):
        kalman.predict_covariance(np.ascontiguousarray(transition[:9]), 1e-3 * noise, covariance, np.empty((9, 15)))
        gain = whitened(covariance, observation, measured, residual)[2]
        kalman.update_covariance(gain, covariance)
    np.testing.assert_array_equal(covariance, covariance.T)
    assert np.linalg.eigvalsh(covariance).min() > 0.0
