"""What vector environments return, compared to the last bit: with single environments, earlier calls, another run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

Trace = list[tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]]
"""Observation, reward, both flags and info of each step."""


def check_observation(vector: VectorEnv, ours: Any, expected: Sequence[Any], where: str) -> None:
    """Compare the observation of all lanes with those of single environments, bit for bit."""
    assert isinstance(ours, np.ndarray), f"{where}: the observation is {type(ours)}, no array"
    space = vector.observation_space
    assert ours.dtype == space.dtype, f"{where}: the observation's dtype is {ours.dtype}, its space's {space.dtype}"
    assert ours.shape == space.shape, f"{where}: the observation's shape is {ours.shape}, its space's {space.shape}"
    assert space.contains(ours), f"{where}: the observation lies outside its space: {ours}"
    for lane, lane_expected in enumerate(expected):
        assert np.array_equal(ours[lane], lane_expected), (
            f"{where}, lane {lane}: the observation is {ours[lane]}, that of the single environment {lane_expected}"
        )


def check_flags(ours: tuple[Any, ...], expected: tuple[Any, ...], where: str) -> None:
    """Compare rewards and both flags of all lanes with those of single environments."""
    for name, got, wanted in zip(("reward", "terminated", "truncated"), ours, expected, strict=True):
        assert isinstance(got, np.ndarray), f"{where}: {name} is {type(got)}, no array"
        assert got.shape == (len(wanted),), f"{where}: {name} has shape {got.shape}, not ({len(wanted)},)"
        right = np.issubdtype(got.dtype, np.floating) if name == "reward" else got.dtype == np.bool_
        assert right, f"{where}: {name} has dtype {got.dtype}"
        for lane, value in enumerate(wanted):
            assert got[lane] == value, (
                f"{where}, lane {lane}: {name} is {got[lane]}, that of the single environment {value}"
            )


def check_infos(ours: dict[str, Any], expected: list[dict[str, Any]], where: str, key: str = "info") -> None:
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
            check_infos(ours[name], [value or {} for value in values], where, path)
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


class Returned:
    """What the last call returned, and how it looked then."""

    def __init__(self) -> None:
        """Nothing has been returned yet."""
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


def compare(first: Trace, second: Trace, lanes: int, where: str) -> None:
    """Compare the first ``lanes`` lanes of two runs with the same actions."""
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
