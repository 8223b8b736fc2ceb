"""Theory of the cumulative monitors, beside scipy's distributions and a filter that is run."""

import math

import numpy as np
import pytest
from scipy import stats

from spoofgym.detectors.cpi_theory import (
    ci_threshold,
    cpi_threshold,
    gauss_markov_covariance,
    kappa,
    minimum_epochs,
    minimum_epochs_white,
    missed_detection,
    missed_detection_coloured,
    missed_detection_white,
    spoofed_variances,
)

UNLIKELY = 1e-8
"""Chance that a test with a sample fails, at most."""
DESIGN = np.array([1.0, 0.6])
NOISE = np.array([[0.04, 0.01], [0.01, 0.09]])
DRIFT = 0.02
"""Variance of the random walk between two epochs, m²."""
EPOCHS = 24


def run_filter(walk, noise, tracking):
    """Innovations of a steady Kalman filter of a walking position that is seen by two spoofed measurements.

    Args:
        walk: steps of the truth, (runs, N).
        noise: of the measurements, (runs, N, 2).
        tracking: the spoofer's error, (runs, N), m.

    Returns:
        γ, (runs, N, 2), and its covariance S.
    """
    information = DESIGN @ np.linalg.inv(NOISE) @ DESIGN
    prior = 0.5 * (DRIFT + math.sqrt(DRIFT**2 + 4.0 * DRIFT / information))
    covariance = prior * np.outer(DESIGN, DESIGN) + NOISE
    gain = prior * np.linalg.solve(covariance, DESIGN)
    innovations = np.empty(noise.shape)
    truth = estimate = np.zeros(len(walk))
    for k in range(walk.shape[1]):
        truth = truth + walk[:, k]
        measured = np.outer(truth + tracking[:, k], DESIGN) + noise[:, k]
        innovations[:, k] = measured - np.outer(estimate, DESIGN)
        estimate = estimate + innovations[:, k] @ gain
    return innovations, covariance, prior


def simulated(runs, tracking, seed):
    rng = np.random.default_rng(seed)
    prior = run_filter(np.zeros((1, 1)), np.zeros((1, 1, 2)), np.zeros((1, 1)))[2]
    walk = math.sqrt(DRIFT) * rng.standard_normal((runs, EPOCHS))
    walk[:, 0] = math.sqrt(prior) * rng.standard_normal(runs)
    noise = rng.standard_normal((runs, EPOCHS, 2)) @ np.linalg.cholesky(NOISE).T
    errors = rng.standard_normal((runs, EPOCHS)) @ np.linalg.cholesky(tracking).T
    return run_filter(walk, noise, errors)[:2]


def projected(innovations, covariance):
    """s_k / σ_s, (runs, N)."""
    weight = np.linalg.solve(covariance, DESIGN)
    return innovations @ weight / math.sqrt(DESIGN @ weight)


def whitened(innovations, covariance):
    """(runs, 2 N)."""
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    return (innovations @ root.T).reshape(len(innovations), -1)


def responses():
    """G of the CPI (N, N) and of the CI (2 N, N): what a metre of tracking error at one epoch does."""
    unit = np.eye(EPOCHS)
    innovations, covariance, _ = run_filter(np.zeros((EPOCHS, EPOCHS)), np.zeros((EPOCHS, EPOCHS, 2)), unit)
    return projected(innovations, covariance).T, whitened(innovations, covariance).T


def test_thresholds_are_quantiles():
    for n in (1, 20, 360):
        assert cpi_threshold(1e-5, n) == pytest.approx(stats.gamma.isf(1e-5, n / 2, scale=2))
        assert ci_threshold(1e-5, n, 16) == pytest.approx(stats.chi2.isf(1e-5, 16 * n))


def test_epochs_needed_for_white_tracking_error():
    """Computed apart from this code, for P_FA 1e-5 and P_MD 1e-7."""
    found = [minimum_epochs_white(1e-5, 1e-7, value) for value in (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)]
    assert found == [19786, 2629, 385, 101, 37, 20]
    for n, value in zip(found, (0.1, 0.3, 1.0, 3.0, 10.0, 30.0), strict=True):
        for window, enough in ((n, True), (n - 1, False)):
            missed = stats.gamma.cdf(stats.gamma.isf(1e-5, window / 2), window / 2, scale=1 + value)
            assert (missed <= 1e-7) == enough


@pytest.mark.parametrize(("sigma", "n"), [(0.02, 60), (0.05, 120), (0.1, 360)])
def test_white_noise_is_the_simplest_colour(sigma, n):
    information = 1.0 / 0.026**2
    white = missed_detection_white(1e-5, n, kappa(sigma, information))
    tracking = gauss_markov_covariance(n, sigma, 0.0, 0.5)
    assert missed_detection_coloured(1e-5, information, tracking) == pytest.approx(white, rel=1e-8)
    assert missed_detection_coloured(1e-5, np.full(n, information), tracking) == pytest.approx(white, rel=1e-8)
    fast = gauss_markov_covariance(n, sigma, 0.01, 0.5)
    assert missed_detection_coloured(1e-5, information, fast) == pytest.approx(white, rel=1e-8)


