"""Thresholds of a clean record, and the false alarms that it lets us claim."""

from __future__ import annotations

import numpy as np
import pytest

from spoofgym.evaluation.real_attacks.clean_record import CleanRecord, exceeded, false_alarms
from spoofgym.evaluation.real_attacks.outcomes import median_interval, standing


def record(statistic: np.ndarray, probability: float) -> CleanRecord:
    epochs = statistic.shape[1]
    thresholds = exceeded(statistic, probability)
    return CleanRecord(1.0 + np.arange(epochs), statistic, np.zeros(len(statistic)), 0.0, probability, thresholds)


def test_a_share_of_the_values_exceeds_the_threshold() -> None:
    values = np.random.default_rng(0).exponential(size=(3, 250))
    thresholds = exceeded(values, 0.02)
    assert (values > thresholds[:, None]).sum(axis=1).tolist() == [5, 5, 5]


@pytest.mark.parametrize(
    "values", [np.ones(100), np.zeros(100), -1.0 - np.arange(100.0), np.r_[np.full(3, np.inf), np.ones(97)]]
)
def test_no_threshold_where_none_gives_the_share(values: np.ndarray) -> None:
    """A statistic of one value, of none above 0, or one that is infinite too often."""
    assert np.isnan(exceeded(values[None], 0.02)).all()


def test_a_record_supports_no_share_below_one_epoch() -> None:
    values = np.random.default_rng(0).exponential(size=(1, 99))
    assert record(values, 0.01).alarms == 0
    assert np.isnan(record(values, 0.01).thresholds).all()
    assert record(values, 1.0 / 99.0).alarms == 1


def test_halves_of_white_noise_have_the_share_that_was_asked_for() -> None:
    """Of 20 records with 2000 epochs each, 0.05 asked for: the share of 40,000 epochs, thresholds of 50 alarms each.

    The share of a half has a relative standard deviation of √(1/50 + 1/50), so that of 40 halves 3.2 %: five of them.
    """
    rng = np.random.default_rng(1)
    found = [false_alarms(record(rng.exponential(size=(1, 2000)), 0.05), 0) for _ in range(20)]
    assert {each["epochs"] for each in found} == {2000}
    assert np.mean([each["share"] for each in found]) == pytest.approx(0.05, rel=0.16)
    assert all(each["ci95"][0] < each["share"] < each["ci95"][1] for each in found)


def test_a_record_whose_halves_differ_shows_it() -> None:
    """The second half is ten times as loud: nearly all of it exceeds the first one's threshold, none the other way."""
    rng = np.random.default_rng(2)
    loud = np.hstack([rng.uniform(0.9, 1.0, (1, 200)), rng.uniform(9.0, 10.0, (1, 200))])
    found = false_alarms(record(loud, 0.05), 0)
    assert (found["alarms"], found["share"], found["begun"]) == (200, 0.5, 1)
    assert found["hours"] == pytest.approx(400.0 / 3600.0)


def test_a_record_too_short_for_halves_says_nothing() -> None:
    found = false_alarms(record(np.random.default_rng(0).exponential(size=(1, 150)), 0.01), 0)
    assert set(found.values()) == {None}


def test_growth_is_taken_from_games_as_from_the_record() -> None:
    clean = CleanRecord(np.array([1.0, 2.0]), np.ones((1, 2)), np.array([3.0]), 0.0, 0.5, np.array([1.5]))
    excess = clean.excess(np.array([10.0, 20.0]), np.array([[[32.0], [60.0]]]))
    np.testing.assert_allclose(excess, [[[0.5], [-1.5]]])
    nowhere = CleanRecord(clean.time, clean.statistic, clean.growth, 0.0, 0.5, np.array([np.nan]))
    assert (nowhere.excess(np.array([1.0]), np.full((1, 1, 1), 1e12)) < 0.0).all()


@pytest.mark.parametrize(("number", "place"), [(6, 0), (8, 0), (9, 1), (12, 2), (25, 7), (100, 39)])
def test_interval_of_a_median(number: int, place: int) -> None:
    """Places from the table of Conover (1999), A3: the median of n values lies between the r-th and the (n-r+1)-th."""
    values = np.random.default_rng(3).permutation(np.arange(float(number))).tolist()
    assert median_interval(values) == [place, number - 1 - place]


def test_interval_of_a_median_of_few_or_unfinished() -> None:
    assert median_interval([1.0] * 5) is None
    assert median_interval([1.0, 2.0, 3.0, 4.0, 5.0, np.inf]) == [1.0, None]


def test_an_alarm_that_stands_at_the_onset() -> None:
    alarm = np.array([0, 1, 1, 1, 0, 1], dtype=bool)
    assert standing(alarm, 2).tolist() == [False, True, True, True, False, False]
    assert not standing(alarm, 1).any()
    assert standing(np.ones(3, dtype=bool), 1).all()
