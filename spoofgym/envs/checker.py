"""A checker of vector environments, for spoofgym's own and for anyone's.

Gymnasium and Stable-Baselines3 check single environments only. `check_vector_env` holds a native vector environment to
what Gymnasium documents and `gymnasium.vector.SyncVectorEnv` does:

    from spoofgym.envs.checker import check_vector_env

    check_vector_env(
        lambda num_envs, autoreset_mode: MyVectorEnv(num_envs, autoreset_mode=autoreset_mode),
        lambda: gymnasium.make("MyEnv-v0"),
    )
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

MakeVector = Callable[[int, AutoresetMode], VectorEnv]
MakeSingle = Callable[[], gym.Env]
SampleActions = Callable[[VectorEnv], NDArray[Any]]
Trace = list[tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]]


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
    earlier = _Returned()
    ends = 0
    try:
        where = f"mode {mode.value}, reset"
        observation, info = vector.reset(seed=seed)
        infos = singles.reset([seed + i for i in range(num_envs)], everyone)
        _check_observation(vector, observation, singles.observations, where)
        _check_infos(info, infos, where)
        earlier.check((observation, info), where)
        for number, batch in enumerate(actions, start=1):
            where = f"mode {mode.value}, step {number}"
            given = batch[:num_envs].copy()
            result = vector.step(given)
            assert np.array_equal(given, batch[:num_envs]), f"{where}: the actions were changed"
            rewards, terminations, truncations, infos = singles.step(batch[:num_envs])
            _check_observation(vector, result[0], singles.observations, where)
            _check_flags(result[1:4], (rewards, terminations, truncations), where)
            _check_infos(result[4], infos, where)
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
                    _check_observation(vector, observation, singles.observations, where)
                    _check_infos(info, infos, where)
                    earlier.check((observation, info), where)
        assert ends > 0, f"mode {mode.value}: no episode ended in {len(actions)} steps; check with a larger num_steps"
    finally:
        vector.close()
        singles.close()
    return trace


def _check_observation(vector: VectorEnv, ours: Any, expected: Sequence[Any], where: str) -> None:
    assert isinstance(ours, np.ndarray), f"{where}: the observation is {type(ours)}, no array"
    space = vector.observation_space
    assert ours.dtype == space.dtype, f"{where}: the observation's dtype is {ours.dtype}, its space's {space.dtype}"
    assert ours.shape == space.shape, f"{where}: the observation's shape is {ours.shape}, its space's {space.shape}"
    assert space.contains(ours), f"{where}: the observation lies outside its space: {ours}"
    for lane, lane_expected in enumerate(expected):
        assert np.array_equal(ours[lane], lane_expected), (
            f"{where}, lane {lane}: the observation is {ours[lane]}, that of the single environment {lane_expected}"
        )


def _check_flags(ours: tuple[Any, ...], expected: tuple[Any, ...], where: str) -> None:
    for name, got, wanted in zip(("reward", "terminated", "truncated"), ours, expected, strict=True):
        assert isinstance(got, np.ndarray), f"{where}: {name} is {type(got)}, no array"
        assert got.shape == (len(wanted),), f"{where}: {name} has shape {got.shape}, not ({len(wanted)},)"
        right = np.issubdtype(got.dtype, np.floating) if name == "reward" else got.dtype == np.bool_
        assert right, f"{where}: {name} has dtype {got.dtype}"
        for lane, value in enumerate(wanted):
            assert got[lane] == value, (
                f"{where}, lane {lane}: {name} is {got[lane]}, that of the single environment {value}"
            )


def _check_infos(ours: dict[str, Any], expected: list[dict[str, Any]], where: str, key: str = "info") -> None:
    """Gymnasium's layout: each key that any lane has, as an array or a dict of them, and ``_key``, who has it."""
    assert isinstance(ours, dict), f"{where}: {key} is {type(ours)}, no dict"
    wanted = {name for info in expected for name in info}
    assert set(ours) == wanted | {f"_{name}" for name in wanted}, (
        f"{where}: the keys of {key} are {sorted(ours)}; those of single environments are "
        f"{sorted(wanted)}, each with a mask _key beside it"
    )
    for name in wanted:
        mask, path = ours[f"_{name}"], f"{key}[{name!r}]"
        has = np.array([name in info for info in expected])
        assert isinstance(mask, np.ndarray), f"{where}: the mask of {path} is {type(mask)}, no array"
        assert mask.dtype == np.bool_, f"{where}: the mask of {path} has dtype {mask.dtype}, not bool"
        assert np.array_equal(mask, has), (
            f"{where}: the mask of {path} is {mask}, lanes of single environments have {has}"
        )
        values = [info.get(name) for info in expected]
        if any(isinstance(value, dict) for value in values):
            _check_infos(ours[name], [value or {} for value in values], where, path)
            continue
        assert isinstance(ours[name], np.ndarray), f"{where}: {path} is {type(ours[name])}, no array"
        assert len(ours[name]) == len(expected), (
            f"{where}: {path} has {len(ours[name])} entries for {len(expected)} lanes"
        )
        assert not _has_nan(ours[name]), f"{where}: {path} holds NaN: {ours[name]}"
        for lane in np.flatnonzero(has):
            got, value = ours[name][lane], values[lane]
            assert np.array_equal(got, value), (  # type: ignore[arg-type]
                f"{where}, lane {lane}: {path} is {got!r}, that of the single environment {value!r}"
            )


