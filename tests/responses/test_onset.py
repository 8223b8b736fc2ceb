"""The estimate of the onset: against a brute-force search, known changes and chi-square."""

import copy
import math

import numpy as np
import pytest
from scipy import stats

from spoofgym.responses.onset import WINDOW, OnsetEstimator


def brute_force(history, window):
    """(n, score) of one run from the innovations it has seen, oldest first."""
    best = (0, 0.0)
    for n in range(1, min(window, len(history)) + 1):
        total = np.add.reduce(np.array(history[-n:]), axis=0)
        score = float(total @ total) / n
        if score > best[1] + 1e-12:
            best = (n, score)
    return best


@pytest.mark.parametrize("window", [1, 7, 50])
def test_it_is_the_maximum_over_the_window(window):
    rng = np.random.default_rng(1)
    estimator = OnsetEstimator(4, window)
    history = [[] for _ in range(4)]
    for k in range(130):
        whitened = rng.standard_normal((4, 3)) + (k > 60) * rng.uniform(0.0, 1.0, (4, 1))
        estimator.push(whitened)
        for run in range(4):
            history[run].append(whitened[run, :2])
        depth, score = estimator.estimate()
        for run in range(4):
            n, value = brute_force(history[run], window)
            assert depth[run] == n
            assert score[run] == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("since", [1, 2, 17, WINDOW])
def test_a_change_without_noise_is_found_exactly(since):
    estimator = OnsetEstimator(1)
    for k in range(200):
        estimator.push(np.array([[1.5, -2.0]]) * (k >= 200 - since))
    depth, score = estimator.estimate()
    assert depth.tolist() == [since]
    assert score == pytest.approx([since * 6.25])


def test_nothing_seen_is_no_onset():
    estimator = OnsetEstimator(2)
    assert [value.tolist() for value in estimator.estimate()] == [[0, 0], [0.0, 0.0]]
    estimator.push(np.ones((2, 2)))
    estimator.reset(np.array([0]))
    assert estimator.estimate()[0].tolist() == [0, 1]


def test_a_window_of_one_scores_as_chi_square_with_two_degrees():
    """Kolmogorov-Smirnov on 20,000 runs; a right estimator fails with probability 1e-7."""
    estimator = OnsetEstimator(20_000, 1)
    rng = np.random.default_rng(2)
    for _ in range(3):
        estimator.push(rng.standard_normal((20_000, 2)))
    assert stats.kstest(estimator.estimate()[1], "chi2", (2,)).pvalue > 1e-7


def test_a_step_of_two_sigma_is_found_within_a_few_epochs():
    """The share of exact hits in 4,000 runs within six standard errors of an independent simulation of the argmax."""

    def hits(seed):
        noise = np.random.default_rng(seed).standard_normal((4000, WINDOW, 2))
        noise[:, -20:, 0] += 2.0
        return noise

    estimator = OnsetEstimator(4000)
    for column in hits(3).swapaxes(0, 1):
        estimator.push(column)
    found = estimator.estimate()[0]
    sums = np.cumsum(hits(4)[:, ::-1], axis=1)
    expected = (sums**2).sum(axis=2) / np.arange(1, WINDOW + 1)
    share = np.mean(expected.argmax(axis=1) + 1 == 20)
    assert 0.4 < share < 0.95
    assert abs(np.mean(found == 20) - share) < 6.0 * math.sqrt(2.0 * share * (1.0 - share) / 4000)
    assert np.mean(np.abs(found - 20) <= 3) > 0.8


def test_runs_see_their_own_innovations():
    rng = np.random.default_rng(5)
    whole, part, alone = OnsetEstimator(6), OnsetEstimator(6), OnsetEstimator(2)
    runs = np.array([4, 1])
    for _ in range(70):
        whitened = rng.standard_normal((6, 2))
        whole.push(whitened)
        part.push(whitened, runs)
        alone.push(whitened[runs])
    for value, other, few in zip(whole.estimate(), part.estimate(), alone.estimate(), strict=True):
        assert np.array_equal(value[runs], other[runs])
        assert np.array_equal(value[runs], few)
        assert not other[[0, 2, 3, 5]].any()
    taken = copy.deepcopy(whole)
    taken.reset(np.arange(6))
    taken.take(runs, alone)
    assert np.array_equal(taken.estimate()[0][runs], whole.estimate()[0][runs])
    taken.push(np.ones((6, 2)))
    whole.push(np.ones((6, 2)))
    assert np.array_equal(taken.estimate()[1][runs], whole.estimate()[1][runs])


def test_a_window_is_one_epoch_or_more():
    with pytest.raises(ValueError, match="window must be a whole number, 1 or more, got 0"):
        OnsetEstimator(1, 0)
