"""Learned policies: the NumPy network equals torch's, files hold arrays only, damage is told."""

import itertools
import json

import numpy as np
import pytest
import torch

from agents.learned import CONFIG_FILE, POLICY_FILE, LearnedSpoofer
from spoofgym.envs.config import SpooferConfig
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
    with pytest.raises(ValueError, match="damaged run folder"):
        LearnedSpoofer.load(folder)
