"""A checker of vector environments, for spoofgym's own and for anyone's.

Gymnasium and Stable-Baselines3 check single environments only. `check_vector_env` holds a native vector environment to
what Gymnasium documents and `gymnasium.vector.SyncVectorEnv` does::

    from spoofgym.envs.checker import check_vector_env

    check_vector_env(
        lambda num_envs, autoreset_mode: MyVectorEnv(num_envs, autoreset_mode=autoreset_mode),
        lambda: gymnasium.make("MyEnv-v0"),
    )
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from spoofgym.envs.checker_comparison import Returned, Trace, check_flags, check_infos, check_observation, compare

MakeVector = Callable[[int, AutoresetMode], VectorEnv]
MakeSingle = Callable[[], gym.Env]
SampleActions = Callable[[VectorEnv], NDArray[Any]]


def check_vector_env(
    make_vector: MakeVector,
    make_single: MakeSingle,
    *,
    num_steps: int = 300,
    num_envs: int = 3,
    seed: int = 123,
    sample_actions: SampleActions | None = None,
) -> None:
    """Check a native vector environment against its single environment, in all three autoreset modes.

    What is checked, exactly and without a tolerance:

    - the spaces are the batched spaces of the single environment, and every observation lies in them;
    - ``metadata["autoreset_mode"]`` is the mode that was asked for;
    - lane i equals the single environment seeded ``seed + i``: observation, reward, both flags, infos with their masks,
      ``final_obs`` and ``final_info``; in the mode DISABLED with resets of some lanes by ``reset_mask``;
    - a lane is the same for another number of lanes, and for a second run on the same seed;
    - nothing returned shares memory with what an earlier call returned, or is changed by a later call;
    - infos hold no NaN;
    - seeds are a number, a sequence with a number or None per lane, or None, where the random streams go on;
    - ``np_random_seed`` tells the seed of each lane, and ``np_random`` its generator;
    - bad seeds and masks, and in the mode DISABLED a step of a lane that is over, raise an exception.

    Spaces must be those whose samples are arrays (Box, Discrete, MultiDiscrete, MultiBinary).

    Args:
        make_vector: called with the number of lanes and the autoreset mode, it builds a new vector environment.
        make_single: builds a new single environment; with a `TimeLimit` where the vector environment has a
            limit of steps.
        num_steps: steps in each mode; at least one episode must end in them.
        num_envs: lanes, 2 or more.
        seed: of lane 0.
        sample_actions: draws the actions of all lanes; by default ``vector_env.action_space.sample()``. That space is
            seeded before.

    Raises:
        AssertionError: something differs; the message says what, in which mode, at which step and in which lane.
    """
    if num_envs < 2:
        raise ValueError(f"num_envs must be 2 or more, got {num_envs}")
    sample = sample_actions or (lambda vector: vector.action_space.sample())
    for mode in AutoresetMode:
        _check_spaces(make_vector, make_single, num_envs, mode)
        actions = _draw_actions(make_vector, num_envs + 2, mode, num_steps, seed, sample)
        trace = _check_against_singles(make_vector, make_single, num_envs, mode, seed, actions)
        _check_repeats(make_vector, num_envs, mode, seed, actions, trace)
    _check_seeds(make_vector, make_single, num_envs, seed, sample)
    _check_refusals(make_vector, num_envs, seed, sample)


def _check_spaces(make_vector: MakeVector, make_single: MakeSingle, num_envs: int, mode: AutoresetMode) -> None:
    vector, single = make_vector(num_envs, mode), make_single()
    try:
        assert isinstance(vector, VectorEnv), f"make_vector must build a gymnasium VectorEnv, got {type(vector)}"
        assert vector.num_envs == num_envs, f"num_envs is {vector.num_envs}, asked for {num_envs}"
        told = vector.metadata.get("autoreset_mode")
        assert told is mode, f"metadata['autoreset_mode'] must be {mode!r}, got {told!r}"
        for kind in ("observation_space", "action_space"):
            expected = getattr(single, kind)
            ours, batched = getattr(vector, f"single_{kind}"), getattr(vector, kind)
            assert ours == expected, f"single_{kind} is {ours}, that of the single environment {expected}"
            assert batched == batch_space(expected, num_envs), (
                f"{kind} is {batched}, the batch of single spaces {batch_space(expected, num_envs)}"
            )
    finally:
        vector.close()
        single.close()


def _draw_actions(
    make_vector: MakeVector, num_envs: int, mode: AutoresetMode, num_steps: int, seed: int, sample: SampleActions
) -> list[NDArray[Any]]:
    """Actions for more lanes than are checked, so that those of a lane do not depend on their number."""
    vector = make_vector(num_envs, mode)
    try:
        vector.action_space.seed(seed)
        return [np.array(sample(vector)) for _ in range(num_steps)]
    finally:
        vector.close()


class _Singles:
    """Single environments, played as Gymnasium's autoreset modes say, each lane with an info of its own."""

    def __init__(self, make_single: MakeSingle, num_envs: int, mode: AutoresetMode) -> None:
        self.envs = [make_single() for _ in range(num_envs)]
        self.mode = mode
        self.done = np.zeros(num_envs, dtype=bool)
        self.observations: list[Any] = [None] * num_envs

    def reset(self, seeds: Sequence[int | None], mask: NDArray[np.bool_]) -> list[dict[str, Any]]:
        infos: list[dict[str, Any]] = [{} for _ in self.envs]
        for lane in np.flatnonzero(mask).tolist():
            self.observations[lane], infos[lane] = self.envs[lane].reset(seed=seeds[lane])
            self.done[lane] = False
        return infos

    def step(self, actions: NDArray[Any]) -> tuple[list[float], list[bool], list[bool], list[dict[str, Any]]]:
        rewards, terminations, truncations, infos = [], [], [], []
        for lane, env in enumerate(self.envs):
            if self.mode == AutoresetMode.NEXT_STEP and self.done[lane]:
                reward, terminated, truncated = 0.0, False, False
                observation, info = env.reset()
            else:
                observation, reward, terminated, truncated, info = env.step(actions[lane])  # type: ignore[assignment]
                if self.mode == AutoresetMode.SAME_STEP and (terminated or truncated):
                    final = {"final_obs": observation, "final_info": info}
                    observation, info = env.reset()
                    info = {**info, **final}
            self.observations[lane] = observation
            self.done[lane] = (terminated or truncated) and self.mode != AutoresetMode.SAME_STEP
            rewards.append(float(reward))
            terminations.append(terminated)
            truncations.append(truncated)
            infos.append(info)
        return rewards, terminations, truncations, infos

    def close(self) -> None:
        for env in self.envs:
            env.close()


