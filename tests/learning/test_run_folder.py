"""Runs that are killed, resumed and contradicted: they end as if nothing had happened, or say why not.

A kill is an exception that nothing catches, raised at a write, or a copy of the folder made there: the files are then
what a killed process leaves.
"""

import json
import shutil
import signal
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
import torch
from rich.console import Console

from spoofgym import files
from spoofgym.learning import defender, spoofer, watch
from spoofgym.learning.run_folder import CHECKPOINT_FILE, RunFolder
from spoofgym.policies.learned import CONFIG_FILE, LearnedDefender, LearnedSpoofer
from tests.learning.runs import PROGRAMS, TYPES, begun, result, resume

pytestmark = pytest.mark.xdist_group("run folders")  # one worker: the uninterrupted runs are made once


class Killed(BaseException):
    """The process ends here."""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["spoofer", "defender"])
def test_a_run_killed_at_any_write_ends_as_if_it_had_not_been(name, uninterrupted, tmp_path, monkeypatch):
    """One run leaves a copy of its folder before each write, where half of the new file lies there as a draft."""
    _, expected, writes = uninterrupted(name)
    path, real, copies = tmp_path / "run", files.write_bytes, []

    def copying(target, content):
        copies.append(tmp_path / str(len(copies)) / "run")
        shutil.copytree(path, copies[-1])
        (copies[-1] / f".kill{files.DRAFT}").write_bytes(content[: len(content) // 2])
        real(target, content)

    program = begun(path, name)
    with monkeypatch.context() as patch:
        patch.setattr(files, "write_bytes", copying)
        assert resume(program, path) == 0
    assert len(copies) == writes
    for write, left in enumerate(copies, start=1):
        assert resume(program, left) == 0
        assert result(left) == expected, f"killed at write {write} of {writes}"


@pytest.mark.parametrize("name", ["spoofer", "defender"])
def test_a_run_killed_many_times_ends_all_the_same(name, uninterrupted, tmp_path, monkeypatch):
    """Each time after some more writes: in trials, between policy and checkpoint, before and after validations."""
    _, expected, writes = uninterrupted(name)
    path, real, left = tmp_path / "run", files.write_bytes, 0

    def dying(target, content):
        nonlocal left
        left -= 1
        if left < 0:
            raise Killed
        real(target, content)

    program, kills = begun(path, name), 0
    monkeypatch.setattr(files, "write_bytes", dying)
    while True:
        left = 3 + kills
        try:
            assert resume(program, path) == 0
            break
        except Killed:
            kills += 1
            assert kills < writes
    assert kills > 1
    assert result(path) == expected


@pytest.mark.parametrize("name", ["spoofer", "defender"])
def test_ctrl_c_leaves_a_policy_and_a_run_that_ends_all_the_same(name, uninterrupted, tmp_path, monkeypatch, capsys):
    _, expected, _ = uninterrupted(name)
    path, steps = tmp_path / "run", 0
    program = begun(path, name)

    def interrupted(self):
        nonlocal steps
        steps += 1
        if steps == 60:
            raise KeyboardInterrupt
        return True

    with monkeypatch.context() as patch:
        patch.setattr(watch.Watch, "_on_step", interrupted)
        assert resume(program, path) == 130
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("interrupted after")
    assert line.endswith(f"go on with: spoofgym train {name} --resume --out {path}")
    {"spoofer": LearnedSpoofer, "defender": LearnedDefender}[name].load(path)
    assert resume(program, path) == 0
    assert result(path) == expected


def test_a_resumed_run_does_not_depend_on_what_came_before_its_checkpoint(uninterrupted, tmp_path):
    """Where the first leg has ended, the random numbers of the process do not matter any more."""
    torch.manual_seed(9)
    np.random.seed(9)  # noqa: NPY002 - the generator that Stable-Baselines3 draws from
    _, expected, _ = uninterrupted("expected")
    path = tmp_path / "run"
    program = begun(path, "expected")
    assert resume(program, path) == 0
    assert result(path) == expected


# --- options beside --resume ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("spoofer", ["--steps", "700"], "--steps 700 was given, the run has 240"),
        ("spoofer", ["--scenario", "liu-flight"], "--scenario liu-flight was given, the run has liu-flight:horizon=12"),
        ("spoofer", ["--detector", "snapshot"], "--detector snapshot was given, the run has windowed:n=5,threshold=45"),
        ("spoofer", ["--seed", "0"], "--seed 0 was given, the run has 3"),
        ("spoofer", ["--frames", "2"], "--frames 2 was given, the run has 1"),
        ("spoofer", ["--shadow", "liu-flight"], "--shadow liu-flight was given, the run has None"),
        ("spoofer", ["--knowledge", "full"], "--knowledge full was given, the run has shadow"),
        ("spoofer", ["--action", "innovation"], "--action innovation was given, the run has rate"),
        ("spoofer", ["--fidelity", "strapdown"], "--fidelity strapdown was given, the run has linear"),
        ("defender", ["--steps", "900"], "--steps 900 was given, the run has 240"),
        ("defender", ["--scenario", "foi-drive"], "--scenario foi-drive was given, the run has foi-drive:horizon=40"),
        ("defender", ["--detector", "windowed"], "--detector windowed was given, the run has snapshot"),
        ("defender", ["--lanes", "256"], "--lanes 256 was given, the run has 3"),
        ("defender", ["--imitate", "true"], "--imitate true was given, the run has false"),
    ],
)
def test_an_option_that_contradicts_a_run_is_refused_by_name(name, options, message, tmp_path, capsys):
    """A default that is given is given, too."""
    program = begun(tmp_path / "run", name)
    before = (tmp_path / "run" / CONFIG_FILE).read_bytes()
    assert resume(program, tmp_path / "run", *options) == 2
    assert capsys.readouterr().err == f"error: a resumed run keeps its settings: {message}\n"
    assert [file.name for file in (tmp_path / "run").iterdir()] == [CONFIG_FILE]
    assert (tmp_path / "run" / CONFIG_FILE).read_bytes() == before