def _has_nan(value: Any) -> bool:
    array = np.asarray(value)
    if array.dtype == object:
        return any(item is not None and not isinstance(item, str) and _has_nan(item) for item in array.ravel())
    return bool(np.issubdtype(array.dtype, np.inexact) and np.isnan(array).any())


def _arrays(value: Any) -> Iterator[NDArray[Any]]:
    """All arrays inside what a call returned, those in object arrays too."""
    if isinstance(value, dict):
        for item in value.values():
            yield from _arrays(item)
    elif isinstance(value, tuple | list):
        for item in value:
            yield from _arrays(item)
    elif isinstance(value, np.ndarray):
        yield value
        if value.dtype == object:
            yield from _arrays(list(value.ravel()))


class _Returned:
    """What the last call returned, and how it looked then."""

    def __init__(self) -> None:
        self._last: list[NDArray[Any]] = []
        self._copies: list[NDArray[Any]] = []

    def check(self, result: Any, where: str) -> None:
        """Compare with the call before, then remember this one."""
        arrays = list(_arrays(result))
        for before, snapshot in zip(self._last, self._copies, strict=True):
            unchanged = all(a is b for a, b in zip(before.ravel(), snapshot.ravel(), strict=True))
            if before.dtype != object:
                unchanged = np.array_equal(before, snapshot, equal_nan=before.dtype.kind in "fc")
            assert unchanged, f"{where}: this call changed what an earlier one returned: {snapshot} became {before}"
            for array in arrays:
                assert not np.shares_memory(array, before), (
                    f"{where}: this call's result shares memory with an earlier one's"
                )
        self._last = arrays
        self._copies = [array.copy() for array in arrays]


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
            _compare(trace, _play(vector, seed, actions), num_envs, f"mode {mode.value}, {kind}")
    finally:
        vector.close()
    for number in (1, num_envs + 2):
        vector = make_vector(number, mode)
        try:
            again = _play(vector, seed, actions)
        finally:
            vector.close()
        _compare(trace, again, min(number, num_envs), f"mode {mode.value}, {number} lanes instead of {num_envs}")


def _compare(first: Trace, second: Trace, lanes: int, where: str) -> None:
    names = ("observation", "reward", "terminated", "truncated")
    for number, (one, other) in enumerate(zip(first, second, strict=True), start=1):
        for lane in range(lanes):
            for name, a, b in zip(names, one[:4], other[:4], strict=True):
                same = np.array_equal(a[lane], b[lane])
                assert same, f"{where}: at step {number} {name} of lane {lane} is {b[lane]} instead of {a[lane]}"
            info, again = _lane(one[4], lane), _lane(other[4], lane)
            assert _equal(info, again), (
                f"{where}: at step {number} the info of lane {lane} is {again} instead of {info}"
            )


def _lane(info: dict[str, Any], lane: int) -> dict[str, Any]:
    return {
        name: _lane(value, lane) if isinstance(value, dict) else value[lane]
        for name, value in info.items()
        if f"_{name}" in info and info[f"_{name}"][lane]
    }


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_equal(one[key], other[key]) for key in one)
    return np.array_equal(one, other)


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
            _check_observation(vector, observation, singles.observations, where)
            _check_infos(info, infos, where)
            _check_generators(vector, singles, where)
            actions = sample(vector)
            result = vector.step(actions)
            singles.step(actions)
            _check_observation(vector, result[0], singles.observations, f"{where}, first step")
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
