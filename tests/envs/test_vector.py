"""Spoofer-v0, native vector form: equal to single environments, for any number of lanes; and its checker."""

import copy
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

import spoofgym  # noqa: F401 - registers the environment
from spoofgym.envs.checker import check_vector_env
from spoofgym.envs.vector import DefenderVectorEnv, SpooferVectorEnv

ID = "spoofgym/Spoofer-v0"
SHORT = "liu-flight:horizon=12"


def slow_or_fast(vector: VectorEnv) -> np.ndarray:
    """Every other lane drags off slowly, so that games end both ways."""
    actions = vector.action_space.sample()
    actions[::2] *= 0.2
    return actions


def check(sample_actions: Any = slow_or_fast, num_steps: int = 60, **arguments: Any) -> None:
    limit = arguments.pop("max_episode_steps", None)
    check_vector_env(
        lambda num_envs, mode: SpooferVectorEnv(num_envs, autoreset_mode=mode, max_episode_steps=limit, **arguments),
        lambda: gym.make(ID, max_episode_steps=limit, **arguments),
        num_steps=num_steps,
        sample_actions=sample_actions,
    )


@pytest.mark.parametrize(
    "arguments",
    [
        {"scenario": SHORT, "knowledge": "full", "action": "innovation"},
        {"scenario": SHORT, "fidelity": "strapdown"},
        {"scenario": SHORT, "knowledge": "full", "detector": ("windowed:n=5,threshold=40", "snapshot")},
        {"scenario": SHORT, "on_alarm": "respond", "detector": "windowed", "knowledge": "blind"},
        {"scenario": SHORT, "threads": 2, "tracking_sigma": 1.0, "forfeit": 0.5, "max_episode_steps": 5},
        {"scenario": SHORT, "max_episode_steps": 12},
        {"scenario": "liu-flight:horizon=1", "num_steps": 20},  # every lane ends in every step
    ],
    ids=str,
)
def test_equal_to_single_environments(arguments: dict[str, Any]) -> None:
    check(**arguments)


def test_infos_are_those_of_gymnasiums_own_vector_environment() -> None:
    for mode in AutoresetMode:
        ours = SpooferVectorEnv(3, scenario=SHORT, autoreset_mode=mode)
        theirs = SyncVectorEnv([lambda: gym.make(ID, scenario=SHORT)] * 3, autoreset_mode=mode)
        assert compare(ours.reset(seed=1)[1], theirs.reset(seed=1)[1])
        ours.action_space.seed(1)
        for _ in range(11 if mode == AutoresetMode.DISABLED else 40):
            actions = ours.action_space.sample() * 0.3
            one, other = ours.step(actions), theirs.step(actions)
            assert compare(one[4], other[4])
            for a, b in zip(one[:4], other[:4], strict=True):
                np.testing.assert_array_equal(a, b)
                assert a.dtype == b.dtype
            if mode == AutoresetMode.DISABLED and (one[2] | one[3]).any():
                break


@pytest.mark.parametrize(("kind", "name"), [(SpooferVectorEnv, ID), (DefenderVectorEnv, "spoofgym/Defender-v0")])
def test_seeds_and_generators_are_told_as_by_gymnasium(kind: type[VectorEnv], name: str) -> None:
    given: dict[str, Any] = {"scenario": "foi-drive:horizon=22"}
    given |= {"detectors": "snapshot"} if name.endswith("Defender-v0") else {}
    ours = kind(3, **given)
    theirs = SyncVectorEnv([lambda: gym.make(name, **given)] * 3)
    for seed in (5, None, [7, None, 3], (None, 2, None), [None] * 3, 11):
        ours.reset(seed=seed)
        theirs.reset(seed=seed)
        assert ours.np_random_seed == theirs.np_random_seed
        states = [[lane.bit_generator.state for lane in vector.np_random] for vector in (ours, theirs)]
        assert states[0] == states[1]
    assert ours.np_random_seed == (11, 12, 13)
    ours.reset(seed=30, options={"reset_mask": np.array([False, True, False])})
    assert ours.np_random_seed == (11, 31, 13)
    ours.step(ours.action_space.sample())
    assert ours.np_random_seed == (11, 31, 13)
    with pytest.raises(AttributeError):
        ours.np_random = np.random.default_rng(0)


