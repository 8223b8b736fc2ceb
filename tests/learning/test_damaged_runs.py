"""A run folder whose files are damaged, contradict one another or come from a stranger is refused in one line."""

import json
import shutil
import zipfile

import pytest
import torch

from spoofgym.learning import defender, spoofer
from spoofgym.learning.run_folder import CHECKPOINT_FILE
from spoofgym.policies.learned import CONFIG_FILE
from tests.learning.runs import PROGRAMS, begun, resume

pytestmark = pytest.mark.xdist_group("run folders")  # one worker: the uninterrupted runs are made once


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