def _check_against_singles(
    make_vector: MakeVector,
    make_single: MakeSingle,
    num_envs: int,
    mode: AutoresetMode,
    seed: int,
    actions: list[NDArray[Any]],
) -> Trace:
    """Play the vector environment beside single ones; returns what the vector environment gave."""
    vector, singles = make_vector(num_envs, mode), _Singles(make_single, num_envs, mode)
    everyone = np.ones(num_envs, dtype=bool)
    trace: Trace = []
    earlier = Returned()
    ends = 0
    try:
        where = f"mode {mode.value}, reset"
        observation, info = vector.reset(seed=seed)
        infos = singles.reset([seed + i for i in range(num_envs)], everyone)
        check_observation(vector, observation, singles.observations, where)
        check_infos(info, infos, where)
        earlier.check((observation, info), where)
        for number, batch in enumerate(actions, start=1):
            where = f"mode {mode.value}, step {number}"
            given = batch[:num_envs].copy()
            result = vector.step(given)
            assert np.array_equal(given, batch[:num_envs]), f"{where}: the actions were changed"
            rewards, terminations, truncations, infos = singles.step(batch[:num_envs])
            check_observation(vector, result[0], singles.observations, where)
            check_flags(result[1:4], (rewards, terminations, truncations), where)
            check_infos(result[4], infos, where)
            earlier.check(result, where)
            trace.append(copy.deepcopy(result))
            ends += int(np.sum(np.logical_or(terminations, truncations)))
            if mode == AutoresetMode.DISABLED:
                mask = singles.done.copy()
                if number % 50 == 0:
                    mask[number // 50 % num_envs] = True  # in the middle of an episode, too
                if mask.any():
                    where += ", reset of some lanes"
                    observation, info = vector.reset(options={"reset_mask": mask.copy()})
                    infos = singles.reset([None] * num_envs, mask)
                    check_observation(vector, observation, singles.observations, where)
                    check_infos(info, infos, where)
                    earlier.check((observation, info), where)
        assert ends > 0, f"mode {mode.value}: no episode ended in {len(actions)} steps; check with a larger num_steps"
    finally:
        vector.close()
        singles.close()
    return trace


def _play(vector: VectorEnv, seed: int, actions: list[NDArray[Any]]) -> Trace:
    vector.reset(seed=seed)
    mode, trace = vector.metadata["autoreset_mode"], []
    for number, batch in enumerate(actions, start=1):
        result = copy.deepcopy(vector.step(batch[: vector.num_envs]))
        trace.append(result)
        if mode == AutoresetMode.DISABLED:
            mask = result[2] | result[3]
            if number % 50 == 0:
                lane = number // 50 % (len(actions[0]) - 2)
                if lane < vector.num_envs:
                    mask[lane] = True
            if mask.any():
                vector.reset(options={"reset_mask": mask})
    return trace


def _check_repeats(
    make_vector: MakeVector, num_envs: int, mode: AutoresetMode, seed: int, actions: list[NDArray[Any]], trace: Trace
) -> None:
    """The same seed again, in the same object, in a new one, and for other numbers of lanes."""
    vector = make_vector(num_envs, mode)
    try:
        for kind in ("a new environment", "the same environment, reset with the same seed"):
            compare(trace, _play(vector, seed, actions), num_envs, f"mode {mode.value}, {kind}")
    finally:
        vector.close()
    for number in (1, num_envs + 2):
        vector = make_vector(number, mode)
        try:
            again = _play(vector, seed, actions)
        finally:
            vector.close()
        compare(trace, again, min(number, num_envs), f"mode {mode.value}, {number} lanes instead of {num_envs}")


def _check_seeds(
    make_vector: MakeVector, make_single: MakeSingle, num_envs: int, seed: int, sample: SampleActions
) -> None:
    mode = AutoresetMode.DISABLED
    everyone = np.ones(num_envs, dtype=bool)
    numbers: list[int | None] = [seed + i for i in range(num_envs)]
    some: list[int | None] = [None if i % 2 else seed + 100 - i for i in range(num_envs)]
    vector, singles = make_vector(num_envs, mode), _Singles(make_single, num_envs, mode)
    try:
        vector.action_space.seed(seed)
        kinds: tuple[tuple[str, Any, list[int | None]], ...] = (
            ("a number", seed, numbers),
            ("None after a number", None, [None] * num_envs),
            ("a list with None", some, some),
            ("a reversed list", numbers[::-1], numbers[::-1]),
        )
        for kind, given, seeds in kinds:
            where = f"seed: {kind}"
            observation, info = vector.reset(seed=given)
            infos = singles.reset(seeds, everyone)
            check_observation(vector, observation, singles.observations, where)
            check_infos(info, infos, where)
            _check_generators(vector, singles, where)
            actions = sample(vector)
            result = vector.step(actions)
            singles.step(actions)
            check_observation(vector, result[0], singles.observations, f"{where}, first step")
        vector.reset()  # fresh entropy goes on somewhere: it must work
    finally:
        vector.close()
        singles.close()


def _check_generators(vector: VectorEnv, singles: _Singles, where: str) -> None:
    told, expected = vector.np_random_seed, tuple(env.np_random_seed for env in singles.envs)
    assert isinstance(told, tuple), f"{where}: np_random_seed is {told!r}, no tuple of the lanes' seeds"
    assert told == expected, f"{where}: np_random_seed is {told}, those of the single environments are {expected}"
    generators = vector.np_random
    assert isinstance(generators, tuple), f"{where}: np_random is {generators!r}, no tuple of the lanes' generators"
    right = len(generators) == len(expected) and all(isinstance(item, np.random.Generator) for item in generators)
    assert right, f"{where}: np_random is {generators}, not a generator for each of {len(expected)} lanes"


def _check_refusals(make_vector: MakeVector, num_envs: int, seed: int, sample: SampleActions) -> None:
    vector = make_vector(num_envs, AutoresetMode.DISABLED)
    try:
        vector.action_space.seed(seed)
        _refuses(lambda: vector.step(sample(vector)), "a step before the first reset")
        _refuses(lambda: vector.reset(seed=[seed] * (num_envs + 1)), "a list of seeds of the wrong length")  # type: ignore[arg-type]
        vector.reset(seed=seed)
        everyone = np.ones(num_envs, dtype=bool)
        masks = {
            "of the wrong shape": np.ones(num_envs + 1, dtype=bool),
            "of numbers": np.ones(num_envs, dtype=int),
            "without any lane": ~everyone,
            "that is a list": [True] * num_envs,
        }
        for kind, mask in masks.items():
            _refuses(partial(vector.reset, options={"reset_mask": mask}), f"a reset_mask {kind}")
        done = ~everyone
        while not done.any():
            _, _, terminated, truncated, _ = vector.step(sample(vector))
            done = np.asarray(terminated) | np.asarray(truncated)
        _refuses(lambda: vector.step(sample(vector)), "a step of a lane that is over, in mode Disabled")
    finally:
        vector.close()


def _refuses(call: Callable[[], Any], what: str) -> None:
    try:
        call()
    except Exception:
        return
    raise AssertionError(f"{what} raises no exception")
