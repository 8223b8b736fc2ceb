"""Golden arrays on disk: one compressed archive per kind of episode, and the tolerance of every quantity."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.golden import duels, games, results, simulations

Arrays = dict[str, np.ndarray]
FOLDER = Path(__file__).parent / "arrays"
TOLERANCES = FOLDER / "tolerances.json"
KINDS: dict[str, Callable[[], dict[str, Callable[[], Arrays]]]] = {
    "simulations": simulations.episodes,
    "games": games.episodes,
    "results": results.episodes,
    "duels": duels.episodes,
}
ALL_KINDS = {**KINDS, "logs": results.real_logs}
"""With games on recorded logs, which are not in the repository."""
SEPARATOR = " | "
ROUNDING = 1e-11
"""Share of a quantity's largest value by which every machine may differ: the tolerances are measured on one, in a few
other arithmetics, and another processor rounds in its own way."""


def write(folder: Path, kind: str, made: dict[str, Arrays]) -> None:
    """Write the episodes of a kind."""
    folder.mkdir(parents=True, exist_ok=True)
    flat = {f"{name}{SEPARATOR}{key}": value for name, arrays in made.items() for key, value in arrays.items()}
    np.savez_compressed(folder / f"{kind}.npz", **flat)


def read(folder: Path, kind: str) -> dict[str, Arrays]:
    """The episodes of a kind as they were written."""
    made: dict[str, Arrays] = {}
    with np.load(folder / f"{kind}.npz") as archive:
        for key in archive.files:
            name, quantity = key.split(SEPARATOR)
            made.setdefault(name, {})[quantity] = archive[key]
    return made


def names(folder: Path, kind: str) -> list[str]:
    """Names of the episodes of a kind that were written, for which nothing is built."""
    with np.load(folder / f"{kind}.npz") as archive:
        return list(dict.fromkeys(key.split(SEPARATOR)[0] for key in archive.files))


def tolerances() -> dict[str, dict[str, float]]:
    """Of every quantity of every episode whose numbers may differ between machines; the others are equal."""
    return json.loads(TOLERANCES.read_text())


def differences(expected: Arrays, found: Arrays, allowed: dict[str, float] | None = None) -> list[str]:
    """What differs in an episode, in words.

    Args:
        expected: the golden arrays.
        found: what was played.
        allowed: tolerances of quantities, on another machine; None = on the same machine, where all bits are equal.
    """
    told = [f"{name}: missing" for name in expected.keys() - found.keys()]
    told += [f"{name}: new" for name in found.keys() - expected.keys()]
    for name in sorted(expected.keys() & found.keys()):
        one, two = expected[name], found[name]
        if one.shape != two.shape or one.dtype != two.dtype:
            told.append(f"{name}: {one.dtype}{one.shape} became {two.dtype}{two.shape}")
            continue
        gap = distance(one, two)
        if not gap <= (0.0 if allowed is None else max(allowed.get(name, 0.0), ROUNDING * largest(one))):
            where = np.argwhere(one != two)
            told.append(f"{name}: differs by up to {gap:.3g}, first at {tuple(where[0].tolist())} of {one.shape}")
    return told


def largest(values: np.ndarray) -> float:
    """The largest magnitude of an array of floating-point numbers; 0 for others, and where none is finite."""
    if values.dtype.kind != "f":
        return 0.0
    return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))


def distance(one: np.ndarray, two: np.ndarray) -> float:
    """The largest difference of two arrays; infinite where one is not finite and the other is or differs in kind."""
    if one.size == 0 or np.array_equal(one, two, equal_nan=one.dtype.kind == "f"):
        return 0.0
    if one.dtype.kind != "f":
        return np.inf
    known = np.isfinite(one) & np.isfinite(two)
    if not np.array_equal(one[~known], two[~known], equal_nan=True):
        return np.inf
    return float(np.max(np.abs(one[known].astype(np.float64) - two[known]), initial=0.0))
