import itertools
import math

import numpy as np
import pytest
from scipy import integrate, special, stats
from scipy.linalg import toeplitz

from spoofgym.detectors.quadratic_form import cdf, imhof, log_cdf, log_sf

TAILS = [1e-200, 1e-100, 1e-40, 1e-12, 1e-7, 1e-3, 0.1, 0.3, 0.45, 0.5, 0.55]
SPREADS = [
    [5.0, 4.0, 3.0, 2.0, 1.0, 0.5] * 2,
    [1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1],
    [20.0] + [1.0] * 30,
    [8.0, 8.0, 8.0] + [0.5] * 12,
    np.geomspace(0.01, 10.0, 25),
]
COLOURED = [
    1.0 + kappa * np.linalg.eigvalsh(toeplitz(np.exp(-np.arange(n) * 0.5 / time)))
    for kappa, time, n in itertools.product((0.3, 3.0, 16.0), (10.0, 40.0), (20, 120))
]


def sf(x, weights):
    return np.exp(log_sf(x, weights))


def original_imhof(x, weights):
    """P(Q > x) as Imhof (1961, eq 3.2) has it, good to about 1e-12 absolutely."""
    weights = np.asarray(weights)

    def integrand(u):
        angle = 0.5 * np.sum(np.arctan(weights * u)) - 0.5 * x * u
        return math.sin(angle) / (u * np.prod((1.0 + (weights * u) ** 2) ** 0.25))

    return 0.5 + integrate.quad(integrand, 0.0, np.inf, epsabs=1e-12, epsrel=1e-12, limit=2000)[0] / math.pi


def grid(weights, points=25):
    """From deep in the lower tail to deep in the upper one."""
    mean, deviation = np.sum(weights), math.sqrt(2.0 * np.sum(np.square(weights)))
    return np.concatenate([mean * np.geomspace(1e-4, 1.0, points), mean + deviation * np.geomspace(1e-3, 20.0, points)])


@pytest.mark.parametrize("n", [1, 2, 3, 5, 10, 100, 2000])
def test_equal_weights_are_chi_square(n):
    exact = stats.chi2(n, scale=2.5)
    weights = np.full(n, 2.5)
    for tail in TAILS:
        low, high = exact.ppf(tail), exact.isf(tail)
        # the error of the approximation falls with n²; close to the mean it is interpolated
        rough = 0.04 / n**2 + 3e-7
        if low > 1e-280:
            np.testing.assert_allclose(cdf(low, weights), exact.cdf(low), rtol=rough)
            np.testing.assert_allclose(imhof(low, weights)[0], exact.cdf(low), rtol=1e-9)
        np.testing.assert_allclose(sf(high, weights), exact.sf(high), rtol=rough)
        np.testing.assert_allclose(imhof(high, weights)[1], exact.sf(high), rtol=1e-9)


@pytest.mark.parametrize("rates", [[1.0, 3.0], [1.0, 2.0, 4.0, 8.0], [0.1, 1.0, 5.0]])
def test_pairs_of_weights_are_a_sum_of_exponentials(rates):
    """Two squares of weight λ are exponential of mean 2 λ: P(Q > x) = Σ_i e^(-x r_i) Π_j r_j / (r_j - r_i)."""
    rates = np.array(rates)
    factor = [np.prod([other / (other - rate) for other in rates if other != rate]) for rate in rates]
    weights = np.repeat(0.5 / rates, 2)
    for x in grid(weights):
        expected = np.sum(factor * np.exp(-x * rates))
        np.testing.assert_allclose(imhof(x, weights)[1], expected, rtol=1e-9)
        np.testing.assert_allclose(sf(x, weights), expected, rtol=0.05)


@pytest.mark.parametrize("weights", SPREADS)
def test_the_original_integral(weights):
    weights = np.asarray(weights)
    compared = 0
    for x in grid(weights, 8):
        lower, upper = imhof(x, weights)
        if min(lower, upper) < 1e-10:
            continue
        compared += 1
        assert upper == pytest.approx(original_imhof(x, weights), abs=1e-11)
        assert lower + upper == pytest.approx(1.0, abs=1e-15)
    assert compared > 8


@pytest.mark.parametrize("weights", [*SPREADS, *COLOURED])
def test_the_approximation_against_the_integral(weights):
    """Some per cent where one weight outweighs the rest, in every tail down to 1e-300."""
    weights = np.asarray(weights)
    outweighs = np.sum(weights**2) < 10.0 * np.max(weights) ** 2
    for x in grid(weights):
        for approximate, exact in zip((cdf(x, weights), sf(x, weights)), imhof(x, weights), strict=True):
            if 1e-300 < exact < 0.5:
                assert abs(approximate / exact - 1.0) < (0.08 if outweighs else 0.01)


