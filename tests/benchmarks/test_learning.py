"""The benchmark of learning trains what is not trained, goes on with what was stopped, and evaluates the rest."""

import json

import pytest
import torch

from benchmarks import learning
from spoofgym.envs.config import SpooferConfig
from spoofgym.learning.ppo import Settings
from spoofgym.learning.run_folder import CHECKPOINT_FILE, Run, RunFolder

GIVEN = ["--seeds", "0", "--steps", "1000", "--json", "-"]


@pytest.fixture
def trainings(tmp_path, monkeypatch):
    """The command lines of the trainings; trainings and evaluations themselves do nothing."""
    commands = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(learning.spoofer, "main", lambda arguments: commands.append(arguments) or 0)

    def evaluated(arguments):
        print("a table")
        folder, out = (arguments[arguments.index(option) + 1] for option in ("--attacker", "--json"))
        row = {"mean_undetected_error_m": 1.0, "exact_undetected_error_m": 1.0, "fraction_of_optimum": 0.5}
        rows = [{"attacker": name, **row} for name in (folder.split("/")[-1], "best-ramp")]
        learning.Path(folder).mkdir(parents=True, exist_ok=True)
        learning.Path(out).write_text(json.dumps({"rows": rows}))
        return 0

    monkeypatch.setattr(learning.evaluate_spoofers, "main", evaluated)
    return commands


def begun(tmp_path, finished=None):
    path = tmp_path / "runs" / "learning" / "snapshot-shadow-rate-0"
    folder = RunFolder(path, "spoofgym.learning.spoofer", (SpooferConfig,), Settings)
    folder.begin(Run(SpooferConfig(), Settings(), 0, 1000))
    (folder.path / "policy.npz").write_bytes(b"a policy of a run that was stopped")
    if finished is not None:
        torch.save({"played": 1000, "finished": finished}, folder.path / CHECKPOINT_FILE)


def test_a_seed_without_a_run_is_trained(trainings, capsys):
    assert learning.main(GIVEN) == 0
    (command,) = trainings
    assert "--resume" not in command
    printed = capsys.readouterr()
    assert json.loads(printed.out)["rows"][0]["fraction_of_optimum"] == 0.5  # no table of another program before it
    assert "a table" in printed.err


@pytest.mark.parametrize("finished", [None, 0])
def test_a_run_that_was_stopped_goes_on(finished, trainings, tmp_path):
    """Its policy is not taken for that of a run that has come to its end."""
    begun(tmp_path, finished)
    assert learning.main(GIVEN) == 0
    (command,) = trainings
    assert "--resume" in command


def test_a_run_that_has_ended_is_evaluated(trainings, tmp_path):
    begun(tmp_path, 1000)
    assert learning.main(GIVEN) == 0
    assert trainings == []


def test_a_run_of_another_length_is_refused(trainings, tmp_path, capsys):
    begun(tmp_path, 1000)
    assert learning.main(["--seeds", "0", "--steps", "2000"]) == 2
    assert "--steps 2000 was given, the run has 1000" in capsys.readouterr().err
    assert trainings == []


def test_a_training_that_fails_ends_the_benchmark(trainings, monkeypatch):
    monkeypatch.setattr(learning.spoofer, "main", lambda arguments: 130)
    with pytest.raises(SystemExit) as ended:
        learning.main(GIVEN)
    assert ended.value.code == 130
