"""Tracking errors: white or Gauss-Markov, stationary."""

import numpy as np
from scipy import stats

from spoofgym.sensors.tracking import draw_tracking_error


def test_white_errors_are_the_normals_themselves():
    drawn = draw_tracking_error(np.random.default_rng(3), (50, 6), 0.7, 0.0, 1.0)
    np.testing.assert_array_equal(drawn, 0.7 * np.random.default_rng(3).standard_normal((50, 6)))


def test_correlated_errors_follow_the_recursion():
    sigma, time, interval = 0.7, 5.0, 0.5
    drawn = draw_tracking_error(np.random.default_rng(3), (50, 3), sigma, time, interval)
    normal, decay = np.random.default_rng(3).standard_normal((50, 3)), np.exp(-interval / time)
    expected = [sigma * normal[0]]
    for k in range(1, 50):
        expected.append(decay * expected[-1] + sigma * np.sqrt(1.0 - decay**2) * normal[k])
    np.testing.assert_allclose(drawn, expected, rtol=1e-12)


def test_correlated_errors_are_stationary():
    """20,000 independent sequences; false-failure probability 1e-8 per figure."""
    number, sigma, time = 20_000, 2.0, 10.0
    drawn = draw_tracking_error(np.random.default_rng(0), (41, number), sigma, time, 1.0)
    low, high = sigma**2 * stats.chi2.ppf([5e-9, 1 - 5e-9], number) / number
    for epoch in (0, 1, 20, 40):
        assert low < np.mean(drawn[epoch] ** 2) < high
    for lag in (1, 10):
        # the mean of products of correlated normals has the variance σ⁴ (1 + ρ²) / n
        rho = np.exp(-lag / time)
        spread = stats.norm.isf(5e-9) * sigma**2 * np.sqrt((1.0 + rho**2) / number)
        assert abs(np.mean(drawn[20] * drawn[20 + lag]) - sigma**2 * rho) < spread


def test_correlation_fades_over_missing_epochs():
    """Each interval has its own decay: over 30 s with a correlation time of 5 s hardly anything is left."""
    sigma, time, intervals = 0.7, 5.0, np.array([1.0, 1.0, 30.0, 0.5])
    drawn = draw_tracking_error(np.random.default_rng(3), (5, 3), sigma, time, intervals)
    normal = np.random.default_rng(3).standard_normal((5, 3))
    expected = [sigma * normal[0]]
    for k, decay in enumerate(np.exp(-intervals / time), 1):
        expected.append(decay * expected[-1] + sigma * np.sqrt(1.0 - decay**2) * normal[k])
    np.testing.assert_allclose(drawn, expected, rtol=1e-12)