@pytest.mark.parametrize("name", ["spoofer", "defender"])
def test_options_that_agree_with_a_run_are_accepted(name, uninterrupted, tmp_path):
    _, expected, _ = uninterrupted(name)
    path = tmp_path / "run"
    program = begun(path, name)
    run = PROGRAMS[name][1]
    options = ["--scenario", run.environment.scenario, "--steps", str(run.steps), "--seed", str(run.seed)]
    assert resume(program, path, *options, "--threads", "1") == 0
    assert result(path) == expected


@pytest.mark.parametrize("name", ["spoofer", "defender"])
def test_a_run_that_has_ended_is_lengthened_by_name_only(name, uninterrupted, tmp_path, capsys):
    made, expected, _ = uninterrupted(name)
    path = tmp_path / "run"
    shutil.copytree(made, path)
    program, run = PROGRAMS[name]
    assert resume(program, path) == 2
    assert "steps already: give more than that by --steps" in capsys.readouterr().err
    assert result(path) == expected
    assert resume(program, path, "--steps", str(3 * run.steps)) == 0
    assert json.loads((path / CONFIG_FILE).read_text())["steps"] == 3 * run.steps
    played = torch.load(path / CHECKPOINT_FILE, weights_only=True)["played"]
    assert 3 * run.steps <= played < 3 * run.steps + 4 * 60
    assert result(path)[CHECKPOINT_FILE] != expected[CHECKPOINT_FILE]


@pytest.mark.parametrize(
    ("option", "value", "valid"),
    [("--seed", "4294967296", "from 0 to 4294967295"), ("--steps", "1e30", "1,000,000,000,000 or less")],
)
@pytest.mark.parametrize("program", [spoofer, defender])
def test_a_seed_or_a_length_that_no_training_takes_is_refused(program, option, value, valid, tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        program.main([option, value, "--out", str(tmp_path / "run")])
    assert ended.value.code == 2
    assert f"{option}: expected a whole number" in (line := capsys.readouterr().err)
    assert f"{valid}, got '{value}'" in line


@pytest.mark.parametrize("name", ["spoofer", "defender"])
def test_the_largest_seed_trains(name, tmp_path):
    program, run = PROGRAMS[name]
    RunFolder(tmp_path / "run", "train.x", *TYPES[program]).begin(replace(run, seed=2**32 - 1, steps=1))
    assert resume(program, tmp_path / "run") == 0


@pytest.mark.parametrize("program", [spoofer, defender])
def test_where_no_run_is_there_is_none_to_resume(program, tmp_path, capsys):
    assert resume(program, tmp_path / "nowhere") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f"error: {tmp_path / 'nowhere'} holds no run to resume: it has no config.json"
    assert list(tmp_path.iterdir()) == []


def test_the_run_of_the_other_player_is_not_resumed(tmp_path, capsys):
    begun(tmp_path / "run", "spoofer")
    assert resume(defender, tmp_path / "run") == 2
    assert capsys.readouterr().err == f"error: {tmp_path / 'run'} is the run folder of a spoofer, not of a defender\n"


# --- as a process -----------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_process_that_is_killed_goes_on(uninterrupted, tmp_path, child):
    """SIGKILL as soon as there is a checkpoint."""
    _, expected, _ = uninterrupted("defender")
    path = tmp_path / "run"
    program = begun(path, "defender")
    process = child([sys.executable, "-m", "spoofgym", "train", "defender", "--resume", "--out", str(path)])
    deadline = time.monotonic() + 300
    while not (path / CHECKPOINT_FILE).exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=60)
    if result(path) != expected:
        assert resume(program, path) == 0
    assert result(path) == expected


def test_the_console_of_a_training_is_quiet_where_it_is_no_terminal(tmp_path, capsys):
    path = tmp_path / "run"
    program = begun(path, "expected")
    assert resume(program, path) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("trained ")
    assert Console(stderr=True).is_terminal is False
