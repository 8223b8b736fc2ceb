"""A policy that is evaluated plays the games of its own environment, and every fix of them is used."""

from dataclasses import replace

import numpy as np
import pytest

from spoofgym.detectors import make_detector
from spoofgym.envs.policy_players import PolicySpoofer
from spoofgym.envs.spoofer_game import SpooferGame
from spoofgym.envs.trained import spoofer_config
from spoofgym.evaluation.attackers import Evaluation
from spoofgym.evaluation.matrix_games import Matrix
from spoofgym.policies.learned import LearnedSpoofer
from spoofgym.scenarios import make_scenario
from spoofgym.streams import RunStreams
from tests.run_folders import spoofer

FLIGHT, EPISODES, SEED = "liu-flight:horizon=2,onset=300", 100, 3
DETECTOR = "snapshot:threshold=3"
TRAINED = {
    "until an alarm": {"knowledge": "shadow", "on_alarm": "end"},
    "against a response": {"knowledge": "shadow", "on_alarm": "respond", "response": "exclude"},
    "with sight of the statistics": {"knowledge": "full", "detector": DETECTOR},
}


@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
@pytest.mark.parametrize("trained", TRAINED)
def test_a_policy_plays_the_games_of_its_own_environment(trained, fidelity, tmp_path):
    """The fix of a last epoch with an alarm is used, whatever an alarm meant in training.

    A clean statistic alarms with a probability of 0.39, so that none of 100 games has its first alarm in the second and
    last epoch with one of 1e-11.
    """
    spoofer({"scenario": FLIGHT, **TRAINED[trained]}, tmp_path / "x")
    policy, detector = LearnedSpoofer.load(tmp_path / "x"), make_detector(DETECTOR)
    evaluation = Evaluation(make_scenario(FLIGHT), (DETECTOR,), [detector], fidelity, EPISODES, SEED, 1, None)
    evaluation.check_layouts([policy])
    games = evaluation.play(PolicySpoofer(policy), EPISODES)
    given = {"detector": DETECTOR, "fidelity": fidelity, "on_alarm": "respond", "response": "always-use"}
    game = SpooferGame(replace(spoofer_config(policy), **given), EPISODES, streams=RunStreams.from_seed(SEED, EPISODES))
    game.reset(np.arange(EPISODES))
    alarms = []
    for _ in range(2):
        game.step(policy.act(game.observation()))
        alarms.append(game.simulation.alarm.copy())
    np.testing.assert_array_equal(games.alarm_epoch, np.where(alarms[0], 1, np.where(alarms[1], 2, -1)))
    assert np.any(games.alarm_epoch == 2)
    np.testing.assert_array_equal(games.final_error, game.error)


def test_a_matrix_plays_a_policy_as_it_plays_an_attack(tmp_path):
    text = spoofer({"scenario": "liu-flight:horizon=22", "knowledge": "shadow"}, tmp_path / "x")
    policy = LearnedSpoofer.load(tmp_path / "x")
    matrix = Matrix(make_scenario("liu-flight:horizon=22"), "linear", 1000.0, 20, 3, 1)
    assert matrix.names([text, "jump"], [policy]) == [text, "jump", "x"]
    report = matrix.report(["snapshot"], [text], [policy])
    rows = {row["attack"]: {**row, "attack": ""} for row in report["rows"]}
    assert rows["x"] == rows[text] != rows["none"]
    assert PolicySpoofer(policy).name == "x"
