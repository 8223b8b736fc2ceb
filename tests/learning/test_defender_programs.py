"""The training of a defender as a user runs it: a short run, its resumption, bad input."""

import json
import shutil

import numpy as np
import pytest

from spoofgym.calibration import calibrated_all
from spoofgym.detectors import make_detector
from spoofgym.envs.trained import defender_config
from spoofgym.envs.vector import DefenderVectorEnv
from spoofgym.evaluation.defence import World, play_policy
from spoofgym.learning import defender
from spoofgym.learning.defender import VALIDATION_FILE, VALIDATION_SEED
from spoofgym.learning.imitation import BankTeacher
from spoofgym.learning.run_folder import CHECKPOINT_FILE
from spoofgym.policies.learned import CONFIG_FILE, POLICY_FILE, LearnedDefender
from spoofgym.scenarios import make_scenario
from spoofgym.studies import tune
from spoofgym.studies.evaluate import defenders as evaluate_defenders
from tests.learning.runs import DRIVE, SHORT, STEPS, few_lessons

pytestmark = pytest.mark.xdist_group("taught defender")  # one worker: the run folder is made once


@pytest.fixture(autouse=True, scope="module")
def _few_lessons():
    with few_lessons():
        yield


def test_training_leaves_a_policy_and_says_how(taught):
    config = json.loads((taught / CONFIG_FILE).read_text())
    assert config["environment"]["scenario"] == DRIVE
    assert config["environment"]["attacks"] == "training"
    assert config["environment"]["detectors"] == ["snapshot"]
    assert (config["learner"]["lanes"], config["learner"]["validation_episodes"]) == (4, 20)
    assert (config["seed"], config["steps"]) == (0, STEPS)
    policy = LearnedDefender.load(taught)
    actions = policy.act(np.zeros((2, len(policy.layout)), dtype=np.float32))
    assert actions.shape == (2, 2)
    assert (taught / CHECKPOINT_FILE).is_file()
    assert list((taught / "tensorboard").rglob("events.*"))


def test_the_policy_that_is_kept_is_the_best_in_validation(taught):
    """Played again on the validation games it has the least of the errors that stand in the run folder, exactly."""
    validation = json.loads((taught / VALIDATION_FILE).read_text())
    assert validation[-1]["steps"] >= STEPS
    assert len(validation) > 2
    scenario = make_scenario(DRIVE)
    world = World(scenario, "training", 0.5, tuple(calibrated_all([make_detector("snapshot")], scenario)))
    policy = LearnedDefender.load(taught)
    games = play_policy(world, defender_config(policy), policy.act, 20, VALIDATION_SEED)
    assert games.error.mean() == min(row["mean_error_m"] for row in validation)


def test_a_run_folder_is_not_overwritten(taught, capsys):
    before = (taught / POLICY_FILE).read_bytes()
    assert defender.main([*SHORT, "--out", str(taught)]) == 2
    assert "already holds a run" in " ".join(capsys.readouterr().err.split())
    assert (taught / POLICY_FILE).read_bytes() == before


def test_a_run_can_be_resumed(taught, tmp_path, capsys):
    folder = tmp_path / "resumed"
    shutil.copytree(taught, folder)
    before = json.loads((folder / VALIDATION_FILE).read_text())
    checkpoint = (folder / CHECKPOINT_FILE).read_bytes()
    assert defender.main([*SHORT, "--steps", str(2 * STEPS), "--out", str(folder), "--resume"]) == 0
    after = json.loads((folder / VALIDATION_FILE).read_text())
    assert after[: len(before)] == before
    assert before[-1]["steps"] < after[-1]["steps"] < 2 * STEPS + 4 * 60
    assert (folder / CHECKPOINT_FILE).read_bytes() != checkpoint
    assert f"trained {after[-1]['steps'] - before[-1]['steps']:,} steps" in " ".join(capsys.readouterr().err.split())
    LearnedDefender.load(folder)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--steps", "9999", "--seed", "7"], "a resumed run keeps its settings: --seed 7 was given, the run has 0"),
        (["--steps", "9999", "--attacks", "held-out"], "--attacks held-out was given, the run has training"),
        (["--steps", "9999", "--gamma", "0.5"], "--gamma 0.5 was given, the run has 0.99"),
        ([], "steps already: give more than that by --steps"),
    ],
)
def test_a_resumed_run_refuses_other_settings_and_stays_as_it_is(taught, tmp_path, capsys, arguments, message):
    folder = tmp_path / "resumed"
    shutil.copytree(taught, folder)
    kept = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    assert defender.main([*arguments, "--out", str(folder), "--resume"]) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()} == kept


