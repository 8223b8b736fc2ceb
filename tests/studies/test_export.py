"""A run folder becomes an agent: policy, card with scores, and the recipe that trains it again."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spoofgym.envs.config import SpooferConfig
from spoofgym.envs.duel_config import DuelDefenderConfig, DuelSpooferConfig
from spoofgym.envs.duel_game import DuelDefenderGame, DuelSpooferGame
from spoofgym.envs.spoofer_game import SpooferGame
from spoofgym.evaluation.agent_scores import agent_scores
from spoofgym.evaluation.duels import play_cell
from spoofgym.policies.card import read_card
from spoofgym.policies.learned import CONFIG_FILE, LearnedDefender, LearnedSpoofer, load_policy
from spoofgym.policies.recipe import read_recipe
from spoofgym.streams import RunStreams
from spoofgym.studies.export import main
from tests.run_folders import defender, network, saved, spoofer

DRIVE, FLIGHT = "foi-drive:horizon=20", "liu-flight:horizon=12"
GAMES = ["--games", "20", "--seed", "3"]


def finished(folder: Path, learner: dict[str, Any]) -> Path:
    """A run folder whose configuration tells the learner, too, as a training writes it."""
    content = json.loads((folder / CONFIG_FILE).read_text())
    (folder / CONFIG_FILE).write_text(json.dumps({**content, "learner": learner, "seed": 4, "steps": 1000}))
    return folder


def test_a_run_becomes_an_agent(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spoofer({"scenario": FLIGHT, "knowledge": "blind", "detector": "snapshot"}, tmp_path / "run")
    run, out = finished(tmp_path / "run", {"lanes": 8}), tmp_path / "mine"
    assert main([str(run), str(out), *GAMES, "--onnx"]) == 0
    assert "mean undetected error against snapshot:" in capsys.readouterr().out
    assert sorted(path.name for path in out.iterdir()) == ["card.json", "policy.npz", "policy.onnx", "recipe.toml"]
    card, policy = read_card(out), load_policy(out)
    assert (card.name, card.role, card.environment) == ("mine", "spoofer", "spoofgym/Spoofer-v0")
    assert card.training["seed"] == 4
    assert policy.weights_digest == load_policy(run).weights_digest
    (score,) = card.scores
    assert (score.games, score.seed, score.unit) == (20, 3, "m")
    assert score == agent_scores(policy, 20, 3)[0]
    assert main([str(out), str(tmp_path / "again"), *GAMES]) == 2
    assert f"{out} is an agent already: name the run folder of its training" in capsys.readouterr().err
    recipe = read_recipe(out)
    assert recipe.program == "spoofgym.learning.spoofer"
    options = {"scenario": FLIGHT, "detector": "snapshot", "knowledge": "blind", "lanes": 8, "seed": 4, "steps": 1000}
    assert dict(recipe.options) == options


def test_the_score_of_a_spoofer_is_the_mean_of_undetected_errors(tmp_path: Path) -> None:
    spoofer({"scenario": FLIGHT, "knowledge": "blind", "detector": "snapshot"}, tmp_path / "x")
    policy = LearnedSpoofer.load(tmp_path / "x")
    (score,) = agent_scores(policy, 10, 3)
    config, values = SpooferConfig(scenario=FLIGHT, knowledge="blind"), []
    for game in range(10):
        env = SpooferGame(config, 1, streams=RunStreams.from_seed(3 + game, 1))
        env.reset(np.arange(1))
        over = False
        while not over:
            outcome = env.step(policy.act(env.observation()))
            over = bool(outcome.terminated[0])
        values.append(env.error[0] if env.end_values(outcome)["outcome"][0] == "undetected" else 0.0)
    assert score.value == pytest.approx(np.mean(values), rel=1e-12)


def test_the_score_of_a_duel_is_the_harm_of_its_cell(tmp_path: Path) -> None:
    """Both sides; the policies are loaded as players by name, with what they saw in their training."""
    one = DuelSpooferConfig(scenario=DRIVE, detectors=("snapshot",), knowledge="full", defender="snapshot > exclude")
    two = DuelDefenderConfig(scenario=DRIVE, detectors=("snapshot",), spoofer=("ramp:1", "jump:20"))
    for config, game, kind in ((one, DuelSpooferGame, LearnedSpoofer), (two, DuelDefenderGame, LearnedDefender)):
        folder, seat = tmp_path / kind.kind, game(config, 1).seat
        outputs = seat.space.shape[0] if kind is LearnedSpoofer else int(seat.space.nvec.sum())
        layout = tuple(field.name for field in seat.fields)
        values = json.loads(json.dumps(vars(config)))
        saved(kind(folder, values, layout, *network(len(layout), outputs, 1)), values, folder)
        (score,) = agent_scores(load_policy(folder), 12, 3)
        player = f"policy:{folder}"
        players = (player, one.defender) if kind is LearnedSpoofer else (two.spoofer, player)
        assert score.value == pytest.approx(play_cell(config, *players, 12, 3).mean, rel=1e-12)
        assert (score.metric, score.unit) == ("harm", "m")
    assert score.opponent == "ramp:1 + jump:20"


def test_a_defender_is_scored_against_both_populations(tmp_path: Path) -> None:
    defender({"scenario": "foi-drive:horizon=40", "attacks": "training", "detectors": ["snapshot"]}, tmp_path / "d")
    scores = agent_scores(load_policy(tmp_path / "d"), 10, 3)
    assert [score.opponent for score in scores] == ["training", "held-out"]
    assert {score.metric for score in scores} == {"mean error"}


def test_nothing_is_written_over_and_nothing_is_left_half_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    spoofer({"scenario": FLIGHT, "knowledge": "blind"}, tmp_path / "run")
    run = finished(tmp_path / "run", {})
    assert main([str(run), str(run), *GAMES]) == 2
    assert f"{run} exists already: choose another folder" in capsys.readouterr().err
    assert main([str(tmp_path / "nothing"), str(tmp_path / "out"), *GAMES]) == 2
    assert "is no run folder" in capsys.readouterr().err

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("spoofgym.policies.recipe.Recipe.write", full)
    assert main([str(run), str(tmp_path / "out"), *GAMES]) == 1
    assert "No space left on device" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run"]
