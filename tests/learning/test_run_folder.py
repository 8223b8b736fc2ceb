"""Runs that are killed, resumed, contradicted and damaged: they end as if nothing had happened, or say why not.

A kill is an exception that nothing catches, raised at a write: the files are then what a killed process leaves.
"""

import json
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from dataclasses import replace

import numpy as np
import pytest
import torch
from rich.console import Console

from spoofgym import files
from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.learning import defender, defender_ppo, ppo, spoofer, watch
from spoofgym.learning.run_folder import CHECKPOINT_FILE, Run, RunFolder
from spoofgym.policies.learned import CONFIG_FILE, LearnedDefender, LearnedSpoofer

pytestmark = pytest.mark.xdist_group("run folders")  # one worker: the uninterrupted runs are made once

SPOOFER = Run(
    SpooferConfig(scenario="liu-flight:horizon=12", detector="windowed:n=5,threshold=45"),
    ppo.Settings(lanes=4, trials=2, epochs=2, hidden=8),
    3,
    240,
)
"""Games that an alarm ends, so that lanes are in mid-game where a rollout ends."""
EXPECTED = replace(SPOOFER, environment=SpooferConfig(scenario="liu-flight:horizon=12"))
DEFENDER = Run(
    DefenderConfig(scenario="foi-drive:horizon=40", detectors=("snapshot",)),
    defender_ppo.Settings(lanes=3, epochs=2, hidden=8, imitate=False, validation_episodes=6),
    4,
    360,
)
PROGRAMS = {"spoofer": (spoofer, SPOOFER), "expected": (spoofer, EXPECTED), "defender": (defender, DEFENDER)}
TYPES = {spoofer: (SpooferConfig, ppo.Settings), defender: (DefenderConfig, defender_ppo.Settings)}


class Killed(BaseException):
    """The process ends here."""


def begun(path, name):
    """A run folder just after its start."""
    program, run = PROGRAMS[name]
    RunFolder(path, "train.x", *TYPES[program]).begin(run)
    return program


def resume(program, path, *options):
    return program.main(["--resume", "--out", str(path), *options])


def result(path):
    """All that a run leaves, but for logs: by name."""
    found = {file.name: file.read_bytes() for file in path.iterdir() if file.is_file()}
    found[CHECKPOINT_FILE] = repr(torch.load(path / CHECKPOINT_FILE, weights_only=True))
    return found


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """The results of runs that nothing stopped, and the number of files that each wrote."""
    made = {}

    def make(name):
        if name not in made:
            path = tmp_path_factory.mktemp("runs") / "run"
            program, writes, real = begun(path, name), [], files.write_bytes
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(files, "write_bytes", lambda *given: (writes.append(given[0]), real(*given)))
                assert resume(program, path) == 0
            made[name] = path, result(path), len(writes)
        return made[name]

    return make


