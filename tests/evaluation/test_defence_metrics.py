"""Figures of merit of a defender on games made by hand, whose values follow from counting."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from spoofgym.evaluation.defence import DefenceEpisodes
from spoofgym.evaluation.defence_metrics import (
    NEVER,
    STEADY,
    defender_score,
    difference,
    false_alarm_rate,
    first_exclusion,
    onset,
    paired_difference,
    time_to_reuse,
)
from spoofgym.navigation.interface import Timeline

EPOCHS = 60


def epochs(*stretches):
    """Flags of one game, set in stretches from an epoch to before another, or at single epochs."""
    flags = np.zeros(EPOCHS, dtype=bool)
    for stretch in stretches:
        flags[slice(*stretch) if isinstance(stretch, tuple) else stretch] = True
    return flags


def game(attacked=(), excluded=(), outage=(), multipath=(), error=1.0):
    """One game; ``error`` is a number or a value per epoch."""
    attacked, excluded, available = epochs(*attacked), epochs(*excluded), ~epochs(*outage)
    clean = available & ~attacked & ~epochs(*multipath)
    return np.broadcast_to(error, EPOCHS), excluded, available, attacked, clean


def episodes(*games, interval=1.0):
    error, excluded, available, attacked, clean = (np.array(column) for column in zip(*games, strict=True))
    member = np.where(attacked.any(axis=1), 0, -1)
    timeline = Timeline.steady(20.0, interval, EPOCHS)
    return DefenceEpisodes(error * 1.0, excluded, available, attacked, clean, member, ("ramp",), timeline)


def score(*games, interval=1.0):
    return defender_score(episodes(*games, interval=interval))


ATTACK = [(10, 30)]


# --- detection --------------------------------------------------------------------------------------------------------


def test_detection_counts_from_the_onset_to_the_first_exclusion_under_attack():
    played = episodes(
        game(ATTACK, [(14, 25)]),
        game(ATTACK, [10]),
        game(ATTACK, [(3, 6), 29]),  # the first exclusion was a false alarm
        game(ATTACK, [5, 30, 59]),  # before and after
        game((), [7]),
    )
    np.testing.assert_array_equal(onset(played), [10, 10, 10, 10, EPOCHS])
    np.testing.assert_array_equal(first_exclusion(played), [4, 0, 19, NEVER, NEVER])
    result = defender_score(played)
    assert result.detection_probability == 3 / 4
    assert result.median_time_to_detect == 4.0  # two of the four attacks have been detected after 4 epochs


@pytest.mark.parametrize(
    ("first", "median"),
    [
        ([12, 15, None], 5.0),  # two of three
        ([12, None, None], None),  # fewer than half
        ([12, 17, None, None], 7.0),  # half of four
        ([None, None], None),
    ],
)
def test_median_time_to_detect_is_censored_by_the_attacks_end(first, median):
    games = [game(ATTACK, [31] if epoch is None else [epoch]) for epoch in first]
    assert score(*games).median_time_to_detect == median


def test_times_are_in_seconds():
    result = score(game(ATTACK, [(14, 36)]), interval=0.5)
    assert result.median_time_to_detect == 2.0
    assert result.median_time_to_reuse == 3.0


def test_times_are_those_of_the_epochs_where_some_are_missing():
    """A hole of 30 s within the attack, before the detection, and one of 10 s after its end, before GNSS is used."""
    times = np.arange(EPOCHS + 1.0)
    times[12:] += 30.0
    times[33:] += 10.0
    played = replace(episodes(game(ATTACK, [(14, 36)])), timeline=Timeline(times, 1.0))
    result = defender_score(played)
    assert result.median_time_to_detect == 34.0
    assert result.median_time_to_reuse == 16.0


def test_error_at_detection_is_the_mean_after_the_detecting_decisions():
    error = np.arange(EPOCHS) * 0.5
    assert score(game(ATTACK, [12], error=error), game(ATTACK, [20], error=error)).error_at_detection == 8.0
    assert score(game(ATTACK, [40], error=error)).error_at_detection is None


def test_an_outage_detects_nothing():
    """A response that does not use what is not there has not excluded a fix."""
    outage = [(12, 20)]
    assert score(game(ATTACK, outage, outage)).detection_probability == 0.0
    both = score(game(ATTACK, [(12, 22)], outage))
    assert both.detection_probability == 1.0
    assert both.median_time_to_detect == 10.0


def test_without_an_attack_nothing_can_be_detected():
    result = score(game(excluded=[(3, 6)]))
    assert result.detection_probability is None
    assert result.median_time_to_detect is None
    assert result.error_at_detection is None
    assert result.median_time_to_reuse is None
    assert result.never_reused is None


# --- re-use -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("excluded", "outage", "expected"),
    [
        ([], [], 0),  # never left out: used from the first fix after the attack on
        ([(14, 30)], [], 0),
        ([(14, 33)], [], 3),
        ([(14, 33), 36], [], 7),  # interrupted once
        ([(14, 33), 53], [], 3),  # 20 fixes in use between
        ([(14, 33), 52], [], 23),  # 19 only
        ([(14, EPOCHS)], [], NEVER),
        ([(14, 33), 59], [], 3),
        ([(14, EPOCHS - 1)], [], EPOCHS - 1 - 30),  # to the end, though that is one fix
        ([(14, 33)], [(33, 40)], 10),  # nothing is used where there is nothing
        ([(14, 33), (36, 40)], [(36, 40)], 3),  # an outage is no interruption
        ([(14, EPOCHS)], [(31, 55)], NEVER),  # nor is it use, however long it lasts
        ([(14, 33)], [(33, EPOCHS)], NEVER),
    ],
)
def test_time_to_reuse(excluded, outage, expected):
    reuse, ends = time_to_reuse(episodes(game(ATTACK, excluded, outage)))
    assert ends.tolist() == [True]
    assert reuse.tolist() == [expected]


def test_steady_is_twenty_fixes():
    assert STEADY == 20


def test_attacks_that_last_to_the_end_are_no_case_of_reuse():
    lasting = game([(10, EPOCHS)], [(12, EPOCHS)])
    result = score(lasting, game(ATTACK, [(12, 35)]))
    assert result.median_time_to_reuse == 5.0
    assert result.never_reused == 0.0
    assert score(lasting).never_reused is None


@pytest.mark.parametrize(
    ("ends", "median", "never"),
    [
        ([32, 36, EPOCHS], 6.0, 1 / 3),
        ([32, EPOCHS, EPOCHS], None, 2 / 3),
        ([32, 36, EPOCHS, EPOCHS], 6.0, 1 / 2),
        ([EPOCHS], None, 1.0),
    ],
)
def test_median_time_to_reuse_is_censored_by_the_end(ends, median, never):
    result = score(*[game(ATTACK, [(12, end)]) for end in ends])
    assert result.median_time_to_reuse == median
    assert result.never_reused == never


# --- clean GNSS -------------------------------------------------------------------------------------------------------


def test_clean_exclusion_is_a_share_of_clean_fixes():
    """Neither spoofed fixes, nor multipath, nor an outage are clean."""
    result = score(game(ATTACK, [(8, 32), (42, 47), (50, 55)], outage=[(50, 55)], multipath=[(44, 50)]))
    clean = EPOCHS - 20 - 5 - 6
    assert result.clean_exclusion == pytest.approx((2 + 2 + 2) / clean)


def test_false_alarms_are_exclusions_begun_before_an_attack_per_epoch_at_risk():
    played = episodes(game(ATTACK, [(3, 6), 8, (12, 40), 45]), game((), [(0, 2), 50]))
    # at risk: first game epochs 0-3, 7, 8 and no longer 4-6 and 9, which follow an exclusion; second all but 1, 2, 51
    assert false_alarm_rate(played) == pytest.approx((2 + 2) / (6 + EPOCHS - 3))


def test_false_alarms_do_not_count_multipath():
    played = episodes(game(excluded=[(20, 30)], multipath=[(20, 30)]))
    assert false_alarm_rate(played) == 0.0
    assert defender_score(played).clean_exclusion == 0.0


def test_an_outage_neither_begins_nor_hides_a_false_alarm():
    outage = [(20, 30)]
    quiet = episodes(game(excluded=outage, outage=outage))
    assert false_alarm_rate(quiet) == 0.0
    first_fix_after = episodes(game(excluded=[(20, 32)], outage=outage))
    assert false_alarm_rate(first_fix_after) == pytest.approx(1 / (EPOCHS - 10 - 2))
    through = episodes(game(excluded=[(18, 32)], outage=outage))  # one exclusion, begun at 18
    assert false_alarm_rate(through) == pytest.approx(1 / (EPOCHS - 10 - 4))


def test_an_attack_from_the_first_epoch_leaves_no_epoch_at_risk():
    assert false_alarm_rate(episodes(game([(0, EPOCHS)]))) is None
    assert score(game([(0, EPOCHS)], [(0, EPOCHS)])).clean_exclusion == 0.0


# --- errors -----------------------------------------------------------------------------------------------------------


def test_errors_from_the_onset_on():
    error = np.zeros(EPOCHS)
    error[[2, 12, 50]] = 100.0, 3.0, 4.0  # the first one before the attack
    result = score(game(ATTACK, error=error))
    assert result.mean_error == pytest.approx(107.0 / EPOCHS)
    assert result.rmse == pytest.approx(math.sqrt(25.0 / (EPOCHS - 10)))
    assert result.max_error == 4.0


def test_errors_of_pooled_games():
    """RMSE over all epochs of all stretches, maximum as the mean of each game's; clean games count whole."""
    attacked, clean = np.zeros(EPOCHS), np.full(EPOCHS, 2.0)
    attacked[10:], clean[0] = 1.0, 7.0
    result = score(game(ATTACK, error=attacked), game(error=clean))
    squares = 50 * 1.0 + 59 * 4.0 + 49.0
    assert result.episodes == 2
    assert result.rmse == pytest.approx(math.sqrt(squares / (50 + 60)))
    assert result.max_error == pytest.approx((1.0 + 7.0) / 2)


