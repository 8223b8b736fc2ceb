"""False-failure probabilities of the random tests are below 1e-7 each."""

import numpy as np
import pytest

from spoofgym.evaluation.credibility import deviation
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.studies.reproduce import song_2021
from spoofgym.studies.reproduce.papers import reproduce
from spoofgym.studies.reproduce.song_2021 import ACNA, CLEAN, EKF, GNSS, JUMPS, MIX, SLOW, TABLES, drive, latency
from spoofgym.studies.reproduce.tracks import Tracks, play

RUNS = 40


@pytest.fixture(scope="module")
def drives():
    return drive(RUNS, 0)


def made_up(alarm):
    """Tracks of which only the alarms at 0, 1, ... s count."""
    alarm = np.asarray(alarm, dtype=bool)
    nothing = np.zeros((*alarm.shape, 3))
    flat = np.zeros(alarm.shape)
    times = np.arange(float(alarm.shape[1]))
    return Tracks(times, nothing, nothing, flat, nothing, nothing, nothing, alarm, ~alarm, nothing, {})


def test_latency_is_that_of_runs_that_were_quiet_at_the_onset():
    track = made_up([[0, 0, 0, 1, 1, 0], [0, 1, 1, 1, 1, 1], [1, 0, 1, 0, 0, 0], [0, 0, 0, 0, 0, 1]])
    np.testing.assert_array_equal(latency(track, 1.0, 4.0), [2.0, 1.0, np.inf])


def test_a_latency_without_any_run_is_not_reproduced():
    row = song_2021._latency_row("item", 5.0, np.array([]))
    assert (row.verdict, row.value, row.interval) == ("not reproduced", None, None)


def test_the_receivers_deviation_is_that_of_its_offset(drives):
    """Half of 301 fixes off by 20 m on both axes: 14.1 m of the norm, whose own errors can add at most their deviation.

    That is 1.1 m in a typical run, and 3.2 m would be three times as much in all 300 s.
    """
    spoofed = np.arange(301) > 150
    expected = 20.0 * np.sqrt(2.0) * np.std(spoofed)
    assert np.abs(drives.sigma("set-a", JUMPS, GNSS) - expected).max() < 3.2
    assert np.median(drives.sigma("set-a", JUMPS, GNSS)) == pytest.approx(13.47, abs=1.0)


def test_the_filter_follows_the_spoofer_and_acna_does_not(drives):
    for data in (JUMPS, SLOW, MIX):
        assert drives.sigma("set-a", data, EKF).min() > 2.0 * drives.sigma("set-a", data, ACNA).max()


def test_games_of_all_algorithms_meet_the_same_noise(drives):
    clean, watched = drives.tracks["set-a", CLEAN, EKF], drives.tracks["set-a", CLEAN, ACNA]
    quiet = ~watched.alarm.any(axis=1)
    assert quiet.any()
    np.testing.assert_array_equal(clean.error[quiet], watched.error[quiet])
    np.testing.assert_allclose(clean.receiver_error, watched.receiver_error, atol=1e-9)


def test_the_jump_test_alone_is_an_epoch_later_than_both(drives):
    """Its window is two; the mean of five sees 28 m at once. Noise would have to exceed 20 m to change that."""
    quiet = latency(drives.tracks["set-a", MIX, ACNA], 50.0, 100.0)
    np.testing.assert_array_equal(quiet, 1.0)
    assert np.median(latency(drives.jump_test["set-a"], 50.0, 100.0)) == 2.0


def test_rows_have_every_figure_of_tables_3_to_7(drives, monkeypatch):
    monkeypatch.setattr(song_2021, "drive", lambda runs, seed: drives)
    report = reproduce(song_2021.PAPER, RUNS, 0, quick=True)
    basis = {row.item: row.basis for row in report.rows}
    assert basis["Table 4, slow change (Ψ̃3): EKF, set-a, max, m"] == "calibrated", "the filter's lag was set from it"
    assert basis["Table 4, slow change (Ψ̃3): EKF, set-a, σ, m"] == "printed"
    assert report.paper == "song-2021"
    printed = [row.paper_value for row in report.rows]
    for _, lines in TABLES.values():
        for algorithm, values in lines.items():
            for value in values:
                assert printed.count(value) >= (1 if algorithm == GNSS else 2)
    assert {20.01, 12.77, 92.53, -0.74, 27.0, 5.0} <= set(printed)
    items = [row.item for row in report.rows]
    assert len(items) == len(set(items))
    assert sum("share of runs with a false alarm" in item for item in items) == 2 + len(song_2021.OPEN)
    report.as_json()


def test_white_noise_would_not_stay_in_the_filter(drives):
    """Table 6 has 0.53 m of 0.59 m in the clean filter: slow noise passes, white noise is smoothed to less than half.

    About one run in twenty lies beyond its mark; twenty of forty would with a probability below 1e-12.
    """
    white = play(Simulation(make_scenario("song-robot:sigma=0.9,noise=white"), None, (), None, RUNS, 0))
    filtered, received = (
        deviation(np.hypot(error[..., 0], error[..., 1])) for error in (white.error, white.receiver_error)
    )
    assert np.median(filtered / received) < 0.5
    slow = drives.sigma("set-a", CLEAN, EKF) / drives.sigma("set-a", CLEAN, GNSS)
    assert np.median(slow) > 0.75
