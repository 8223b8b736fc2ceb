"""Kujur 2024: games against the exact values, and how these differ from the paper's formula.

False-failure probabilities of the random tests are below 1e-7 each.
"""

from itertools import pairwise

import numpy as np
import pytest
from scipy import stats

from spoofgym.detectors import cpi_theory
from spoofgym.studies.reproduce.kujur_games import INTERVAL, NAVIGATION, Replica, correlation_time, flight, play
from spoofgym.studies.reproduce.kujur_windows import P_FA, coasting, cumulative_exact, windows

FALSE_FAILURE = 1e-8
K = 120
RUNS = 1000
WHITE, FAST, SLOW = Replica(0.02), Replica(0.1, 10.0), Replica(0.1, 40.0)


@pytest.fixture(scope="module")
def scenario():
    return flight(horizon=K)


@pytest.fixture(scope="module")
def exact():
    return windows(NAVIGATION, None, K)


@pytest.fixture(scope="module")
def clean(scenario):
    return play(scenario, Replica(0.0), RUNS, 50)


def test_clean_games_have_the_distributions_of_both_monitors(clean, scenario):
    assert stats.kstest(clean.cpi[:, -1], stats.chi2(K).cdf).pvalue > FALSE_FAILURE
    assert stats.kstest(clean.ci[:, -1], stats.chi2(2 * scenario.slots * K).cdf).pvalue > FALSE_FAILURE


def test_n_degrees_for_the_cumulative_innovation_alarm_always(clean):
    """Its mean is sixteen times N."""
    assert (clean.ci[:, -1] > cpi_theory.cpi_threshold(P_FA, K)).all()


def test_the_separation_has_the_variance_of_equation_50(clean, scenario):
    """Filter minus a solution that has coasted since before epoch 0: K + 1 corrections ago."""
    variance = coasting(scenario).separation[K] ** 2
    low, high = stats.chi2.ppf([FALSE_FAILURE / 2, 1.0 - FALSE_FAILURE / 2], RUNS) / RUNS
    assert low < np.mean(clean.separation**2) / variance < high


@pytest.mark.parametrize("replica", [WHITE, FAST, SLOW], ids=lambda replica: replica.words)
def test_games_miss_as_often_as_the_exact_value_says(replica, scenario, exact):
    """And not as often as the formula does."""
    game = play(scenario, replica, RUNS, 4000)
    for n in (20, 60, K):
        missed = int((game.cpi[:, n - 1] <= cpi_theory.cpi_threshold(P_FA, n)).sum())
        assert stats.binomtest(missed, RUNS, exact.exact(replica, n)).pvalue > FALSE_FAILURE
    # 60 s: 0.54 against 0.97, 0.24 against 4e-6, 0.97 against 0.005
    assert stats.binomtest(missed, RUNS, exact.formula(replica, K)).pvalue < FALSE_FAILURE


def test_the_cumulative_innovation_misses_as_often_as_its_exact_value_says(scenario):
    """At a tracking error that it sees in some games."""
    replica = Replica(0.04)
    game, expected = play(scenario, replica, 600, 9000), cumulative_exact(scenario, replica, K)
    assert 0.05 < expected < 0.95
    threshold = cpi_theory.ci_threshold(P_FA, K, 2 * scenario.slots)
    missed = int((game.ci[:, -1] <= threshold).sum())
    assert stats.binomtest(missed, 600, expected).pvalue > FALSE_FAILURE


def test_the_formula_is_a_gamma_distribution(exact):
    """Equation 38 with scipy's distributions."""
    ratio = 1.0 + WHITE.sigma**2 * exact.information[:60].mean()
    expected = stats.gamma.cdf(stats.gamma.isf(P_FA, 30.0, scale=2.0), 30.0, scale=2.0 * ratio)
    assert exact.formula(WHITE, 60) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("n", [20, 60, K])
def test_white_error_is_seen_sooner_and_coloured_error_far_later_than_the_formula_says(n, exact):
    for sigma in (0.02, 0.05, 0.1):
        assert exact.exact(Replica(sigma), n) < exact.formula(Replica(sigma), n)
        for time in (10.0, 40.0):
            assert exact.exact(Replica(sigma, time), n) > exact.formula(Replica(sigma, time), n)
    # of the smaller errors both miss nearly all
    for time in (10.0, 40.0):
        assert exact.exact(Replica(0.1, time), n) > 2.0 * exact.formula(Replica(0.1, time), n)


def test_ten_centimetres_with_forty_seconds_are_not_negligible_within_a_minute(exact):
    assert exact.exact(SLOW, K) > 0.9
    assert exact.formula(SLOW, K) < 0.01


def test_the_shortest_window_is_the_first_that_suffices(exact):
    replica = Replica(0.1)
    n = exact.shortest(replica, exact.exact)
    assert exact.exact(replica, n) <= 1e-7 < exact.exact(replica, n - 1)
    assert exact.shortest(SLOW, exact.exact) is None


def test_the_protection_level_grows_with_the_window(scenario):
    coasted = coasting(scenario)
    levels = [coasted.level(n) for n in (1, 10, 60, K)]
    assert all(before < after for before, after in pairwise(levels))
    expected = stats.norm.isf(1e-5 / 120.0) * coasted.separation[59] + stats.norm.isf(1e-6) * coasted.sigma[59]
    assert levels[2] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("kind", "first"), [("white", 0.0), ("difference", -0.5), ("mean", 0.5)])
def test_the_time_constant_of_an_autocorrelation(kind, first):
    """Of noise, its differences and its means of two: (1 - 1/e) / (1 - rho_1) of an interval, or one and a part."""
    noise = np.random.default_rng(3).standard_normal((2, 40_001, 4))
    series = {"white": noise, "difference": np.diff(noise, axis=1), "mean": noise[:, 1:] + noise[:, :-1]}[kind]
    level = np.exp(-1.0)
    expected = (1.0 - level) / (1.0 - first) if first < level else 1.0 + (first - level) / first
    # the autocorrelation at a lag is 1 / √(4 K) = 0.0025 off: eight deviations, through a slope of 2 at most
    np.testing.assert_allclose(correlation_time(series, INTERVAL), INTERVAL * expected, atol=INTERVAL * 0.04)
