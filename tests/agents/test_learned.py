"""Learned policies: the NumPy network equals torch's, files hold arrays only, damage is told."""

import itertools
import json

import numpy as np
import pytest
import torch
from stable_baselines3.common.distributions import MultiCategoricalDistribution

from agents.learned import CONFIG_FILE, POLICY_FILE, LearnedDefender, LearnedSpoofer
from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.envs.observation import spoofer_fields

FIELDS = spoofer_fields("shadow", 3, ("snapshot",))


@pytest.fixture
def policy():
    rng = np.random.default_rng(0)
    sizes = [len(FIELDS), 16, 16, 3]
    weights = tuple(rng.normal(size=(b, a)).astype(np.float32) for a, b in itertools.pairwise(sizes))
    biases = tuple(rng.normal(size=b).astype(np.float32) for b in sizes[1:])
    return LearnedSpoofer("x", SpooferConfig(), tuple(field.name for field in FIELDS), weights, biases)


@pytest.fixture
def folder(policy, tmp_path):
    policy.save(tmp_path)
    (tmp_path / CONFIG_FILE).write_text(json.dumps({"environment": {"knowledge": "shadow"}}))
    return tmp_path


def test_network_equals_torch(policy):
    layers = []
    for weight, bias in zip(policy.weights, policy.biases, strict=True):
        layer = torch.nn.Linear(weight.shape[1], weight.shape[0])
        layer.weight.data, layer.bias.data = torch.from_numpy(weight), torch.from_numpy(bias)
        layers += [layer, torch.nn.Tanh()]
    network = torch.nn.Sequential(*layers[:-1])
    observation = np.random.default_rng(1).uniform(-1, 1, (5, len(FIELDS))).astype(np.float32)
    with torch.no_grad():
        expected = network(torch.from_numpy(observation)).clamp(-1, 1).numpy()
    np.testing.assert_allclose(policy.act(observation), expected, atol=1e-5)
    assert np.abs(expected).max() == 1.0


def test_a_saved_policy_comes_back(policy, folder):
    loaded = LearnedSpoofer.load(folder)
    assert loaded.name == folder.name
    assert loaded.layout == policy.layout
    observation = np.zeros((1, len(FIELDS)), dtype=np.float32)
    np.testing.assert_array_equal(loaded.act(observation), policy.act(observation))


def test_another_observation_is_refused(policy):
    policy.check_layout(FIELDS)
    with pytest.raises(ValueError, match=r"policy 'x' was trained for another observation: entry 8 was 'mean whitened"):
        policy.check_layout(spoofer_fields("blind", 3, ("snapshot",)))
    with pytest.raises(ValueError, match=r"entry 20 was None and is 'whitened innovation"):
        policy.check_layout(spoofer_fields("full", 3, ("snapshot",)))


def test_a_pickle_is_never_loaded(folder):
    with (folder / POLICY_FILE).open("wb") as file:
        np.savez(file, layout=np.array(["a"], dtype=object), weight_0=np.ones((1, 1)), bias_0=np.ones(1))
    with pytest.raises(ValueError, match="allow_pickle=False"):
        LearnedSpoofer.load(folder)


def test_no_run_folder(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"is no run folder: it has no policy.npz"):
        LearnedSpoofer.load(tmp_path)


@pytest.mark.parametrize("content", ["{", "{}", '{"environment": {"colour": 1}}'])
def test_damaged_config(folder, content):
    (folder / CONFIG_FILE).write_text(content)
    with pytest.raises(ValueError, match=r"config\.json is damaged: "):
        LearnedSpoofer.load(folder)


# --- the defender -----------------------------------------------------------------------------------------------------

DEPTHS = 5


@pytest.fixture
def defender():
    rng = np.random.default_rng(2)
    sizes = [7, 16, 16, 2 + DEPTHS]
    weights = tuple(rng.normal(size=(b, a)).astype(np.float32) for a, b in itertools.pairwise(sizes))
    biases = tuple(rng.normal(size=b).astype(np.float32) for b in sizes[1:])
    layout = tuple(f"entry {i}" for i in range(7))
    return LearnedDefender("d", DefenderConfig(scenario="foi-drive:horizon=60"), layout, weights, biases)


def test_a_defender_plays_the_likeliest_action(defender):
    """As a MultiDiscrete distribution with torch's logits would: the largest of the first two, and of the others."""
    layers = []
    for weight, bias in zip(defender.weights, defender.biases, strict=True):
        layer = torch.nn.Linear(weight.shape[1], weight.shape[0])
        layer.weight.data, layer.bias.data = torch.from_numpy(weight), torch.from_numpy(bias)
        layers += [layer, torch.nn.Tanh()]
    network = torch.nn.Sequential(*layers[:-1])
    observation = np.random.default_rng(3).uniform(-1, 1, (200, 7)).astype(np.float32)
    distribution = MultiCategoricalDistribution([2, DEPTHS])
    with torch.no_grad():
        expected = distribution.proba_distribution(network(torch.from_numpy(observation))).mode().numpy()
    actions = defender.act(observation)
    assert actions.dtype == np.int64
    np.testing.assert_array_equal(actions, expected)
    assert set(actions[:, 0]) == {0, 1}
    assert len(set(actions[:, 1])) > 2


def test_a_defender_of_ranges_plays_the_likeliest_choice_of_each_satellite(defender):
    """Three slots by its layout, so that of 13 outputs 5 are of the depth."""
    rng = np.random.default_rng(5)
    layout = (*(f"entry {i}" for i in range(4)), *(f"satellite in slot {i}" for i in range(3)))
    weights = (*defender.weights[:-1], rng.normal(size=(13, 16)).astype(np.float32))
    biases = (*defender.biases[:-1], rng.normal(size=13).astype(np.float32))
    policy = LearnedDefender("r", defender.config, layout, weights, biases)
    assert (policy.slots, policy.depths) == (3, DEPTHS)
    observation = rng.uniform(-1, 1, (200, 7)).astype(np.float32)
    distribution = MultiCategoricalDistribution([2, DEPTHS, 2, 2, 2])
    logits = torch.from_numpy(policy.outputs(observation))
    actions = policy.act(observation)
    np.testing.assert_array_equal(actions, distribution.proba_distribution(logits).mode().numpy())
    assert (actions[:, 2:].min(axis=0) == 0).all()
    assert (actions[:, 2:].max(axis=0) == 1).all()


def test_a_saved_defender_comes_back(defender, tmp_path):
    defender.save(tmp_path)
    environment = {"scenario": "foi-drive:horizon=60", "detectors": ["snapshot"], "clean": 0.25}
    (tmp_path / CONFIG_FILE).write_text(json.dumps({"environment": environment}))
    loaded = LearnedDefender.load(tmp_path)
    assert loaded.config == DefenderConfig(scenario="foi-drive:horizon=60", detectors=["snapshot"], clean=0.25)
    observation = np.random.default_rng(4).uniform(-1, 1, (20, 7)).astype(np.float32)
    np.testing.assert_array_equal(loaded.act(observation), defender.act(observation))


def test_a_spoofers_run_folder_is_no_defenders(folder):
    with pytest.raises(ValueError, match="is the run folder of a spoofer, not of a defender"):
        LearnedDefender.load(folder)