def test_covariance_of_a_gauss_markov_process():
    """It is that of x_k = a x_(k-1) + n_k: its inverse is tridiagonal, and R_ij = a R_(i-1)j above the diagonal."""
    tracking = gauss_markov_covariance(6, 0.1, 40.0, 0.5)
    decay = math.exp(-0.5 / 40.0)
    np.testing.assert_allclose(np.diag(tracking), 0.01)
    for i in range(1, 6):
        np.testing.assert_allclose(tracking[i, :i], decay * tracking[i - 1, :i])
    inverse = np.linalg.inv(tracking)
    np.testing.assert_allclose(inverse[np.abs(np.subtract.outer(range(6), range(6))) > 1], 0.0, atol=1e-9)


@pytest.mark.parametrize(("sigma", "time"), [(0.25, 0.0), (0.6, 3.0)])
def test_missed_detection_of_a_filter_that_is_run(sigma, time):
    """The feedback included; 40000 runs."""
    tracking = gauss_markov_covariance(EPOCHS, sigma, time, 0.5)
    innovations, covariance = simulated(40_000, tracking, seed=1)
    for response, numbers in zip(responses(), (projected, whitened), strict=True):
        p_missed = missed_detection(1e-3, response, tracking)
        assert 0.05 < p_missed < 0.95
        statistic = np.sum(numbers(innovations, covariance) ** 2, axis=1)
        missed = int(np.count_nonzero(statistic <= cpi_threshold(1e-3, len(response))))
        assert stats.binomtest(missed, 40_000, p_missed).pvalue > UNLIKELY


def test_without_spoofing_all_but_the_false_alarms_are_missed():
    for response in responses():
        assert missed_detection(1e-3, response, np.zeros((EPOCHS, EPOCHS))) == pytest.approx(0.999, rel=1e-9)


def test_variances_through_the_triangle_are_those_of_the_whole_covariance():
    tracking = gauss_markov_covariance(EPOCHS, 0.3, 5.0, 0.5)
    response = responses()[1]
    whole = np.linalg.eigvalsh(np.eye(2 * EPOCHS) + response @ tracking @ response.T)
    np.testing.assert_allclose(spoofed_variances(response, tracking), whole, rtol=1e-9)


def test_a_filter_that_follows_makes_white_error_plainer_and_slow_error_fainter():
    """An innovation that sees the first difference of the tracking error: 2 σ² if white, little if slow."""
    n, information = 120, 1.0 / 0.026**2
    difference = math.sqrt(information) * (np.eye(n) - np.eye(n, k=-1))
    white, slow = gauss_markov_covariance(n, 0.02, 0.0, 0.5), gauss_markov_covariance(n, 0.1, 40.0, 0.5)
    assert missed_detection(1e-5, difference, white) < 0.1 * missed_detection_coloured(1e-5, information, white)
    assert missed_detection(1e-5, difference, slow) > 1000.0 * missed_detection_coloured(1e-5, information, slow)


def test_the_shortest_window_is_the_first_that_suffices():
    missed = {1: 0.5, 2: 0.2, 3: 0.05, 4: 0.3, 5: 0.01}
    assert minimum_epochs(0.1, missed.__getitem__, 5) == 3
    assert minimum_epochs(0.001, missed.__getitem__, 5) is None
    tracking = gauss_markov_covariance(120, 0.05, 0.0, 0.5)
    scanned = minimum_epochs(1e-7, lambda n: missed_detection_coloured(1e-5, 1600.0, tracking[:n, :n]), 120)
    assert scanned == minimum_epochs_white(1e-5, 1e-7, float(kappa(0.05, 1600.0)))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: cpi_threshold(0.0, 5), "p_fa must be greater than 0 and less than 1, got 0.0"),
        (lambda: cpi_threshold(0.1, 0), "num_epochs must be a whole number, 1 or more, got 0"),
        (lambda: ci_threshold(0.1, 5, 0), "num_measurements must be a whole number, 1 or more, got 0"),
        (lambda: gauss_markov_covariance(5, -1.0, 1.0, 0.5), "sigma must be a finite number, 0 or more, got -1.0"),
        (lambda: gauss_markov_covariance(5, 1.0, -1.0, 0.5), "time must be a finite number, 0 or more, got -1.0"),
        (lambda: gauss_markov_covariance(5, 1.0, 1.0, 0.0), "interval must be a finite number greater than 0"),
        (lambda: minimum_epochs_white(1e-5, 1e-7, 0.0), "kappa must be a finite number greater than 0, got 0.0"),
        (lambda: minimum_epochs(0.0, lambda n: 1.0, 5), "required must be greater than 0"),
        (lambda: missed_detection(0.1, np.eye(3), np.eye(4)), r"got \(3, 3\) and \(4, 4\)"),
    ],
)
def test_bad_values_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
