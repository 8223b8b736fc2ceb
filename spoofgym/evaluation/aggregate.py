"""Several runs of one setting taken together: mean and interquartile mean, with intervals over seeds and games."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import trim_mean

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.policies.learned import LearnedPolicy

RESAMPLES = 2000
CHUNK = 100
"""Resamples that are drawn at once: they take this many times the memory of the games."""
QUARTER = 0.25


@dataclass(frozen=True)
class Aggregate:
    """What R runs of one setting are worth.

    Attributes:
        runs: R.
        games: of each run, the same ones for all.
        mean: over runs and games.
        mean_interval: its 95 % interval.
        iqm: interquartile mean over the runs: of the means of the runs, without the lowest and highest quarter (Agarwal
            et al. 2021).
        iqm_interval: its 95 % interval.
    """

    runs: int
    games: int
    mean: float
    mean_interval: tuple[float, float]
    iqm: float
    iqm_interval: tuple[float, float]


def aggregate(
    values: Floats, strata: ArrayLike | None = None, resamples: int = RESAMPLES, seed: int = 0
) -> Aggregate:
    """Take runs together, with intervals by a stratified bootstrap.

    Each resample draws R of the runs and as many games as there are, both with replacement; the games are drawn within
    their strata, and are the same for all runs, as they were when they were played. So an interval covers other seeds
    of the training and other games.

    Args:
        values: of every run and game, (R, n).
        strata: of each game, (n,): the attack that it met, say; None = all games are alike.
        resamples: of the bootstrap.
        seed: of its random numbers.

    Raises:
        ValueError: no runs or games, or strata of other games.
    """
    values = np.asarray(values, dtype=float)
    if values.ndim != 2 or not values.size:
        raise ValueError(f"aggregate: values must be of shape (runs, games), got {values.shape}")
    runs, games = values.shape
    groups = _groups(strata, games)
    resamples = validation.whole("aggregate", "resamples", resamples, 1)
    rng = np.random.default_rng(seed)
    means, iqms = [], []
    for first in range(0, resamples, CHUNK):
        size = min(CHUNK, resamples - first)
        drawn = np.zeros((size, games))
        for group in groups:
            drawn[:, group] = rng.multinomial(len(group), np.full(len(group), 1.0 / len(group)), size)
        scores = np.take_along_axis(drawn @ values.T / games, rng.integers(runs, size=(size, runs)), axis=1)
        means.append(scores.mean(axis=1))
        iqms.append(trim_mean(scores, QUARTER, axis=1))
    scores = values.mean(axis=1)
    return Aggregate(
        runs,
        games,
        float(scores.mean()),
        _interval(np.concatenate(means)),
        float(trim_mean(scores, QUARTER)),
        _interval(np.concatenate(iqms)),
    )


def aggregate_row(names: Sequence[str], found: Aggregate) -> dict[str, Any]:
    """A row of a report.

    Args:
        names: of the runs.
        found: what they are worth together, m.
    """
    return {
        "runs": list(names),
        "games": found.games,
        "mean_m": found.mean,
        "ci95_m": list(found.mean_interval),
        "iqm_m": found.iqm,
        "iqm_ci95_m": list(found.iqm_interval),
    }


def of_one_setting(policies: Sequence[LearnedPolicy]) -> list[list[str]]:
    """The names of policies that were trained on one environment, so that seeds and chance alone tell them apart.

    Those that have no other beside them are left out.
    """
    found: dict[str, list[str]] = {}
    for policy in policies:
        setting: Mapping[str, Any] = policy.configuration
        found.setdefault(json.dumps(dict(setting), sort_keys=True, default=str), []).append(policy.name)
    return [names for names in found.values() if len(names) > 1]


def _groups(strata: ArrayLike | None, games: int) -> list[np.ndarray]:
    if strata is None:
        return [np.arange(games)]
    given = np.asarray(strata)
    if given.shape != (games,):
        raise ValueError(f"aggregate: strata must be those of {games} games, got shape {given.shape}")
    return [np.flatnonzero(given == stratum) for stratum in np.unique(given)]


def _interval(found: Floats) -> tuple[float, float]:
    low, high = np.quantile(found, (0.025, 0.975))
    return float(low), float(high)
