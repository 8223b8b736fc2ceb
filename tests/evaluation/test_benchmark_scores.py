"""The summary of a benchmark: the interquartile mean against SciPy, the bootstrap against closed forms and coverage."""

import numpy as np
import pytest
from scipy import stats

from spoofgym.evaluation.benchmark import ATTACK, BenchmarkTask, Match
from spoofgym.evaluation.benchmark_scores import Interval, Scores, interquartile_mean

SHARE_OF_SIGMA = 0.4
"""An end of an interval of 2,000 resamples misses its closed form by 0.06 standard deviations, one sigma (the density
of the normal at 1.96 is 0.058): 0.4 is more than six of them, so that a test fails by chance in less than 1 of 1e6."""


def task(number: int, matches: int = 1, zero: float = 0.0, one: float = 1.0) -> BenchmarkTask:
    played = tuple(Match(f"opponent-{n}", 10, n) for n in range(matches))
    return BenchmarkTask(f"here/error/{number}", ATTACK, "here", "error", "duel", 0.0, played, zero, one, "somebody")


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 8, 11, 22, 40])
def test_interquartile_mean_is_scipys(count: int) -> None:
    scores = np.random.default_rng(count).normal(size=(6, count))
    np.testing.assert_allclose(interquartile_mean(scores), stats.trim_mean(scores, 0.25, axis=1), rtol=1e-12)
    assert interquartile_mean(scores[0]) == pytest.approx(stats.trim_mean(scores[0], 0.25), rel=1e-12)


def test_one_task_has_the_interval_of_a_mean() -> None:
    worth = np.random.default_rng(3).exponential(2.0, (1, 500))
    found = Scores([task(0, zero=1.0, one=3.0)], [[worth]], 2000)
    sigma = worth.std() / np.sqrt(500)
    raw = found.score(0)
    assert raw.value == pytest.approx(worth.mean(), rel=1e-12)
    np.testing.assert_allclose([raw.low, raw.high], raw.value + 1.96 * sigma * np.array([-1, 1]),
                               atol=SHARE_OF_SIGMA * sigma)
    line = found.normalised(0)
    np.testing.assert_allclose([line.value, line.low, line.high], (np.array([raw.value, raw.low, raw.high]) - 1) / 2)
    assert found.interquartile_mean() == line


def test_games_are_drawn_for_each_match_by_itself() -> None:
    """Of four tasks of like games the mean has half the standard deviation of one."""
    worth = np.random.default_rng(4).normal(size=(1, 400))
    found = Scores([task(n) for n in range(4)], [[worth]] * 4, 2000).mean()
    assert found is not None
    half = 1.96 * worth.std() / np.sqrt(400) / 2.0
    assert 0.5 * (found.high - found.low) == pytest.approx(half, abs=SHARE_OF_SIGMA * half / 1.96)


def test_training_seeds_are_drawn_for_all_tasks_together() -> None:
    """One policy is worth 0 in every task and another 1: a resample holds either alone in half of the cases."""
    worth = np.stack([np.zeros(10), np.ones(10)])
    found = Scores([task(n) for n in range(20)], [[worth]] * 20, 1000)
    assert found.policies == 2
    assert found.mean() == Interval(0.5, 0.0, 1.0)
    # policies by tasks are 40 scores, half of them 0
    assert found.interquartile_mean() == Interval(0.5, 0.0, 1.0)


def test_the_worst_match_of_each_resample_counts() -> None:
    matches = [np.full((1, 10), level) for level in (1.0, 3.0, 2.0)]
    found = Scores([task(0, matches=3)], [matches], 50)
    assert found.score(0) == Interval(3.0, 3.0, 3.0)
    np.testing.assert_array_equal(found.of_matches(0), [[1.0, 3.0, 2.0]])
    assert found.interquartile_mean(lambda task: task.place == "elsewhere") is None


def test_the_interval_of_the_summary_covers_the_truth() -> None:
    """Twelve tasks of known means, 60 games each, 200 times: a percentile interval covers a little less than 95 %.

    That of 1,500 such intervals was 0.931 (few games, and the noise of the resamples). At 0.93 fewer than 166 of 200
    have a probability of 5e-7, and all of them one of 5e-7, too.
    """
    rng = np.random.default_rng(5)
    truth = np.linspace(-1.0, 2.0, 12)
    tasks, covered = [task(n) for n in range(12)], 0
    for seed in range(200):
        worth = [[mean + rng.normal(size=(1, 60))] for mean in truth]
        found = Scores(tasks, worth, 200, seed).interquartile_mean()
        assert found is not None
        covered += found.low <= stats.trim_mean(truth, 0.25) <= found.high
    assert 166 <= covered < 200


def test_nothing_to_score_is_refused() -> None:
    with pytest.raises(ValueError, match="no task to score"):
        Scores([], [], 10)
    with pytest.raises(ValueError, match="at least one score"):
        interquartile_mean(np.zeros((3, 0)))
    with pytest.raises(ValueError, match="resamples must be"):
        Scores([task(0)], [[np.zeros((1, 4))]], 0)
