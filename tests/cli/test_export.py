"""A zip that Stable-Baselines3 has saved becomes a policy folder that plays as the model does."""

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import PPO
from torch import nn

from spoofgym.cli.export import main
from spoofgym.policies.learned import LearnedSpoofer

FLIGHT = "liu-flight:horizon=8"


def model(**policy):
    environment = gym.make("spoofgym/Spoofer-v0", scenario=FLIGHT, knowledge="blind")
    return PPO("MlpPolicy", environment, n_steps=8, batch_size=8, seed=3, device="cpu", policy_kwargs=policy)


def test_a_zip_plays_as_its_model(tmp_path, capsys):
    mine = model(net_arch=[8, 8])
    mine.save(tmp_path / "mine.zip")
    given = [str(tmp_path / "mine.zip"), str(tmp_path / "out"), "--scenario", FLIGHT, "--knowledge", "blind"]
    assert main(given) == 0
    assert f"use it as policy:{tmp_path / 'out'}" in capsys.readouterr().out
    seen = np.random.default_rng(0).normal(size=(5, *mine.observation_space.shape)).astype(np.float32)
    expected, _ = mine.predict(seen, deterministic=True)
    found = np.clip(LearnedSpoofer.load(tmp_path / "out").act(seen), mine.action_space.low, mine.action_space.high)
    np.testing.assert_allclose(found, expected, atol=1e-5)
    assert main(given) == 2
    assert "exists already" in capsys.readouterr().err


def test_what_does_not_fit_is_told_and_nothing_is_left(tmp_path, capsys):
    model(net_arch=[8]).save(tmp_path / "mine.zip")
    model(activation_fn=nn.ReLU, net_arch=[8]).save(tmp_path / "relu.zip")
    (tmp_path / "broken.zip").write_bytes(b"no zip")
    out = str(tmp_path / "out")
    for given, words in (
        (["mine.zip", "--scenario", FLIGHT], "name the scenario, detector and knowledge of its training"),
        (["relu.zip", "--scenario", FLIGHT, "--knowledge", "blind"], "only an MlpPolicy of tanh layers"),
        (["broken.zip"], "broken.zip is damaged"),
        (["nowhere.zip"], "nowhere.zip is no file"),
        (["run", "--knowledge", "blind"], "--knowledge is of a zip of Stable-Baselines3"),
    ):
        assert main([str(tmp_path / given[0]), out, *given[1:]]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert words in line
        assert not (tmp_path / "out").exists()


def test_help_warns_of_the_zips_of_others(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    assert "never take somebody else's" in " ".join(capsys.readouterr().out.split())
