"""The environments on ranges as lanes: equal to single environments, masks, adapters."""

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.wrappers import RecordEpisodeStatistics
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

import spoofgym  # noqa: F401 - registers the environments
from spoofgym.envs.checker import check_vector_env
from spoofgym.envs.sb3 import SB3VecEnv
from spoofgym.envs.vector import DefenderVectorEnv, SpooferVectorEnv
from spoofgym.scenario import Scenario

SPOOFER, DEFENDER = "spoofgym/Spoofer-v0", "spoofgym/Defender-v0"
KUJUR = "kujur-flight:horizon=40,onset=60,drag_off_rate=4"
LIU = "liu-flight:horizon=40,onset=60,coupling=tight,drag_off_rate=4"
SHORT = "kujur-flight:horizon=6,onset=60"
STEPS = 14
"""Two games of six epochs, and the beginning of a third."""
DEAF = "snapshot:threshold=1e9"
SKIES = [(4.0, 5.0), (8.5, 15.0), (9.5, 25.0), (10.7, 20.0)]
QUIET: dict[str, Any] = {"attacks": "none", "outage": 0.0, "multipath": 0.0}

Under = Callable[[float, float], Scenario]


def slow_or_fast(vector: VectorEnv) -> np.ndarray:
    """Every other lane drags off slowly, so that games end both ways."""
    actions = vector.action_space.sample()
    actions[::2] *= 0.01
    return actions


def mostly_use(vector: VectorEnv) -> np.ndarray:
    """Few exclusions in every other lane, and few satellites left out in all."""
    actions = vector.action_space.sample()
    rng = np.random.default_rng(int(actions.sum()))
    actions[::2, 0] &= rng.random(len(actions[::2])) < 0.2
    actions[:, 2:] &= rng.random(actions[:, 2:].shape) < 0.2
    return actions


@pytest.mark.parametrize(
    "arguments",
    [
        {"knowledge": "full", "detector": ("snapshot", "separation-bank:n=10"), "tracking_sigma": 0.02},
        {"scenario": "liu-flight:horizon=6,onset=60,coupling=tight", "frames": 2, "max_episode_steps": 4},
        {"on_alarm": "respond", "response": "exclude-satellites", "knowledge": "blind"},
        {"fidelity": "strapdown", "threads": 2},
    ],
    ids=str,
)
def test_lanes_of_spoofers_equal_single_environments(arguments: dict[str, Any]) -> None:
    given: dict[str, Any] = {"scenario": SHORT} | arguments
    limit = given.pop("max_episode_steps", None)
    check_vector_env(
        lambda num_envs, mode: SpooferVectorEnv(num_envs, autoreset_mode=mode, max_episode_steps=limit, **given),
        lambda: gym.make(SPOOFER, max_episode_steps=limit, **given),
        num_steps=STEPS,
        sample_actions=slow_or_fast,
    )


@pytest.mark.parametrize(
    "arguments",
    [
        {"detectors": ("snapshot", "separation-bank:n=10"), "outage": 1.0, "multipath": 1.0},
        {"detectors": "kujur-monitor:n=10", "attacks": "partial:jump", "clean": 0.2, "threads": 2},
        {"fidelity": "strapdown"},
    ],
    ids=str,
)
def test_lanes_of_defenders_equal_single_environments(arguments: dict[str, Any]) -> None:
    given: dict[str, Any] = {"scenario": SHORT, "detectors": "snapshot", "attacks": "ramp:1"} | arguments
    check_vector_env(
        lambda num_envs, mode: DefenderVectorEnv(num_envs, autoreset_mode=mode, **given),
        lambda: gym.make(DEFENDER, **given),
        num_steps=STEPS,
        sample_actions=mostly_use,
    )


def test_make_vec_takes_the_coupling_and_lanes_count_on() -> None:
    """The step after a game's end begins the next one; statistics of episodes are those of the lanes."""
    vector = RecordEpisodeStatisticsOfLanes(
        gym.make_vec(f"spoofgym:{SPOOFER}", 3, scenario="liu-flight:horizon=6", coupling="tight", detector=DEAF)
    )
    assert vector.unwrapped.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert vector.single_action_space.shape == (4,)
    vector.reset(seed=0)
    for k in range(1, 14):
        _, reward, terminated, _, info = vector.step(np.zeros((3, 4), dtype=np.float32))
        assert terminated.all() == (k in (6, 13))
        if k in (6, 13):
            assert (info["episode"]["l"] == 6).all()
        if k == 7:
            assert not reward.any()
            assert (info["epoch"] == 0).all()
    single = RecordEpisodeStatistics(gym.make(DEFENDER, scenario=SHORT, detectors="snapshot", attacks="none"))
    single.reset(seed=0)
    total = 0.0
    for _ in range(6):
        _, reward, over, _, info = single.step(np.zeros(10, dtype=np.int64))
        total += reward
    assert over
    assert info["episode"]["r"] == pytest.approx(total)


RecordEpisodeStatisticsOfLanes = gym.wrappers.vector.RecordEpisodeStatistics


def test_masks_of_lanes_reach_a_masked_learner() -> None:
    """Through the adapter and SB3's wrapper, as sb3-contrib asks for them; bit-equal with a DummyVecEnv."""
    given: dict[str, Any] = {"scenario": SHORT, "detectors": "snapshot", "attacks": "jump:onset=62", "outage": 1.0}
    vector = DefenderVectorEnv(3, autoreset_mode=AutoresetMode.SAME_STEP, **given)
    ours, theirs = VecMonitor(SB3VecEnv(vector)), DummyVecEnv([lambda: gym.make(DEFENDER, **given)] * 3)
    ours.seed(4)
    theirs.seed(4)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    assert ours.has_attr("action_masks")
    rng = np.random.default_rng(0)
    for _ in range(30):
        np.testing.assert_array_equal(np.stack(ours.env_method("action_masks")), vector.action_masks())
        singles = [env.unwrapped.action_masks() for env in theirs.envs]  # type: ignore[attr-defined]
        some = ours.env_method("action_masks", indices=[2, 0])
        np.testing.assert_array_equal(np.stack(some), [singles[2], singles[0]])
        actions = rng.integers(vector.single_action_space.nvec, size=(3, 10))  # type: ignore[attr-defined]
        one, other = ours.step(actions), theirs.step(actions)
        for a, b in zip(one[:3], other[:3], strict=True):
            np.testing.assert_array_equal(a, b)
    with pytest.raises(AttributeError, match="'reset'"):
        ours.env_method("reset")
    with pytest.raises(AttributeError, match="'action_masks'"):
        SB3VecEnv(SpooferVectorEnv(2, scenario=SHORT, autoreset_mode="SameStep")).env_method("action_masks")
