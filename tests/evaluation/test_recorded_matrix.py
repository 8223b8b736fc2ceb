"""Detectors on a log at an equal false-alarm probability: thresholds, and games along the log."""

import json

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.cli.main import main
from spoofgym.detectors import make_detector
from spoofgym.evaluation.recorded_matrix import at_false_alarm_probability, play, recorded_matrices, starts
from spoofgym.scenarios import make_scenario
from tests.scenarios.test_recorded import write_log


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("log") / "log", velocity=False)


@pytest.fixture(scope="module")
def log(folder):
    return make_scenario(f"recorded:{folder},horizon=12")


def test_a_share_of_the_clean_epochs_exceeds_the_thresholds(log):
    given = [make_detector("snapshot"), make_detector("windowed:n=3"), make_detector("relative-motion:k=5")]
    games = starts(log, given, 4)
    ready = at_false_alarm_probability(games, given, 0.1)
    courses = [play(game, None, ready) for game in games]
    statistics = np.concatenate([course.statistic for course in courses], axis=1)
    exceeded = (statistics > np.array([[detector.threshold] for detector in ready])).sum(axis=1)
    assert exceeded.tolist() == [int(0.1 * statistics.shape[1])] * 3
    assert given[0].threshold == 25.9  # not changed


def test_games_stand_at_equal_distances_along_the_log_and_have_the_horizon(log):
    games = starts(log, [make_detector("snapshot")], 4)
    begins = [game.timeline.start for game in games]
    assert {game.timeline.num_epochs for game in games} == {12}
    assert np.ptp(np.diff(begins)) <= 3.0  # whole fixes, two of which are missing


def test_alarms_are_owed_to_the_attack(log):
    """A huge jump is found at once by all games; what alarms in clean games as well is not owed to it."""
    detectors = [make_detector("snapshot")]
    attacks = [make_attack("jump:500"), make_attack("ramp:0.0001")]
    *_, report = recorded_matrices(log, detectors, attacks, 0.1, 4)
    clean, jump, ramp = report["rows"]
    assert (jump["detection_probability"], jump["mean_undetected_error_m"]) == (1.0, 0.0)
    assert clean["detection_probability"] > 0.0
    assert ramp["detection_probability"] < clean["detection_probability"]
    assert report["false_alarm_probability"] == 0.1


def test_programs_of_simulated_scenarios_take_a_log(folder, tmp_path, capsys):
    text = f"recorded:{folder},horizon=12"
    parts = ["--detector", "snapshot", "--attack", "jump:50", "--p-fa", "0.1", "--episodes", "3"]
    assert main(["matrix", "--scenario", text, *parts, "--figure", str(tmp_path / "m.png")]) == 0
    assert "false-alarm probability of 0.1 per epoch of clean games" in capsys.readouterr().out
    assert main(["thresholds", "--scenario", text, "--detector", "snapshot", "--p-fa", "0.1", "--json", "-"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert (row["false_alarm_probability"], row["from"]) == (0.1, "the clean log")
    given = [f"{folder},horizon=12", "--detector", "snapshot", "--p-fa", "0.1", "--figure", str(tmp_path / "r.png")]
    assert main(["evaluate", "recorded", *given, "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["detector"]["threshold"] == pytest.approx(row["threshold"])
    assert all((tmp_path / name).stat().st_size > 5_000 for name in ("m.png", "r.png"))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["matrix", "--scenario", "LOG", "--arl0", "300"], "--arl0 does not go with a recorded log"),
        (["matrix", "--p-fa", "0.1"], "--p-fa is of recorded logs"),
        (["thresholds", "--p-fa", "0.1"], "--p-fa is of recorded logs"),
        (["thresholds", "--scenario", "LOG", "--detector", "snapshot", "--p-fa", "0.001"], "p_fa must be 1/12 or more"),
        (["matrix", "--scenario", "LOG", "--attack", "noise-matched"], "needs linear model"),
        (["evaluate", "spoofers", "--scenario", "LOG"], "is a recorded log: spoofgym evaluate recorded FOLDER"),
    ],
)
def test_what_does_not_go_together_is_told(arguments, words, folder, capsys):
    given = [f"recorded:{folder},horizon=12" if text == "LOG" else text for text in arguments]
    assert main(given) == 2
    assert words in " ".join(capsys.readouterr().err.split())