def test_interval_is_that_of_independent_games():
    rng = np.random.default_rng(0)
    errors = rng.exponential(size=(30, EPOCHS))
    result = score(*[game(error=row) for row in errors])
    means = errors.mean(axis=1)
    expected = stats.norm.interval(0.95, means.mean(), means.std(ddof=1) / np.sqrt(30))
    np.testing.assert_allclose(result.interval, expected)
    assert result.mean_error == pytest.approx(means.mean())


def test_some_of_the_games():
    played = episodes(game(ATTACK, [12], error=1.0), game(error=3.0))
    assert defender_score(played.of(played.member < 0)).mean_error == 3.0
    assert defender_score(played.of(played.member == 0)).detection_probability == 1.0


# --- paired differences -----------------------------------------------------------------------------------------------


def test_paired_differences_cancel_what_games_have_in_common():
    rng = np.random.default_rng(0)
    common = rng.exponential(100.0, size=(40, 1)) * np.ones(EPOCHS)
    gain = rng.normal(1.0, 0.1, size=(40, 1))
    one = episodes(*[game(ATTACK, error=row) for row in common])
    other = replace(one, error=common + gain)
    found = paired_difference(one, other)
    assert found.mean == pytest.approx(-gain.mean())
    expected = stats.norm.interval(0.95, -gain.mean(), gain.std(ddof=1) / np.sqrt(40))
    np.testing.assert_allclose(found.interval, expected, rtol=1e-9)
    assert difference(np.array([1.0, 2.0]), np.array([0.0, 4.0])).mean == -0.5


@pytest.mark.parametrize(
    "changed",
    [
        {"attacked": np.array([epochs((10, 31)), epochs()])},
        {"member": np.array([-1, 0])},
        {"error": np.ones((2, EPOCHS - 1))},
    ],
)
def test_other_episodes_are_not_compared(changed):
    one = episodes(game(ATTACK), game())
    assert paired_difference(one, replace(one, excluded=~one.excluded)).mean == 0.0
    with pytest.raises(ValueError, match="not played on the same episodes"):
        paired_difference(one, replace(one, **changed))
