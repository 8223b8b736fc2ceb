"""The adapter to Stable-Baselines3: bit-equal with its own vector environment of single environments."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

import spoofgym  # noqa: F401 - registers the environment
from spoofgym.envs.sb3 import SB3VecEnv
from spoofgym.envs.vector import SpooferVectorEnv

ID = "spoofgym/Spoofer-v0"
LANES = 10


def adapted(num_envs: int = LANES, **arguments: Any) -> SB3VecEnv:
    return SB3VecEnv(SpooferVectorEnv(num_envs, autoreset_mode="SameStep", **arguments))


@pytest.mark.parametrize("arguments", [{"max_episode_steps": 7}, {"scenario": "liu-flight:horizon=12"}], ids=str)
def test_bit_equal_with_dummy_vec_env(arguments: dict[str, Any]) -> None:
    ours = adapted(**arguments)
    theirs = DummyVecEnv([lambda: gym.make(ID, **arguments)] * LANES)
    assert ours.seed(11) == theirs.seed(11)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    assert ours.reset_infos == theirs.reset_infos
    rng = np.random.default_rng(0)
    ends = truncations = 0
    for _ in range(300):
        actions = rng.uniform(-0.6, 0.6, (LANES, 3)).astype(np.float32)
        one, other = ours.step(actions), theirs.step(actions)
        for a, b in zip(one[:3], other[:3], strict=True):
            np.testing.assert_array_equal(a, b)
            assert a.dtype == b.dtype
        for lane in np.flatnonzero(one[2]):
            info, expected = one[3][lane], other[3][lane]
            np.testing.assert_array_equal(info.pop("terminal_observation"), expected.pop("terminal_observation"))
            assert info == expected
            assert isinstance(info["TimeLimit.truncated"], bool)
            truncations += info["TimeLimit.truncated"]
            ends += 1
    assert ours.reset_infos == theirs.reset_infos
    assert ends > 100
    assert (truncations > 0) is ("max_episode_steps" in arguments)


def test_seeds_are_used_once() -> None:
    env = adapted(3)
    env.seed(4)
    env.reset()
    first = env.reset_infos
    env.reset()
    assert env.reset_infos != first
    env.seed(4)
    env.reset()
    assert env.reset_infos == first


@pytest.mark.parametrize("mode", ["NextStep", "Disabled"])
def test_refuses_another_autoreset_mode(mode: str) -> None:
    with pytest.raises(ValueError, match="SAME_STEP"):
        SB3VecEnv(SpooferVectorEnv(2, autoreset_mode=mode))


def test_questions_that_sb3_asks() -> None:
    env = adapted(3)
    assert env.num_envs == 3
    assert env.render_mode is None
    assert env.env_is_wrapped(Monitor) == [False] * 3
    assert env.env_is_wrapped(Monitor, indices=[0, 2]) == [False] * 2
    assert env.get_attr("config") == [env.vector_env.config] * 3
    assert env.get_attr("num_envs", indices=1) == [3]
    env.seed(7)
    env.reset()
    assert env.get_attr("np_random_seed") == [7, 8, 9]
    assert env.get_attr("np_random", indices=[2]) == [env.vector_env.np_random[2]]
    assert not env.has_attr("nothing_of_the_kind")
    assert list(env.get_images()) == [None] * 3
    with pytest.raises(AttributeError, match="cannot be set"):
        env.set_attr("config", None)
    with pytest.raises(AttributeError, match="action_masks"):
        env.env_method("action_masks")
    env.reset()
    assert [info["epoch"] for info in env.reset_infos] == [0] * 3
    env.close()


@pytest.mark.slow
def test_ppo_learns_through_sb3s_wrappers() -> None:
    env = VecNormalize(VecMonitor(adapted(16, scenario="liu-flight:horizon=12")))
    model = PPO("MlpPolicy", env, n_steps=24, batch_size=192, n_epochs=1, seed=0, device="cpu")
    model.learn(16 * 24)
    assert len(model.ep_info_buffer) > 0
    assert all(np.isfinite(list(episode.values())).all() for episode in model.ep_info_buffer)
    assert len(model.ep_success_buffer) == len(model.ep_info_buffer)
    env.close()
