"""Learned policies: the NumPy network equals torch's, files hold arrays only, damage is told."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
import torch
from stable_baselines3.common.distributions import MultiCategoricalDistribution

from spoofgym.envs.observation import spoofer_fields
from spoofgym.policies.learned import CONFIG_FILE, POLICY_FILE, LearnedDefender, LearnedSpoofer, load_policy

FIELDS = spoofer_fields("shadow", 3, ("snapshot",))


def names(fields):
    return tuple(field.name for field in fields)


LAYOUT = names(FIELDS)


@pytest.fixture
def policy():
    rng = np.random.default_rng(0)
    sizes = [len(FIELDS), 16, 16, 3]
    weights = tuple(rng.normal(size=(b, a)).astype(np.float32) for a, b in itertools.pairwise(sizes))
    biases = tuple(rng.normal(size=b).astype(np.float32) for b in sizes[1:])
    return LearnedSpoofer(Path("x"), {"knowledge": "shadow"}, LAYOUT, weights, biases)


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
    policy.check_layout(LAYOUT)
    with pytest.raises(ValueError, match=r"policy 'x' was trained for another observation: entry 8 was 'mean whitened"):
        policy.check_layout(names(spoofer_fields("blind", 3, ("snapshot",))))
    with pytest.raises(ValueError, match=r"entry 20 was None and is 'whitened innovation"):
        policy.check_layout(names(spoofer_fields("full", 3, ("snapshot",))))


def test_a_pickle_is_never_loaded(folder):
    with (folder / POLICY_FILE).open("wb") as file:
        np.savez(file, layout=np.array(["a"], dtype=object), weight_0=np.ones((1, 1)), bias_0=np.ones(1))
    with pytest.raises(ValueError, match="allow_pickle=False"):
        LearnedSpoofer.load(folder)


def test_no_run_folder(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"is no run folder: it has no policy.npz"):
        LearnedSpoofer.load(tmp_path)


@pytest.mark.parametrize("content", ["{", "{}", '{"environment": {"colour": 1}}', '{"environment": {}}'])
def test_damaged_config(folder, content):
    (folder / CONFIG_FILE).write_text(content)
    with pytest.raises(ValueError, match=r"config\.json is damaged: "):
        LearnedSpoofer.load(folder)


BYTES = {
    "truncated": lambda content: content[: len(content) // 2],
    "one byte less": lambda content: content[:-1],
    "flipped": lambda content: content[:200] + bytes(byte ^ 0xFF for byte in content[200:240]) + content[240:],
    "empty": lambda content: b"",
    "text": lambda content: b"this is no policy\n",
    "zeros": lambda content: bytes(len(content)),
    "list": lambda content: b"[1, 2]",
    "deep": lambda content: b"[" * 100_000,
    "not UTF-8": lambda content: b'{"environment": "\xff"}',
}


@pytest.mark.parametrize("damage", BYTES)
@pytest.mark.parametrize("name", [CONFIG_FILE, POLICY_FILE])
def test_a_damaged_file_is_named(folder, name, damage):
    (folder / CONFIG_FILE).write_text(json.dumps({"environment": {"knowledge": "shadow"}, "seed": list(range(200))}))
    whole = (folder / name).read_bytes()
    (folder / name).write_bytes(BYTES[damage](whole))
    if (name, damage) == (CONFIG_FILE, "one byte less"):
        (folder / name).write_bytes(whole[:-1].rstrip(b"}"))
    with pytest.raises(ValueError, match="is damaged: ") as raised:
        LearnedSpoofer.load(folder)
    assert str(raised.value).startswith(str(folder / name))
    assert "\n" not in str(raised.value)


def without(name):
    return lambda arrays: {key: value for key, value in arrays.items() if key != name}


ARRAYS = {
    "no layout": without("layout"),
    "no weights": without("weight_1"),
    "no bias": without("bias_2"),
    "nothing": lambda arrays: {},
    "other keys": lambda arrays: {f"x{key}": value for key, value in arrays.items()},
    "one key more": lambda arrays: {**arrays, "extra": np.zeros(1)},
    "a layer that is not the next": lambda arrays: {**arrays, "weight_9": np.ones((3, 3)), "bias_9": np.ones(3)},
    "NaN": lambda arrays: {**arrays, "weight_0": np.full_like(arrays["weight_0"], np.nan)},
    "infinity": lambda arrays: {**arrays, "bias_0": np.full_like(arrays["bias_0"], np.inf)},
    "whole numbers": lambda arrays: {**arrays, "weight_0": arrays["weight_0"].astype(np.int64)},
    "complex": lambda arrays: {**arrays, "weight_0": arrays["weight_0"].astype(np.complex64)},
    "text": lambda arrays: {**arrays, "weight_0": arrays["weight_0"].astype(str)},
    "numbers as names": lambda arrays: {**arrays, "layout": np.arange(20)},
    "one name": lambda arrays: {**arrays, "layout": np.array("x")},
    "a name less": lambda arrays: {**arrays, "layout": arrays["layout"][1:]},
    "turned": lambda arrays: {**arrays, "weight_0": arrays["weight_0"].T},
    "flat": lambda arrays: {**arrays, "weight_0": arrays["weight_0"].ravel()},
    "a bias that is a matrix": lambda arrays: {**arrays, "bias_0": arrays["bias_0"][:, None]},
    "two outputs": lambda arrays: {**arrays, "weight_2": arrays["weight_2"][:2], "bias_2": arrays["bias_2"][:2]},
    "no outputs": lambda arrays: {**arrays, "weight_2": arrays["weight_2"][:0], "bias_2": arrays["bias_2"][:0]},
}


@pytest.mark.parametrize("damage", ARRAYS)
def test_a_policy_of_another_form_is_named(folder, damage):
    with np.load(folder / POLICY_FILE) as arrays:
        changed = ARRAYS[damage](dict(arrays))
    np.savez(folder / POLICY_FILE, **changed)
    with pytest.raises(ValueError, match=r"policy\.npz is damaged: ") as raised:
        LearnedSpoofer.load(folder)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("environment", [None, [], "liu-flight"])
def test_an_environment_that_is_no_mapping_is_named(folder, environment):
    (folder / CONFIG_FILE).write_text(json.dumps({"environment": environment}))
    with pytest.raises(ValueError, match=r"config\.json is damaged: "):
        LearnedSpoofer.load(folder)


def test_a_config_of_any_size_is_not_read(folder):
    (folder / CONFIG_FILE).write_text(json.dumps({"environment": {}, "more": "x" * 2**20}))
    with pytest.raises(ValueError, match=r"config\.json is damaged: it has more than 1048576 bytes"):
        LearnedSpoofer.load(folder)


def test_a_save_that_fails_leaves_the_policy_that_was_there(policy, folder, monkeypatch):
    def failing(*_):
        raise OSError(28, "No space left on device")

    before = (folder / POLICY_FILE).read_bytes()
    monkeypatch.setattr("spoofgym.files.os.fsync", failing)
    with pytest.raises(OSError, match="No space left"):
        policy.save(folder)
    assert (folder / POLICY_FILE).read_bytes() == before
    assert sorted(path.name for path in folder.iterdir()) == [CONFIG_FILE, POLICY_FILE]


# --- the defender -----------------------------------------------------------------------------------------------------

DEPTHS = 5


@pytest.fixture
def defender():
    rng = np.random.default_rng(2)
    sizes = [7, 16, 16, 2 + DEPTHS]
    weights = tuple(rng.normal(size=(b, a)).astype(np.float32) for a, b in itertools.pairwise(sizes))
    biases = tuple(rng.normal(size=b).astype(np.float32) for b in sizes[1:])
    layout = tuple(f"entry {i}" for i in range(7))
    return LearnedDefender(Path("d"), {"attacks": "training"}, layout, weights, biases)


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
    policy = LearnedDefender(Path("r"), defender.configuration, layout, weights, biases)
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
    environment = {"attacks": "training", "scenario": "foi-drive:horizon=60", "detectors": ["snapshot"], "clean": 0.25}
    (tmp_path / CONFIG_FILE).write_text(json.dumps({"environment": environment}))
    loaded = LearnedDefender.load(tmp_path)
    assert loaded.configuration == environment
    observation = np.random.default_rng(4).uniform(-1, 1, (20, 7)).astype(np.float32)
    np.testing.assert_array_equal(loaded.act(observation), defender.act(observation))


def test_who_plays_is_read_from_the_folder(defender, folder, tmp_path):
    assert load_policy(folder).kind == "spoofer"
    run = tmp_path / "d"
    run.mkdir()
    defender.save(run)
    (run / CONFIG_FILE).write_text(json.dumps({"environment": {"attacks": "training"}}))
    assert load_policy(run).kind == "defender"
    (run / CONFIG_FILE).write_text(json.dumps({"environment": {"scenario": "foi-drive"}}))
    with pytest.raises(ValueError, match=r"config\.json is damaged: .* knowledge, attacks: who plays is unknown"):
        load_policy(run)


def test_a_spoofers_run_folder_is_no_defenders(folder):
    with pytest.raises(ValueError, match="is the run folder of a spoofer, not of a defender"):
        LearnedDefender.load(folder)


def test_a_defenders_run_folder_is_no_spoofers(defender, tmp_path):
    defender.save(tmp_path)
    (tmp_path / CONFIG_FILE).write_text(json.dumps({"environment": {"attacks": "training", "detectors": ["snapshot"]}}))
    with pytest.raises(ValueError, match="is the run folder of a defender, not of a spoofer"):
        LearnedSpoofer.load(tmp_path)


def test_a_defender_without_a_depth_is_refused(defender, tmp_path):
    short = (*defender.weights[:-1], defender.weights[-1][:2]), (*defender.biases[:-1], defender.biases[-1][:2])
    LearnedDefender(Path("d"), defender.configuration, defender.layout, *short).save(tmp_path)
    (tmp_path / CONFIG_FILE).write_text(json.dumps({"environment": {"attacks": "training"}}))
    with pytest.raises(ValueError, match=r"policy\.npz is damaged: a defender's network has more outputs than 2"):
        LearnedDefender.load(tmp_path)
