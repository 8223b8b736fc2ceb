"""Solution separation beside a filter that is run, and a coasting that departs from it."""

import math

import numpy as np
import pytest
from scipy import stats

from spoofgym.detectors.separation_theory import protection_level, separation_threshold

RUNS = 40_000
EPOCHS = 12
DRIFT, NOISE = 0.3, 1.0
"""Variances of the random walk and of the measurements, m²."""


def played(pull, seed):
    """Errors of the filter and of the coasting after the window, (RUNS,), and both variances.

    Args:
        pull: offset of the measurements at each epoch, (EPOCHS,), m.
        seed: of the noise.
    """
    rng = np.random.default_rng(seed)
    variance = coasting_variance = 0.7
    error = coasting = math.sqrt(variance) * rng.standard_normal(RUNS)
    for offset in pull:
        step = math.sqrt(DRIFT) * rng.standard_normal(RUNS)
        prior, coasting_variance = variance + DRIFT, coasting_variance + DRIFT
        gain = prior / (prior + NOISE)
        coasting = coasting - step
        measured = math.sqrt(NOISE) * rng.standard_normal(RUNS) + offset
        error = (1.0 - gain) * (error - step) + gain * measured
        variance = (1.0 - gain) * prior
    return error, coasting, variance, coasting_variance


def test_variance_and_false_alarms():
    """The square sum of 40000 normal numbers, and alarms among as many: each fails by chance once in 1e8."""
    error, coasting, variance, coasting_variance = played(np.zeros(EPOCHS), seed=0)
    sigma = math.sqrt(coasting_variance - variance)
    low, high = stats.chi2.ppf([5e-9, 1.0 - 5e-9], RUNS)
    assert low < np.sum((error - coasting) ** 2) / sigma**2 < high
    alarms = int(np.count_nonzero(np.abs(error - coasting) > separation_threshold(0.02, 1, sigma)))
    assert stats.binomtest(alarms, RUNS, 0.02).pvalue > 1e-8


@pytest.mark.parametrize("last", [0.0, 2.0, 4.0, 6.0, 10.0])
def test_the_protection_level_holds_under_any_pull(last):
    """To the side of the pull: P(error > PL and no alarm) <= P_MD, but for chance once in 1e8."""
    p_md = 0.01
    error, coasting, variance, coasting_variance = played(last * np.linspace(0.0, 1.0, EPOCHS), seed=1)
    threshold = separation_threshold(0.01, 1, math.sqrt(coasting_variance - variance))
    level = protection_level(threshold, p_md, math.sqrt(coasting_variance))
    misled = int(np.count_nonzero((error > level) & (np.abs(error - coasting) <= threshold)))
    assert stats.binomtest(misled, RUNS, p_md, alternative="greater").pvalue > 1e-8


def test_windows_share_the_false_alarms():
    np.testing.assert_allclose(separation_threshold(1e-5, 1, np.array([1.0, 2.0])), [4.41717, 8.83434], rtol=1e-5)
    assert separation_threshold(1e-5, 360, 1.0) == pytest.approx(stats.norm.isf(1e-5 / 720))
    assert protection_level(3.0, 1e-6, 5.0) == pytest.approx(3.0 + 5.0 * stats.norm.isf(1e-6))


def test_bad_values_are_refused():
    with pytest.raises(ValueError, match=r"p_fa must be greater than 0 and less than 1, got 1\.0"):
        separation_threshold(1.0, 1, 1.0)
    with pytest.raises(ValueError, match="num_windows must be a whole number, 1 or more, got 0"):
        separation_threshold(0.1, 0, 1.0)
    with pytest.raises(ValueError, match="p_md must be greater than 0 and less than 1, got 0"):
        protection_level(1.0, 0, 1.0)