def test_many_weights_of_like_size_are_good_to_a_thousandth():
    """Far out in the upper tail the greatest weight is alone."""
    weights = np.linspace(1.0, 3.0, 60)
    for x in grid(weights):
        lower, upper = imhof(x, weights)
        if 1e-300 < lower < 0.5:
            assert cdf(x, weights) == pytest.approx(lower, rel=1e-4)
        elif upper > 1e-12:
            assert sf(x, weights) == pytest.approx(upper, rel=1e-3)


def test_logarithms_where_the_probability_underflows():
    """P(Q <= x) -> (x/2)^(m/2) / (Γ(m/2 + 1) Π √λ) for small x, and chi-square with 2 degrees is exponential."""
    weights = np.linspace(1.0, 3.0, 200)
    for x in (1e-4, 1e-30, 1e-200):
        expected = 100.0 * math.log(0.5 * x) - special.gammaln(101.0) - 0.5 * np.sum(np.log(weights))
        assert expected < -1000.0
        assert log_cdf(x, weights) == pytest.approx(expected, abs=1e-3)
        assert cdf(x, weights) == 0.0
    pair = np.ones(2)
    np.testing.assert_allclose(log_sf(1e4, pair), -5000.0, atol=0.01)
    assert log_sf(1e-4, pair) == pytest.approx(-5e-5, rel=0.01)


@pytest.mark.parametrize("weights", [[1.0], [1.0, 1e-3], *SPREADS, *COLOURED[::3]])
def test_monotone_across_the_interpolated_middle(weights):
    weights = np.asarray(weights)
    deviation = math.sqrt(2.0 * np.sum(weights**2))
    about_mean = np.sum(weights) + deviation * np.linspace(-0.2, 0.2, 801)
    for x in (about_mean, np.sort(grid(weights, 200))):
        lower, upper = log_cdf(x, weights), log_sf(x, weights)
        assert np.all(np.diff(lower) >= 0.0)
        assert np.all(np.diff(upper) <= 0.0)
        np.testing.assert_allclose(np.exp(lower) + np.exp(upper), 1.0, rtol=1e-14)
        some = slice(None, None, 20)
        np.testing.assert_allclose(cdf(x[some], weights), np.exp(lower[some]), rtol=1e-9)
        np.testing.assert_allclose(sf(x[some], weights), np.exp(upper[some]), rtol=1e-9)


def test_rows_and_zeros_and_units():
    x = np.array([[1.0], [7.0], [30.0]])
    rows = np.array([[3.0, 2.0, 1.0, 0.0], [1.0, 1.0, 0.0, 0.0]])
    both = log_cdf(x, rows)
    assert both.shape == (3, 2)
    for i, row in itertools.product(range(3), range(2)):
        assert both[i, row] == pytest.approx(float(log_cdf(float(x[i, 0]), rows[row, : 3 - row])), rel=1e-12)
    assert imhof(7.0, rows[0]) == pytest.approx(imhof(7.0, rows[0, :3]), rel=1e-12)
    np.testing.assert_array_equal(log_cdf(8.0 * x, 8.0 * rows), both)


def test_the_ends():
    weights = np.array([2.0, 1.0])
    np.testing.assert_array_equal(cdf(np.array([-1.0, 0.0, np.inf]), weights), [0.0, 0.0, 1.0])
    np.testing.assert_array_equal(sf(np.array([-1.0, 0.0, np.inf]), weights), [1.0, 1.0, 0.0])
    assert imhof(0.0, weights) == (0.0, 1.0)
    assert imhof(np.inf, weights) == (1.0, 0.0)


@pytest.mark.parametrize(
    ("x", "weights", "message"),
    [
        (1.0, [1.0, -0.5], "weights must be finite numbers, 0 or more"),
        (1.0, [1.0, np.inf], "weights must be finite numbers, 0 or more"),
        (1.0, 2.0, "weights must be finite numbers, 0 or more, along an axis, got array"),
        (1.0, [0.0, 0.0], "one weight at least must be greater than 0"),
        (1.0, [], "one weight at least must be greater than 0"),
        (np.nan, [1.0], "x must be a number, got array"),
    ],
)
def test_bad_values_are_refused(x, weights, message):
    for function in (cdf, sf, log_cdf, log_sf):
        with pytest.raises(ValueError, match=message):
            function(x, np.array(weights))


def test_the_integral_takes_one_value():
    with pytest.raises(ValueError, match=r"x must be one number, weights \(m,\); got shapes \(2,\) and \(3,\)"):
        imhof(np.ones(2), np.ones(3))
