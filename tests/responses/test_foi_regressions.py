"""Depth matters, and too deep or ill-timed hurts: what FOI-R-5687's scenarios do to a correct filter.

The games are those behind the reproduction of the report: its drive, its receiver with an over-stated covariance, nine
states, test (3) with the report's thresholds. Twelve runs each; the limits are far from what is measured with forty
(docs/results/reproduction.md), and each run meets its own noise.
"""

import functools

import numpy as np
import pytest

from spoofgym.studies.reproduce.foi_games import Figures, Games, figures
from spoofgym.studies.reproduce.foi_tables import ATTACKS, SETTINGS

RUNS = 12
K20_BACK_20, K5_BACK_20, K20_BACK_0, K5_BACK_10 = 5, 6, 7, 9


@functools.cache
def played(scenario: int, setting: int) -> Figures:
    games = Games(RUNS, 0, {})
    return figures(games.defended(scenario, SETTINGS[setting]), ATTACKS[scenario])


def never(scenario: int, setting: int) -> float:
    """Share of the runs in which GNSS is never used again without interruption."""
    return float(np.mean(np.isinf(played(scenario, setting).reuse)))


@pytest.mark.parametrize("scenario", [1, 4])
def test_without_backtracking_gnss_is_never_used_again_and_with_it_it_is(scenario):
    assert never(scenario, K20_BACK_0) > 0.7
    assert never(scenario, K20_BACK_20) < 0.3
    assert np.median(played(scenario, K20_BACK_20).largest) < 0.5 * np.median(played(scenario, K20_BACK_0).largest)


@pytest.mark.parametrize(("scenario", "setting"), [(7, K20_BACK_20), (8, K20_BACK_20)])
def test_an_alarm_at_the_attacks_end_backtracks_into_it_and_locks_true_gnss_out(scenario, setting):
    """A slow, short attack is seen when the receiver jumps back; what is taken back then leaves the spoofed state."""
    assert np.median(played(scenario, setting).first_alarm) >= ATTACKS[scenario].end
    assert never(scenario, setting) > 0.6


def test_a_backtrack_that_ends_in_a_speed_change_does_not_blow_up():
    """The report's scenario 5 grows to 2319 m with 20 samples back; a correct filter stays below 100 m with any."""
    for setting in (K5_BACK_20, K5_BACK_10, K20_BACK_20):
        assert played(5, setting).largest.max() < 100.0
