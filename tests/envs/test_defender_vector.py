"""Defender-v0, native vector form: equal to single environments, in all modes, for any number of lanes."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, VectorEnv
from stable_baselines3.common.vec_env import DummyVecEnv

import spoofgym  # noqa: F401 - registers the environment
from spoofgym.envs.checker import check_vector_env
from spoofgym.envs.sb3 import SB3VecEnv
from spoofgym.envs.vector import DefenderVectorEnv

ID = "spoofgym/Defender-v0"
SHORT = "foi-drive:horizon=25"
STEPS = 60
"""Two games of each lane, a part of a third, and a reset in mid-game, which the checker does at step 50."""
DETECTORS = ("snapshot", "signed-mean:n=5,p_fa=1e-2", "windowed:n=20,threshold=114")


def mostly_use(vector: VectorEnv) -> np.ndarray:
    """Every other lane excludes now and then only, so that exclusions begin and end."""
    actions = vector.action_space.sample()
    actions[::2, 0] &= np.random.default_rng(int(actions.sum())).random(len(actions[::2])) < 0.2
    return actions


@pytest.mark.parametrize(
    "arguments",
    [
        {"fidelity": "strapdown", "scenario": "foi-drive:horizon=22"},
        {"attacks": "held-out", "clean": 0.0, "outage": 1.0, "multipath": 1.0},
        {"attacks": ("ramp:2,onset=25", "jump"), "threads": 2, "max_episode_steps": 10},
        {"scenario": "foi-drive:horizon=25,receiver=foi,onset=40"},
    ],
    ids=str,
)
def test_equal_to_single_environments(arguments: dict[str, Any]) -> None:
    given: dict[str, Any] = {"scenario": SHORT, "detectors": DETECTORS} | arguments
    limit = given.pop("max_episode_steps", None)
    check_vector_env(
        lambda num_envs, mode: DefenderVectorEnv(num_envs, autoreset_mode=mode, max_episode_steps=limit, **given),
        lambda: gym.make(ID, max_episode_steps=limit, **given),
        num_steps=STEPS,
        sample_actions=mostly_use,
    )


def test_make_vec_builds_the_native_environment() -> None:
    vector = gym.make_vec(f"spoofgym:{ID}", num_envs=3, scenario=SHORT, detectors="snapshot")
    assert isinstance(vector.unwrapped, DefenderVectorEnv)
    assert vector.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    vector.close()


@pytest.mark.parametrize("threads", [1, 2])
def test_lanes_do_not_depend_on_their_number(threads: int) -> None:
    """Lane i of 300 and of 7, over two games, while some lanes backtrack."""
    rng = np.random.default_rng(0)
    actions = [rng.integers([2, 5], size=(300, 2)) for _ in range(50)]
    traces = []
    for lanes in (300, 7):
        vector = DefenderVectorEnv(
            lanes, scenario=SHORT, detectors=DETECTORS, threads=threads, autoreset_mode="SameStep", clean=0.2
        )
        trace = [vector.reset(seed=4)[0][:7]]
        for action in actions:
            observation, reward, *_ = vector.step(action[:lanes])
            trace += [observation[:7], reward[:7]]
        traces.append(trace)
    for one, other in zip(*traces, strict=True):
        np.testing.assert_array_equal(one, other)


def test_adapter_is_bit_equal_with_dummy_vec_env() -> None:
    given: dict[str, Any] = {"scenario": SHORT, "detectors": "snapshot"}
    ours = SB3VecEnv(DefenderVectorEnv(4, autoreset_mode=AutoresetMode.SAME_STEP, **given))
    theirs = DummyVecEnv([lambda: gym.make(ID, **given)] * 4)
    ours.seed(7)
    theirs.seed(7)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    rng = np.random.default_rng(1)
    ends = 0
    for _ in range(80):
        actions = rng.integers([2, 5], size=(4, 2))
        one, other = ours.step(actions), theirs.step(actions)
        for a, b in zip(one[:3], other[:3], strict=True):
            np.testing.assert_array_equal(a, b)
        for lane in np.flatnonzero(one[2]):
            ends += 1
            np.testing.assert_array_equal(one[3][lane]["terminal_observation"], other[3][lane]["terminal_observation"])
            assert one[3][lane]["TimeLimit.truncated"] == other[3][lane]["TimeLimit.truncated"]
            assert one[3][lane]["mean_error"] == other[3][lane]["mean_error"]
    assert ends == 12
