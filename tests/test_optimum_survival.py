"""What one epoch costs a spoofer against the snapshot test."""

import numpy as np
import pytest
from scipy.stats import ncx2

from spoofgym.optimum.survival import log_survival, log_survival_and_slope

THRESHOLD = 25.9


@pytest.mark.parametrize("dimension", [1, 3, 6])
@pytest.mark.parametrize("threshold", [0.5, 7.8, 25.9, 200.0])
def test_survival_of_an_epoch_agrees_with_scipy(dimension, threshold):
    magnitude = np.array([0.0, 0.1, 1.0, 3.0, 5.0, 6.0, 8.0, 10.0])
    square = np.maximum(magnitude**2, 1e-300)
    value, slope = log_survival_and_slope(magnitude, dimension, threshold)
    np.testing.assert_allclose(value, ncx2.logcdf(threshold, dimension, square), rtol=1e-9, atol=1e-13)
    ratio = ncx2.cdf(threshold, dimension + 2, square) / ncx2.cdf(threshold, dimension, square)
    np.testing.assert_allclose(slope, 0.5 * (ratio - 1.0), rtol=1e-9, atol=1e-13)


@pytest.mark.parametrize("dimension", [3, 6])
def test_survival_stays_finite_and_falls_far_in_the_tail(dimension):
    magnitude = np.array([0.0, 1e-200, 10.0, 100.0, 1000.0, 1005.0, 1005.2, 1e5, 1e8])
    value, slope = log_survival_and_slope(magnitude, dimension, THRESHOLD)
    assert np.isfinite(value).all()
    assert np.isfinite(slope).all()
    assert (np.diff(value) <= 0.0).all()


@pytest.mark.parametrize("dimension", [3, 6])
def test_the_tail_expansion_continues_the_mixture(dimension):
    sides = np.sqrt(THRESHOLD) + 1000.0 * np.array([1.0 - 1e-12, 1.0 + 1e-12])
    value, slope = log_survival_and_slope(sides, dimension, THRESHOLD)
    np.testing.assert_allclose(value[0], value[1], rtol=1e-7)
    np.testing.assert_allclose(slope[0], slope[1], rtol=1e-6)


@pytest.mark.parametrize("dimension", [3, 6])
def test_survival_is_log_concave(dimension):
    magnitude = np.linspace(0.0, 12.0, 2001)
    second = np.diff(log_survival(magnitude, dimension, THRESHOLD), n=2)
    assert second.max() < 1e-12
