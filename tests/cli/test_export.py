"""A zip that Stable-Baselines3 has saved becomes a policy folder that plays as the model does, and runs nothing."""

import base64
import io
import json
import pickle
import zipfile
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from torch import nn

from spoofgym.cli.export import main
from spoofgym.evaluation.agent_scores import agent_scores
from spoofgym.policies.learned import LearnedSpoofer, load_policy

FLIGHT = "liu-flight:horizon=30"
TRAINED = {
    "Spoofer-v0": ({"knowledge": "blind"}, ["--knowledge", "blind"]),
    "Defender-v0": (
        {"attacks": "ramp:1", "detectors": ("snapshot", "windowed:n=5,threshold=35")},
        ["--attacks", "ramp:1", "--detector", "snapshot", "--detector", "windowed:n=5,threshold=35"],
    ),
    "DuelSpoofer-v0": (
        {"defender": "exclude:reuse=5", "detectors": "snapshot", "knowledge": "full"},
        ["--defender", "exclude:reuse=5", "--detector", "snapshot", "--knowledge", "full"],
    ),
    "DuelDefender-v0": (
        {"spoofer": "ramp:1", "detectors": "snapshot", "clean": 0.25},
        ["--spoofer", "ramp:1", "--detector", "snapshot", "--clean", "0.25"],
    ),
}
"""Arguments of each environment, and the options that say so."""


def model(name="Spoofer-v0", **policy):
    environment = gym.make(f"spoofgym/{name}", scenario=FLIGHT, **TRAINED[name][0])
    return PPO("MlpPolicy", environment, n_steps=8, batch_size=8, seed=3, device="cpu", policy_kwargs=policy)


def export(folder, zipped, name="Spoofer-v0"):
    options = ["--environment", name, "--scenario", FLIGHT, *TRAINED[name][1]]
    return main([str(folder / zipped), str(folder / "out"), *options])


@pytest.mark.parametrize("name", TRAINED)
def test_a_zip_plays_as_its_model(name, tmp_path, capsys):
    mine = model(name, net_arch={"pi": [8, 6], "vf": [4]})
    mine.save(tmp_path / "mine.zip")
    assert export(tmp_path, "mine.zip", name) == 0
    assert f"use it as policy:{tmp_path / 'out'}" in capsys.readouterr().out
    policy = load_policy(tmp_path / "out")
    seen = np.random.default_rng(0).normal(size=(50, *mine.observation_space.shape)).astype(np.float32)
    expected, _ = mine.predict(seen, deterministic=True)
    found = policy.act(seen)
    if isinstance(policy, LearnedSpoofer):
        np.testing.assert_allclose(found, expected, atol=1e-5)
    else:
        np.testing.assert_array_equal(found, expected)
        assert len(np.unique(found[:, 1])) > 1
    assert agent_scores(policy, 2, 0)
    assert export(tmp_path, "mine.zip", name) == 2
    assert "exists already" in capsys.readouterr().err