@pytest.mark.slow
@pytest.mark.parametrize("name", ["spoofer", "defender"])
def test_a_run_killed_at_any_write_ends_as_if_it_had_not_been(name, uninterrupted, tmp_path, monkeypatch):
    """Before the file has its name: half of it lies there as a draft."""
    _, expected, writes = uninterrupted(name)
    real = files.write_bytes
    for write in range(1, writes + 1):
        path, count = tmp_path / str(write) / "run", 0
        path.parent.mkdir()

        def dying(target, content, path=path, write=write):
            nonlocal count
            count += 1
            if count == write:
                (path / f".kill{files.DRAFT}").write_bytes(content[: len(content) // 2])
                raise Killed
            real(target, content)

        program = begun(path, name)
        with monkeypatch.context() as patch:
            patch.setattr(files, "write_bytes", dying)
            with pytest.raises(Killed):
                resume(program, path)
        assert resume(program, path) == 0
        assert result(path) == expected, f"killed at write {write} of {writes}"


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
        left = 4 + kills
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
    assert line.endswith(f"go on with: python -m spoofgym.learning.{name} --resume --out {path}")
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
        ("defender", ["--steps", "900"], "--steps 900 was given, the run has 360"),
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


# --- damage -----------------------------------------------------------------------------------------------------------


def truncated(content):
    return content[: len(content) // 2]


def flipped(content):
    middle = len(content) // 2
    return content[:middle] + bytes(byte ^ 0xFF for byte in content[middle : middle + 40]) + content[middle + 40 :]


BYTES = {
    "truncated": truncated,
    "flipped": flipped,
    "empty": lambda content: b"",
    "text": lambda content: b"this is no run\n",
    "zeros": lambda content: bytes(len(content)),
    "other": lambda content: b"\x80\x04\x95",
    "null": lambda content: b"null",
}


@pytest.mark.parametrize("name", ["spoofer", "defender"])
@pytest.mark.parametrize("file", [CONFIG_FILE, CHECKPOINT_FILE])
@pytest.mark.parametrize("damage", BYTES)
def test_a_damaged_file_is_named_in_one_line(name, file, damage, uninterrupted, tmp_path, capsys):
    made, _, _ = uninterrupted(name)
    path = tmp_path / "run"
    shutil.copytree(made, path)
    (path / file).write_bytes(BYTES[damage]((path / file).read_bytes()))
    capsys.readouterr()
    assert resume(PROGRAMS[name][0], path, "--steps", "5000") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"error: {path / file} is damaged: ")


def changed_config(*keys, value):
    def change(content):
        inner = content
        for key in keys[:-1]:
            inner = inner[key]
        inner[keys[-1]] = value

    return change


@pytest.mark.parametrize(
    "change",
    [
        changed_config("learner", "lanes", value=10**12),
        changed_config("learner", "lanes", value="many"),
        changed_config("learner", "lanes", value=2.5),
        changed_config("learner", "hidden", value=10**9),
        changed_config("learner", "minibatches", value=0),
        changed_config("learner", "learning_rate", value=float("nan")),
        changed_config("learner", value=[]),
        changed_config("learner", "colour", value=1),
        changed_config("environment", "scenario", value=5),
        changed_config("environment", "scenario", value=["foi-drive"]),
        changed_config("environment", "threads", value=10**9),
        changed_config("environment", "threads", value="x"),
        changed_config("environment", value=None),
        changed_config("seed", value=-1),
        changed_config("seed", value=True),
        changed_config("seed", value=2**32),
        changed_config("steps", value=0),
        changed_config("steps", value=1e99),
        changed_config("steps", value=10**13),
        lambda content: content.pop("steps"),
        lambda content: content["learner"].pop("epochs"),
    ],
)
@pytest.mark.parametrize("name", ["spoofer", "defender"])
def test_a_config_that_says_nonsense_is_named_in_one_line(name, change, tmp_path, capsys):
    path = tmp_path / "run"
    program = begun(path, name)
    content = json.loads((path / CONFIG_FILE).read_text())
    change(content)
    (path / CONFIG_FILE).write_text(json.dumps(content))
    assert resume(program, path) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"error: {path / CONFIG_FILE} is damaged: ")


@pytest.mark.parametrize(
    ("name", "key", "value", "reason"),
    [
        ("spoofer", "scenario", "foo", "unknown scenario 'foo'"),
        ("spoofer", "scenario", "recorded:/nowhere", "/nowhere"),
        ("spoofer", "detector", "foo", "unknown detector 'foo'"),
        ("spoofer", "shadow", "foo", "unknown scenario 'foo'"),
        ("defender", "scenario", "foi-drive:colour=red", "colour"),
        ("defender", "detectors", ["snapshot", "foo"], "unknown detector 'foo'"),
        ("defender", "attacks", "foo", "unknown attack"),
    ],
)
def test_a_part_of_a_run_that_cannot_be_built_is_told_with_its_file(name, key, value, reason, tmp_path, capsys):
    path = tmp_path / "run"
    program = begun(path, name)
    content = json.loads((path / CONFIG_FILE).read_text())
    content["environment"][key] = value
    (path / CONFIG_FILE).write_text(json.dumps(content))
    assert resume(program, path) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"error: {path / CONFIG_FILE}: ")
    assert reason in line


