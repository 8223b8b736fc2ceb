import numpy as np
import pytest
from scipy import stats

from spoofgym.detectors import Whiteness, make_detector

FALSE_FAILURE = 1e-7


def portmanteau(window, lags, n):
    """The statistic of the values (k, m) in a window of n."""
    total = 0.0
    for lag in range(1, lags + 1):
        products = sum((np.outer(window[j], window[j - lag]) for j in range(lag, len(window))), np.zeros((1, 1)))
        total += np.sum(products**2) / (n - lag)
    return total


@pytest.mark.parametrize(("n", "lags", "dimension"), [(9, 3, 3), (5, 4, 6), (12, 1, 3)])
def test_the_squared_correlations_since_the_reset_of_each_run(white, n, lags, dimension):
    whitened = np.random.default_rng(n).standard_normal((50, 4, dimension))
    whitened[20:24, 1] = 0.0  # no fix
    resets = {0: [0, 1, 2, 3], 13: [2], 35: [0, 2]}
    statistic = white.run(Whiteness(n, lags, threshold=1.0), whitened, resets=resets)
    since = white.since(50, 4, resets)
    for k in range(50):
        for i in range(4):
            expected = portmanteau(whitened[max(since[k, i], k - n + 1) : k + 1, i], lags, n)
            assert statistic[k, i] == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(("n", "lags", "dimension"), [(20, 3, 3), (20, 2, 6)])
def test_the_mean_is_the_number_of_correlations_in_any_window(white, n, lags, dimension):
    """Exactly so: 20 000 independent windows and the normal deviate of the false-failure probability."""
    whitened = np.random.default_rng(1).standard_normal((n, 20_000, dimension))
    statistic = white.run(Whiteness(n, lags, threshold=1.0), whitened)[-1]
    error = np.std(statistic) / np.sqrt(20_000)
    assert abs(statistic.mean() - dimension**2 * lags) < stats.norm.isf(FALSE_FAILURE / 2) * error


def test_chi_square_in_long_windows(white):
    """At 1000 epochs, against 2000 windows; short ones have a heavier tail."""
    whitened = np.random.default_rng(2).standard_normal((1000, 2000, 3))
    statistic = white.run(Whiteness(1000, 2, threshold=1.0), whitened)[-1]
    assert stats.kstest(statistic, stats.chi2(18).cdf).pvalue > FALSE_FAILURE
    short = white.run(Whiteness(6, 2, threshold=1.0), np.random.default_rng(3).standard_normal((6, 20_000, 3)))[-1]
    tail = np.count_nonzero(short > stats.chi2.isf(0.001, 18))
    assert tail > stats.binom.isf(FALSE_FAILURE, 20_000, 0.001)


def test_a_bias_and_an_alternation_show_with_the_fourth_power(white):
    """Without noise both give |b|⁴ Σ (n − l)."""
    steady = np.tile([0.6, 0.0, -0.8], (30, 1, 1))
    turning = steady * np.array([1, -1] * 15)[:, None, None]
    pairs = sum(20 - lag for lag in (1, 2, 3))
    for whitened in (steady, turning, -steady):
        assert white.run(Whiteness(20, 3, threshold=1.0), whitened)[-1] == pytest.approx(pairs)
    assert white.run(Whiteness(20, 3, threshold=1.0), 0.5 * steady)[-1] == pytest.approx(pairs / 16.0)


def test_it_sees_colour_that_leaves_every_epoch_alone(white):
    """A first-order process of unit variance, ρ = 0.5: the mean of the lagged products is ρ^l (n − l)."""
    rng = np.random.default_rng(5)
    values = np.empty((160, 500, 3))
    values[0] = rng.standard_normal((500, 3))
    for k in range(1, 160):
        values[k] = 0.5 * values[k - 1] + np.sqrt(0.75) * rng.standard_normal((500, 3))
    detector = make_detector("whiteness:threshold=90")
    assert np.mean(white.run(detector, values)[-1] > 90.0) > 0.5
    clean = rng.standard_normal((60, 500, 3))
    assert np.mean(white.run(detector, clean)[-1] > 90.0) < 0.05


def test_runs_are_independent(white):
    whitened = np.random.default_rng(4).standard_normal((40, 257, 3))
    white.runs_are_independent(lambda: Whiteness(9, 2, threshold=1.0), whitened)


def test_names_and_defaults():
    for text in ("whiteness", "whiteness:n=30,lags=2,arl0=1000", "whiteness:threshold=120"):
        assert make_detector(text).name == text
    detector = make_detector("whiteness")
    assert (detector.n, detector.lags, detector.memory, detector.target_arl0) == (60, 5, 59, 1e5)


@pytest.mark.parametrize(
    ("specification", "message"),
    [
        ("whiteness:1", "n must be a whole number, 2 or more, got 1"),
        ("whiteness:lags=0", "lags must be a whole number, 1 or more, got 0"),
        ("whiteness:n=5,lags=5", "lags must be less than n = 5, got 5"),
        ("whiteness:threshold=1,arl0=10", "at most one of threshold, arl0; got threshold and arl0"),
    ],
)
def test_bad_specifications_are_refused(specification, message):
    with pytest.raises(ValueError, match=message):
        make_detector(specification)