def test_a_run_that_was_interrupted_at_its_beginning_starts_again(taught, tmp_path, capsys, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    folder = tmp_path / "short"
    with monkeypatch.context() as patch:
        patch.setattr(defender, "begin", interrupted)
        assert defender.main([*SHORT, "--steps", str(STEPS), "--out", str(folder)]) == 130
    assert "go on with: spoofgym train defender --resume" in capsys.readouterr().err
    LearnedDefender.load(folder)
    assert defender.main(["--resume", "--out", str(folder)]) == 0
    for name in (VALIDATION_FILE, POLICY_FILE):  # on the same seed
        assert (folder / name).read_bytes() == (taught / name).read_bytes()


def test_a_defender_that_sees_a_bank_begins_with_what_it_says(tmp_path):
    """The policy that is kept plays again without the program, and the network does what its teacher does.

    The teacher excludes in some hundreds of the decisions: who never does would agree in nine of ten at most.
    """
    folder, bank = tmp_path / "bank", "multiple-hypothesis:hypotheses=4,hidden=0"
    given = [*SHORT, "--bank", bank, "--steps", str(STEPS), "--hidden", "32"]
    assert defender.main([*given, "--out", str(folder)]) == 0
    policy = LearnedDefender.load(folder)
    config = defender_config(policy)
    assert config.bank == bank
    assert policy.layout[-1] == "spread of the hypotheses"
    vector = DefenderVectorEnv(64, **(vars(config) | {"clean": 0.0, "attacks": "random-jump"}))
    observation, _ = vector.reset(seed=9)
    same, excluded = [], []
    for _ in range(59):
        taught = BankTeacher(0.1).act(vector.game)
        same.append(policy.act(observation)[:, 0] == taught[:, 0])
        excluded.append(taught[:, 0] == 1)
        observation, *_ = vector.step(taught)
    assert np.mean(excluded) > 0.1
    assert np.mean(same) > 0.93


# --- arguments ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("program", "arguments", "message"),
    [
        (defender, ["--scenario", "moon"], "unknown scenario 'moon'; valid names: "),
        (defender, ["--detector", "oracle"], "unknown detector 'oracle'; valid names: "),
        (defender, ["--detector", "snapshot", "--attacks", "rain"], "unknown attack 'rain'"),
        (defender, ["--detector", "snapshot", "--detector", "snapshot"], "each detector can be given once only"),
        (defender, ["--scenario", "foi-drive:horizon=0"], "horizon must be a whole number, 1 or more, got 0"),
        (defender, ["--bank", "exclude"], "bank: a bank is spelled multiple-hypothesis or multiple-hypothesis:"),
        (defender, ["--bank", "multiple-hypothesis", "--spoofer", "jump"], "nobody sees a bank in a duel"),
        (defender, ["--resume", "--out", "nowhere"], "nowhere holds no run to resume: it has no config.json"),
        (tune, ["--scenario", "moon"], "unknown scenario 'moon'; valid names: "),
    ],
)
def test_bad_input_is_told_and_nothing_is_written(program, arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert program.main(arguments) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert list(tmp_path.rglob("*.npz")) == []
    assert list(tmp_path.rglob("*.json")) == []


@pytest.mark.parametrize(
    ("program", "option", "value"),
    [
        (defender, "--steps", "0"),
        (defender, "--seed", "-1"),
        (defender, "--privileged", "perhaps"),
        (defender, "--fidelity", "cubic"),
        (evaluate_defenders, "--population", "everyone"),
        (tune, "--episodes", "none"),
    ],
)
def test_arguments_are_checked_at_once(program, option, value, capsys):
    with pytest.raises(SystemExit):
        program.main([option, value])
    assert value in capsys.readouterr().err