@pytest.mark.parametrize("program", [spoofer, defender])
def test_a_part_of_a_new_run_that_cannot_be_built_has_no_file(program, tmp_path, capsys):
    assert program.main(["--scenario", "foo", "--out", str(tmp_path / "run")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "unknown scenario 'foo'" in line
    assert CONFIG_FILE not in line


def of_learner(key, change):
    def act(state):
        state["learner"][key] = change(state["learner"][key])

    return act


def nan_in(tensors):
    first = next(iter(tensors))
    return {**tensors, first: torch.full_like(tensors[first], float("nan"))}


def wider(tensors):
    return {name: torch.cat([tensor, tensor]) for name, tensor in tensors.items()}


STATES = {
    "no learner": lambda state: state.pop("learner"),
    "learner none": lambda state: state.update(learner=None),
    "learner text": lambda state: state.update(learner="x"),
    "NaN weights": of_learner("weights", nan_in),
    "other shapes": of_learner("weights", wider),
    "other names": of_learner("weights", lambda tensors: {f"x{name}": value for name, value in tensors.items()}),
    "other types": of_learner("weights", lambda tensors: {name: value.double() for name, value in tensors.items()}),
    "numbers": of_learner("weights", lambda tensors: {name: 1.0 for name in tensors}),
    "steps": of_learner("steps", lambda steps: "many"),
    "negative": of_learner("steps", lambda steps: -1),
    "games": of_learner("games", lambda games: games[:, :1]),
    "games NaN": of_learner("games", lambda games: games * float("nan")),
    "moments": of_learner("moments", lambda moments: {name: {} for name in moments}),
    "moments of none": of_learner("moments", lambda moments: {"nobody": {}}),
    "moments list": of_learner("moments", lambda moments: []),
    "played": lambda state: state.update(played="x"),
    "finished": lambda state: state.pop("finished"),
}


@pytest.mark.parametrize("damage", STATES)
@pytest.mark.parametrize("name", ["spoofer", "defender"])
def test_a_checkpoint_of_another_form_is_named_in_one_line(name, damage, uninterrupted, tmp_path, capsys):
    made, _, _ = uninterrupted(name)
    path = tmp_path / "run"
    shutil.copytree(made, path)
    state = torch.load(path / CHECKPOINT_FILE, weights_only=True)
    STATES[damage](state)
    torch.save(state, path / CHECKPOINT_FILE)
    capsys.readouterr()
    assert resume(PROGRAMS[name][0], path, "--steps", "5000") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"error: {path / CHECKPOINT_FILE} is damaged: ")


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("spoofer", {"trial": 9}),
        ("spoofer", {"best_trial": 2}),
        ("spoofer", {"before": -3}),
        ("spoofer", {"best": {}}),
        ("defender", {"validation": []}),
        ("defender", {"validation": [{"steps": 0, "mean_error_m": float("nan")}]}),
        ("defender", {"validation": 3}),
        ("defender", {"best": []}),
        ("defender", {"best": [[torch.zeros(2, 2), torch.zeros(2)]]}),
    ],
)
def test_a_checkpoint_of_another_place_is_named_in_one_line(name, change, uninterrupted, tmp_path, capsys):
    made, _, _ = uninterrupted(name)
    path = tmp_path / "run"
    shutil.copytree(made, path)
    state = torch.load(path / CHECKPOINT_FILE, weights_only=True)
    torch.save({**state, **change}, path / CHECKPOINT_FILE)
    capsys.readouterr()
    assert resume(PROGRAMS[name][0], path, "--steps", "5000") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"error: {path / CHECKPOINT_FILE} is damaged: ")


class Stranger:
    """What a pickle can do where it is loaded."""

    def __reduce__(self):
        return (open, ("opened-by-a-stranger", "w"))


def test_nothing_of_a_stranger_is_unpickled(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "run"
    program = begun(path, "spoofer")
    torch.save({"learner": Stranger(), "played": 0, "finished": 0}, path / CHECKPOINT_FILE)
    assert resume(program, path) == 2
    assert f"{path / CHECKPOINT_FILE} is damaged" in capsys.readouterr().err
    assert not (tmp_path / "opened-by-a-stranger").exists()


def test_a_checkpoint_that_unpacks_to_any_size_is_refused(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("spoofgym.learning.checkpoint.LARGEST", 10**6)
    path = tmp_path / "run"
    program = begun(path, "spoofer")
    with zipfile.ZipFile(path / CHECKPOINT_FILE, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("checkpoint/data.pkl", bytes(10**7))
    assert (path / CHECKPOINT_FILE).stat().st_size < 10**5
    assert resume(program, path) == 2
    assert "it unpacks to 10000000 bytes" in capsys.readouterr().err


# --- as a process -----------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_process_that_is_killed_goes_on(uninterrupted, tmp_path):
    """SIGKILL before the first checkpoint, and as soon as there is one."""
    _, expected, _ = uninterrupted("spoofer")
    path = tmp_path / "run"
    begun(path, "spoofer")
    command = [sys.executable, "-m", "spoofgym.learning.spoofer", "--resume", "--out", str(path)]
    for awaited in (CONFIG_FILE, CHECKPOINT_FILE):
        process = subprocess.Popen(command, stderr=subprocess.PIPE)
        deadline = time.monotonic() + 300
        while not (path / awaited).exists() and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=60)
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 or "steps already" in done.stderr
    assert result(path) == expected


def test_the_console_of_a_training_is_quiet_where_it_is_no_terminal(tmp_path, capsys):
    path = tmp_path / "run"
    program = begun(path, "expected")
    assert resume(program, path) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("trained ")
    assert Console(stderr=True).is_terminal is False
