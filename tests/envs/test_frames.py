"""Observations with a memory: the entries of the last epochs, for the single and the vector environment."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import spoofgym  # noqa: F401 - registers the environment
from spoofgym.envs.checker import check_vector_env
from spoofgym.envs.frames import FrameStack, stacked_fields
from spoofgym.envs.observation import Field, spoofer_fields
from spoofgym.envs.spoofer import SpooferEnv
from spoofgym.envs.vector import SpooferVectorEnv

ID = "spoofgym/Spoofer-v0"
SHORT = "liu-flight:horizon=12"


def test_a_stack_is_the_list_of_what_was_pushed() -> None:
    """Three lanes, of which one begins anew on the way."""
    rng = np.random.default_rng(0)
    stack = FrameStack(3, 4, 2)
    first = rng.uniform(-1, 1, (3, 2)).astype(np.float32)
    stack.begin(np.arange(3), first)
    seen = [[frame] * 4 for frame in first]
    for step in range(6):
        present = rng.uniform(-1, 1, (3, 2)).astype(np.float32)
        stack.push(present)
        seen = [[frame, *past[:-1]] for frame, past in zip(present, seen, strict=True)]
        if step == 3:
            stack.begin(np.array([1]), present[[1]])
            seen[1] = [present[1]] * 4
        np.testing.assert_array_equal(stack.observation(), [np.concatenate(past) for past in seen])


def test_what_was_observed_is_not_changed_later() -> None:
    stack = FrameStack(2, 2, 1)
    before = stack.observation()
    stack.push(np.ones((2, 1), dtype=np.float32))
    assert not before.any()


def test_names_say_how_old_an_entry_is() -> None:
    fields = (Field("offset east", "m", 10.0), Field("elapsed fraction of the game", "1", 0.0))
    stacked = stacked_fields(fields, 3)
    assert [field.name for field in stacked] == [
        "offset east",
        "elapsed fraction of the game",
        "offset east, 1 epoch ago",
        "elapsed fraction of the game, 1 epoch ago",
        "offset east, 2 epochs ago",
        "elapsed fraction of the game, 2 epochs ago",
    ]
    assert [(field.unit, field.scale) for field in stacked] == [(field.unit, field.scale) for field in fields] * 3
    assert stacked_fields(fields, 1) == fields


@pytest.mark.parametrize(
    "arguments",
    [{}, {"knowledge": "full", "tracking_sigma": 1.0}, {"action": "innovation"}],
    ids=str,
)
def test_entries_are_the_plain_observations_of_the_last_epochs(arguments: dict[str, Any]) -> None:
    arguments = {"scenario": SHORT, "detector": "snapshot:threshold=1000", **arguments}
    plain, stacked = SpooferEnv(**arguments), SpooferEnv(frames=4, **arguments)
    rng = np.random.default_rng(1)
    for seed in (5, None):  # a second game begins with nothing of the first
        observations = [plain.reset(seed=seed)[0]]
        np.testing.assert_array_equal(stacked.reset(seed=seed)[0], np.tile(observations[0], 4))
        for epoch in range(1, 13):
            action = rng.uniform(-0.2, 0.2, 3)
            one, other = plain.step(action), stacked.step(action)
            observations.append(one[0])
            expected = [observations[max(epoch - age, 0)] for age in range(4)]
            np.testing.assert_array_equal(other[0], np.concatenate(expected))
            assert one[1:] == other[1:]


def test_space_and_fields_belong_together() -> None:
    env = SpooferEnv(frames=4, knowledge="full")
    one = spoofer_fields("full", 3, ("snapshot",))
    assert env.game.fields == stacked_fields(one, 4)
    low = SpooferEnv(knowledge="full").observation_space.low
    np.testing.assert_array_equal(env.observation_space.low, np.tile(low, 4))
    assert env.observation_space.shape == (4 * len(one),)


@pytest.mark.parametrize("knowledge", ["blind", "full"])
def test_checker_of_gymnasium(knowledge: str) -> None:
    env = gym.make(ID, scenario=SHORT, frames=4, knowledge=knowledge, render_mode="rgb_array")
    check_env(env.unwrapped)  # warnings are errors


@pytest.mark.parametrize("arguments", [{}, {"knowledge": "full", "max_episode_steps": 5}], ids=str)
def test_vector_form_equals_single_environments(arguments: dict[str, Any]) -> None:
    """In all autoreset modes, with games that end both ways."""

    def slow_or_fast(vector: gym.vector.VectorEnv) -> np.ndarray:
        actions = vector.action_space.sample()
        actions[::2] *= 0.2
        return actions

    arguments = {"scenario": SHORT, "frames": 4, **arguments}
    limit = arguments.pop("max_episode_steps", None)
    check_vector_env(
        lambda num_envs, mode: SpooferVectorEnv(num_envs, autoreset_mode=mode, max_episode_steps=limit, **arguments),
        lambda: gym.make(ID, max_episode_steps=limit, **arguments),
        num_steps=30,
        sample_actions=slow_or_fast,
    )


@pytest.mark.parametrize("frames", [0, -1, 1.5, float("nan"), "4"])
def test_bad_number_of_frames(frames: Any) -> None:
    with pytest.raises(ValueError, match="frames must be a whole number, 1 or more"):
        SpooferEnv(frames=frames)
