import numpy as np
import pytest
from scipy import integrate, special, stats

from spoofgym.calibration import calibrate
from spoofgym.calibration.clean_statistics import white_statistics
from spoofgym.detectors import FiniteMovingAverage, make_detector
from spoofgym.detectors.moving_average import log_mean_ratio


def log_ratio(dimension, shift, nis):
    values = np.empty(len(nis))
    log_mean_ratio(dimension, shift, nis, values)
    return values


def bessel(dimension, shift, nis):
    """The same by SciPy's scaled Bessel function."""
    order, x = dimension / 2 - 1, shift * np.sqrt(nis)
    return x + np.log(special.ive(order, x)) + special.gammaln(order + 1) + order * np.log(2.0 / x)


@pytest.mark.parametrize("shift", [0.1, 1.0, 4.0])
def test_three_axes_have_the_closed_form(shift):
    nis = np.concatenate([np.geomspace(0.1, 1e6, 3000), [900.0 / shift**2 * (1 - 1e-9), 900.0 / shift**2]])
    x = shift * np.sqrt(nis)
    expected = x + np.log1p(-np.exp(-2.0 * x)) - np.log(2.0 * x)
    np.testing.assert_allclose(log_ratio(3, shift, nis), expected, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("dimension", [2, 3, 6])
def test_any_number_of_axes_agrees_with_scipy(dimension):
    nis = np.concatenate([np.geomspace(0.01, 1e8, 3000), [900.0 * (1 - 1e-9), 900.0, 900.0 * (1 + 1e-9)]])
    np.testing.assert_allclose(log_ratio(dimension, 1.0, nis), bessel(dimension, 1.0, nis), rtol=1e-12, atol=1e-13)


def test_small_arguments_keep_their_digits_and_none_is_nothing():
    """log ₀F₁(m/2; z) = 2 z / m to first order."""
    assert log_ratio(6, 1e-3, np.array([0.0, 1e-4]))[0] == 0.0
    assert log_ratio(6, 1e-3, np.array([1e-4]))[0] == pytest.approx(1e-10 / 12.0, rel=1e-5)
    assert np.isfinite(log_ratio(3, 1.0, np.array([1e300]))).all()


@pytest.mark.parametrize("dimension", [3, 6])
def test_it_is_a_likelihood_ratio(dimension):
    """Its mean is 1 without the shift, and it is the mean of exp(δ u'w − δ²/2) over directions u."""

    def weighted(nis):
        ratio = np.exp(log_ratio(dimension, 1.5, np.array([nis]))[0] - 1.5**2 / 2)
        return ratio * stats.chi2.pdf(nis, dimension)

    assert integrate.quad(weighted, 0.0, 200.0)[0] == pytest.approx(1.0, rel=1e-7)
    # the share of u along w: density ∝ (1 − t²)^((m − 3) / 2)
    density = integrate.quad(lambda t: (1 - t * t) ** ((dimension - 3) / 2), -1, 1)[0]
    mean = integrate.quad(lambda t: np.exp(1.5 * 2.0 * t) * (1 - t * t) ** ((dimension - 3) / 2), -1, 1)[0] / density
    assert np.exp(log_ratio(dimension, 1.5, np.array([4.0]))[0]) == pytest.approx(mean, rel=1e-9)


def test_the_sum_over_the_window_since_the_reset_of_each_run(white):
    whitened = 2.0 * np.random.default_rng(1).standard_normal((60, 4, 3))
    whitened[20:24, 1] = 0.0  # no fix
    resets = {0: [0, 1, 2, 3], 13: [2], 40: [0, 2]}
    statistic = white.run(FiniteMovingAverage(7, 2.0, threshold=1.0), whitened, resets=resets)
    x = 2.0 * np.linalg.norm(whitened, axis=2)
    terms = np.log(np.divide(np.sinh(x), x, out=np.ones_like(x), where=x > 0.0))
    since = white.since(60, 4, resets)
    for k in range(60):
        expected = [terms[max(since[k, i], k - 6) : k + 1, i].sum() for i in range(4)]
        np.testing.assert_allclose(statistic[k], expected, rtol=1e-10, atol=1e-12)


def test_a_window_of_one_is_the_snapshot_test():
    """The statistic grows with nis, and epochs are independent; 4000 first alarms, 6 deviations: 2e-9."""
    detector = FiniteMovingAverage(1, 2.0)
    found = calibrate(detector, white_statistics(np.eye(3), 200), 200.0, first_alarms=4000, seed=1)
    nis = np.linspace(5.0, 25.0, 20_001)
    p_fa = stats.chi2.sf(np.interp(found.threshold, bessel(3, 2.0, nis), nis), 3)
    assert abs(np.log(p_fa * 200.0)) < 6.0 / np.sqrt(found.first_alarms)


def test_an_outlier_counts_for_less_than_in_the_sum_of_squares(white):
    """Nine deviations once, or three in nine epochs: equal sums of squares."""
    once, often = np.zeros((9, 1, 3)), np.zeros((9, 1, 3))
    once[-1, 0, 0], often[:, 0, 0] = 9.0, 3.0
    make = FiniteMovingAverage(9, threshold=1.0)
    assert white.run(make, often)[-1] > 1.6 * white.run(make, once)[-1]
    # and a small shift makes it the windowed test: δ² Σ nis / (2 m)
    gentle = FiniteMovingAverage(9, 1e-3, threshold=1.0)
    for whitened in (once, often):
        assert white.run(gentle, whitened)[-1] == pytest.approx(1e-6 * 81.0 / 6.0, rel=1e-4)


def test_runs_are_independent(white):
    whitened = np.random.default_rng(4).standard_normal((40, 257, 3))
    white.runs_are_independent(lambda: FiniteMovingAverage(9, threshold=1.0), whitened)


def test_names_and_defaults():
    for text in ("fma", "fma:n=60,shift=2,arl0=1000", "fma:threshold=12"):
        assert make_detector(text).name == text
    detector = make_detector("fma")
    assert (detector.n, detector.shift, detector.memory, detector.target_arl0) == (20, 1.0, 19, 1e5)


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("fma:0", "n must be a whole number, 1 or more, got 0"),
        ("fma:shift=0", "shift must be a finite number greater than 0, got 0"),
        ("fma:threshold=1,arl0=10", "at most one of threshold, arl0; got threshold and arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