def test_what_a_zip_does_not_say_is_told(tmp_path, capsys):
    environment = gym.make("spoofgym/Spoofer-v0")
    PPO("MlpPolicy", environment, n_steps=8, batch_size=8, seed=3, device="cpu").save(tmp_path / "mine.zip")
    assert main([str(tmp_path / "mine.zip"), str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out.replace("\n", " ")
    assert "taken as trained on Spoofer-v0 with scenario=liu-flight: name the --scenario if it was another" in told


def rewritten(source, target, **parts):
    """A copy of a zip with other parts in it."""
    with zipfile.ZipFile(source) as read, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as write:
        for name in {*read.namelist(), *parts}:
            write.writestr(name, parts.get(name, read.read(name) if name in read.namelist() else b""))


class Evil:
    """Whoever unpickles it makes a file."""

    def __init__(self, path):
        self._path = path

    def __reduce__(self):
        return Path.touch, (self._path,)


def test_nothing_of_a_stranger_is_run(tmp_path, capsys):
    """Pickles in the text stay unread; weights that hold one are refused."""
    model(net_arch=[8]).save(tmp_path / "mine.zip")
    mark = tmp_path / "mark"
    evil = pickle.dumps(Evil(mark))
    about = json.loads(zipfile.ZipFile(tmp_path / "mine.zip").read("data"))
    for value in about.values():
        if isinstance(value, dict) and ":serialized:" in value:
            value[":serialized:"] = base64.b64encode(evil).decode()
    rewritten(tmp_path / "mine.zip", tmp_path / "text.zip", data=json.dumps(about))
    assert export(tmp_path, "text.zip") == 0
    weights = io.BytesIO()
    torch.save({"action_net.weight": Evil(mark)}, weights)
    rewritten(tmp_path / "mine.zip", tmp_path / "weights.zip", **{"policy.pth": weights.getvalue()})
    rewritten(tmp_path / "mine.zip", tmp_path / "plain.zip", **{"policy.pth": evil})
    for name in ("weights.zip", "plain.zip"):
        out = tmp_path / name.removesuffix(".zip")
        assert main([str(tmp_path / name), str(out), "--scenario", FLIGHT, "--knowledge", "blind"]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"error: {tmp_path / name} is damaged")
        assert not out.exists()
    assert not mark.exists()


def test_what_does_not_fit_is_told_and_nothing_is_left(tmp_path, capsys):
    model(net_arch=[8]).save(tmp_path / "mine.zip")
    model(activation_fn=nn.ReLU, net_arch=[8]).save(tmp_path / "relu.zip")
    (tmp_path / "broken.zip").write_bytes(b"no zip")
    with zipfile.ZipFile(tmp_path / "empty.zip", "w"):
        pass
    rewritten(tmp_path / "mine.zip", tmp_path / "bomb.zip", data=b" " * (17 * 2**20))
    weights = torch.load(io.BytesIO(zipfile.ZipFile(tmp_path / "mine.zip").read("policy.pth")), weights_only=True)
    changes = {
        "shape": {"action_net.weight": torch.zeros(3, 5)},
        "nan": {"action_net.bias": torch.full((3,), float("nan"))},
        "cnn": {"features_extractor.cnn.0.weight": torch.zeros(3)},
    }
    for name, change in changes.items():
        packed = io.BytesIO()
        torch.save({**weights, **change}, packed)
        rewritten(tmp_path / "mine.zip", tmp_path / f"{name}.zip", **{"policy.pth": packed.getvalue()})
    blind = ["--scenario", FLIGHT, "--knowledge", "blind"]
    for given, words in (
        (["mine.zip", "--scenario", FLIGHT], "name the environment, and the scenario, detectors and knowledge"),
        (["mine.zip", *blind[:2], "--environment", "Defender-v0", "--detector", "snapshot"], "Defender-v0 shows"),
        (["mine.zip", *blind, "--attacks", "ramp:1"], "Spoofer-v0: unknown argument 'attacks'"),
        (["relu.zip", *blind], "only an MlpPolicy of tanh layers"),
        (["cnn.zip", *blind], "this one has features_extractor.cnn.0.weight"),
        (["shape.zip", *blind], "shape.zip is damaged: weight_1 has shape (3, 5)"),
        (["nan.zip", *blind], "nan.zip is damaged: bias_1 must hold finite numbers"),
        (["broken.zip"], "broken.zip is damaged"),
        (["empty.zip"], "empty.zip is damaged: no zip of Stable-Baselines3: it holds no data"),
        (["bomb.zip"], "bomb.zip is damaged: data unpacks to 17825792 bytes"),
        (["nowhere.zip"], "nowhere.zip is no file"),
        (["run", "--knowledge", "blind"], "--knowledge is of a zip of Stable-Baselines3"),
        (["run", "--environment", "Defender-v0"], "--environment is of a zip of Stable-Baselines3"),
    ):
        assert main([str(tmp_path / given[0]), str(tmp_path / "none"), *given[1:]]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert words in line
        assert not (tmp_path / "none").exists()


def test_help_says_what_is_read_of_a_zip(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    assert "Nothing that is pickled in the zip is read" in " ".join(capsys.readouterr().out.split())
