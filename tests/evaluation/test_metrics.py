"""Metrics on hand-made episodes, and Monte Carlo against the exact play."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from spoofgym.attacks import make_attack
from spoofgym.calibration import calibrated
from spoofgym.detectors import make_detector
from spoofgym.evaluation.metrics import attacker_score, mean_interval, undetected_error
from spoofgym.evaluation.monte_carlo import NEVER, Episodes, watch_attack
from spoofgym.optimum import best_ramp, expected_play
from spoofgym.policies.scripted import OffsetSequence, RandomRates
from spoofgym.scenarios import make_scenario
from spoofgym.timeline import Timeline


def episodes(alarm_epoch, interval=1.0):
    alarm_epoch = np.array(alarm_epoch)
    n = len(alarm_epoch)
    timeline = Timeline.steady(20.0, interval, 10)
    return Episodes(alarm_epoch, np.full(n, 3.0), np.arange(n, dtype=float), np.zeros(n, dtype=int), timeline)


def test_a_detected_game_counts_zero():
    np.testing.assert_array_equal(undetected_error(episodes([NEVER, 4, NEVER])), [0.0, 0.0, 2.0])


@pytest.mark.parametrize(
    ("alarms", "median"),
    [
        ([5, 3, NEVER], 5.0),  # two of three had one after 5 epochs
        ([5, NEVER, NEVER], None),  # fewer than half
        ([NEVER] * 4, None),
        ([7, 2, NEVER, NEVER], 7.0),  # half of four
    ],
)
def test_median_time_is_censored_by_the_end(alarms, median):
    score = attacker_score(episodes(alarms))
    assert score.median_time_to_detect == median
    assert score.error_at_detection == (None if all(a == NEVER for a in alarms) else 3.0)


def test_median_time_is_in_seconds():
    assert attacker_score(episodes([4, 4, 4], interval=0.5)).median_time_to_detect == 2.0


def test_median_time_is_that_of_the_epochs_where_some_are_missing():
    """The first alarm comes in epoch 3, 31 s after epoch 0, because the receiver gave nothing for 28 s."""
    timeline = Timeline(np.array([20.0, 21.0, 22.0, 51.0, 52.0]), 1.0)
    played = replace(episodes([3, 3, 4]), timeline=timeline)
    assert attacker_score(played).median_time_to_detect == 31.0
    late = replace(played, onset_epoch=np.full(3, 3), alarm_epoch=np.full(3, 4))
    assert attacker_score(late).median_time_to_detect == 1.0


def test_interval_of_a_mean():
    values = np.random.default_rng(0).normal(size=50)
    low, high = mean_interval(values)
    expected = stats.norm.interval(0.95, values.mean(), values.std(ddof=1) / np.sqrt(50))
    np.testing.assert_allclose((low, high), expected)


def test_monte_carlo_agrees_with_the_exact_play():
    """Survival and mean undetected error of the best ramp, 4000 games; 6 sigma: false failure below 1e-8."""
    scenario = make_scenario("liu-flight")
    detector = calibrated(make_detector("snapshot"), scenario)
    ramp = best_ramp(scenario.linear_model(), detector.threshold)
    attack = make_attack(f"ramp:{ramp.rate:.9g},direction={ramp.azimuth:.9g}")
    played = attacker_score(watch_attack(scenario, attack, [detector], 4000, 7).together())
    survival = float(ramp.outcome.survival)
    deviation = np.sqrt(survival * (1 - survival) / 4000)
    assert abs(1 - played.detection_probability - survival) < 6 * deviation
    standard_error = (played.interval[1] - played.interval[0]) / (2 * 1.96)
    # the filter's own noise adds sigma² / (2 error) = 0.01 m to the mean norm
    assert abs(played.mean_undetected_error - float(ramp.outcome.score)) < 6 * standard_error + 0.02


def test_attackers_meet_the_same_noise():
    """Without an alarm the final errors of two attacks differ by the exact difference of their means alone."""
    scenario = make_scenario("liu-flight:horizon=20")
    offsets = np.zeros((20, 3))
    offsets[:, 0] = np.linspace(0.1, 3.0, 20)
    detector = make_detector("snapshot:threshold=1e6")
    clean = watch_attack(scenario, make_attack("none"), [detector], 50, 3).together()
    detector = make_detector("snapshot:threshold=1e6")
    attack = OffsetSequence("sequence", offsets)
    spoofed = watch_attack(scenario, attack, [detector], 50, 3).together()
    shift = np.linalg.norm(expected_play(scenario.linear_model(), offsets, 25.9).final_error)
    assert np.all(np.abs(spoofed.final_error - clean.final_error) <= shift + 1e-9)
    assert np.std(spoofed.final_error - clean.final_error) > 0


def test_offsets_of_another_length_are_refused():
    scenario = make_scenario("liu-flight:horizon=20")
    with pytest.raises(ValueError, match="19 offsets, the game 20 epochs"):
        watch_attack(scenario, OffsetSequence("short", np.zeros((19, 3))), [make_detector("snapshot")], 2, 0)


def test_random_rates_stay_within_the_limits():
    scenario = make_scenario("liu-flight:horizon=20")
    attack = RandomRates((4.0, 2.0, 1.0))
    watch_attack(scenario, attack, [make_detector("snapshot")], 30, 0)
    steps = np.diff(attack._offsets, axis=1)
    assert np.all(np.abs(steps) <= np.array([4.0, 2.0, 1.0]) + 1e-12)
    assert np.all(np.abs(steps).max(axis=(0, 1)) > 0.9 * np.array([4.0, 2.0, 1.0]))


def test_no_episodes_are_refused():
    with pytest.raises(ValueError, match="episodes must be a whole number, 1 or more, got 0"):
        watch_attack(make_scenario("liu-flight"), make_attack("none"), [make_detector("snapshot")], 0, 0)