def test_seeds_that_were_not_given_are_told_and_give_the_same_games_again() -> None:
    ours = SpooferVectorEnv(3, scenario=SHORT)
    seeds = ours.np_random_seed  # before the first reset, as Gymnasium allows
    assert len(set(seeds)) == 3
    first, _ = ours.reset()
    assert ours.np_random_seed == seeds
    again, _ = SpooferVectorEnv(3, scenario=SHORT).reset(seed=list(seeds))
    np.testing.assert_array_equal(first, again)


def compare(one: Any, other: Any) -> bool:
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(compare(one[key], other[key]) for key in one)
    if one.dtype == object:
        return all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))
    return one.dtype == other.dtype and np.array_equal(one, other)


@pytest.mark.parametrize("fidelity", ["linear", "strapdown"])
@pytest.mark.parametrize("threads", [1, 2])
def test_lanes_do_not_depend_on_their_number(fidelity: str, threads: int) -> None:
    actions = np.random.default_rng(0).uniform(-0.3, 0.3, (30, 64, 3)).astype(np.float32)
    traces = []
    for number in (1, 7, 64):
        vector = SpooferVectorEnv(number, scenario=SHORT, knowledge="full", fidelity=fidelity, threads=threads)
        observations, _ = vector.reset(seed=9)
        trace = [observations[0]]
        for batch in actions:
            observations, reward, *_ = vector.step(batch[:number])
            trace += [observations[0], reward[0]]
        traces.append(np.hstack(trace))
    np.testing.assert_array_equal(traces[0], traces[1])
    np.testing.assert_array_equal(traces[0], traces[2])


def test_make_vec_builds_the_native_environment() -> None:
    vector = gym.make_vec(f"spoofgym:{ID}", 3, max_episode_steps=4)
    assert isinstance(vector.unwrapped, SpooferVectorEnv)
    assert vector.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    vector.reset(seed=0)
    for step in range(1, 6):
        *_, truncated, _ = vector.step(np.zeros((3, 3), dtype=np.float32))
        assert (truncated == (step == 4)).all()
    vector.close()
    vector = gym.make_vec(ID, 2, vectorization_mode="vector_entry_point", autoreset_mode="SameStep", knowledge="blind")
    assert vector.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert vector.observation_space.shape == (2, 8)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"num_envs": 0}, ValueError, "num_envs"),
        ({"render_mode": "cinema"}, ValueError, "render_mode must be one of human, rgb_array, ansi, got 'cinema'"),
        ({"render_lanes": 1}, ValueError, "render_lanes has an effect with a render_mode only"),
        ({"render_mode": "ansi", "num_envs": 3, "render_lanes": 4}, ValueError, "render_lanes must be .* 3 at most"),
        ({"max_episode_steps": 0}, ValueError, "max_episode_steps"),
        ({"autoreset_mode": "never"}, ValueError, "never"),
        ({"colour": "red"}, TypeError, "'colour'.*scenario"),
        ({"knowledge": "some"}, ValueError, "blind, shadow, full"),
    ],
)
def test_bad_arguments(arguments: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        SpooferVectorEnv(**arguments)


def test_bad_calls() -> None:
    vector = SpooferVectorEnv(2, scenario=SHORT, autoreset_mode=AutoresetMode.DISABLED)
    actions = np.zeros((2, 3), dtype=np.float32)
    with pytest.raises(RuntimeError, match=r"lanes \[0, 1\] has not begun"):
        vector.step(actions)
    vector.reset(seed=0, options={"reset_mask": np.array([True, False])})
    with pytest.raises(RuntimeError, match=r"lanes \[1\] has not begun"):
        vector.step(actions)
    vector.reset(seed=0)
    with pytest.raises(ValueError, match=r"lane 1 is not finite"):
        vector.step(np.array([[0, 0, 0], [0, np.nan, 0]], dtype=np.float32))
    with pytest.raises(ValueError, match=r"shape \(2, 3\), got \(3,\)"):
        vector.step(np.zeros(3))
    with pytest.raises(ValueError, match="2 of them, got 3"):
        vector.reset(seed=[1, 2, 3])
    with pytest.raises(TypeError, match="boolean"):
        vector.reset(options={"reset_mask": [True, False]})
    with pytest.raises(ValueError, match="at least one True"):
        vector.reset(options={"reset_mask": np.zeros(2, dtype=bool)})
    for _ in range(12):
        vector.step(actions)
    with pytest.raises(RuntimeError, match=r"lanes \[0, 1\] is over"):
        vector.step(actions)


class Faulty(SpooferVectorEnv):
    """A vector environment with one fault, which the checker must find."""

    def __init__(self, fault: str, num_envs: int, mode: AutoresetMode) -> None:
        super().__init__(num_envs, scenario=SHORT, autoreset_mode=mode)
        self.fault = fault
        self.buffer = np.zeros(self.observation_space.shape, dtype=np.float32)
        if fault == "mode not told":
            del self.metadata["autoreset_mode"]

    @property
    def np_random_seed(self) -> Any:
        seeds = super().np_random_seed
        return {"one seed told": seeds[0], "seeds of other lanes told": seeds[::-1]}.get(self.fault, seeds)

    @property
    def np_random(self) -> Any:
        generators = super().np_random
        return {"one generator": generators[0], "a generator missing": generators[1:]}.get(self.fault, generators)

    def reset(self, *, seed: Any = None, options: Any = None) -> Any:
        if self.fault == "lanes seeded alike" and isinstance(seed, int):
            seed = [seed] * self.num_envs
        if self.fault == "mask ignored":
            options = None
        return super().reset(seed=seed, options=options)

    def step(self, actions: np.ndarray) -> Any:
        observation, reward, terminated, truncated, info = super().step(actions)
        if self.fault == "lanes leak into each other":
            reward = reward + 1e-12 * self.num_envs
        if self.fault == "buffer handed out":
            self.buffer[:] = observation
            observation = self.buffer
        if self.fault == "NaN in the info" and "reward_terms" in info:
            info["reward_terms"]["growth"][~info["_reward_terms"]] = np.nan
        if self.fault == "no mask" and "_epoch" in info:
            del info["_epoch"]
        if self.fault == "no final observation" and "final_obs" in info:
            info["final_obs"] = np.array([*observation, None], dtype=object)[:-1]
        if self.fault == "outside the space":
            observation = observation + np.float32(2.0)
        if self.fault == "reward in the wrong lane":
            reward = reward[::-1].copy()
        if self.fault == "random":
            reward = reward + np.random.default_rng().normal(size=reward.shape)
        return observation, reward, terminated, truncated, copy.deepcopy(info)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("mode not told", "autoreset_mode"),
        ("lanes seeded alike", r"mode NextStep, reset, lane 1: .*'error'"),
        ("mask ignored", "reset of some lanes"),
        ("lanes leak into each other", "lane 0: reward is"),
        ("buffer handed out", "changed what an earlier one returned|shares memory"),
        ("NaN in the info", "NaN"),
        ("no mask", "keys of info"),
        ("no final observation", "final_obs"),
        ("outside the space", "outside its space"),
        ("reward in the wrong lane", "reward"),
        ("random", "reward"),
        ("one seed told", "seed: a number: np_random_seed is 123, no tuple"),
        ("seeds of other lanes told", r"np_random_seed is \(125, 124, 123\), those of the single environments are"),
        ("one generator", "np_random is Generator.*, no tuple"),
        ("a generator missing", "not a generator for each of 3 lanes"),
    ],
)
def test_checker_finds_faults(fault: str, message: str) -> None:
    late = "told" in fault or "generator" in fault  # what is looked at when the games of all modes have been played
    with pytest.raises(AssertionError, match=message):
        check_vector_env(
            lambda num_envs, mode: Faulty(fault, num_envs, mode),
            lambda: gym.make(ID, scenario=SHORT),
            num_steps=14 if late else 60,
        )


def test_checker_wants_an_end_and_two_lanes() -> None:
    with pytest.raises(AssertionError, match="no episode ended in 5 steps"):
        check(num_steps=5, sample_actions=lambda vector: 0 * vector.action_space.sample())
    with pytest.raises(ValueError, match="2 or more"):
        check_vector_env(lambda num_envs, mode: SpooferVectorEnv(num_envs), lambda: gym.make(ID), num_envs=1)
