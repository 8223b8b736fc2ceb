"""Scores of a benchmark: of every task, and one summary with its interval.

The summary is the interquartile mean over tasks and training seeds, its interval that of a stratified bootstrap, as in
Agarwal, Schwarzer, Castro, Courville and Bellemare, "Deep reinforcement learning at the edge of the statistical
precipice", NeurIPS 2021 (``rliable``). There a run gives one number per task. Here a number is a mean over games, so
games are resampled, too: within each match by themselves, and training seeds for all tasks together, since a policy is
the same in all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.evaluation.benchmark import BenchmarkTask

OWNER = "benchmark"
TRIMMED = 0.25
"""Share that the interquartile mean leaves out at either end."""
PERCENTILES = (2.5, 97.5)
BATCH = 100
"""Resamples that are drawn together."""


def interquartile_mean(scores: Floats) -> Floats:
    """The mean of the middle half.

    As in ``scipy.stats.trim_mean``, a quarter of the scores, rounded down, is left out at either end.

    Args:
        scores: (..., n).

    Returns:
        (...).

    Raises:
        ValueError: there are none.
    """
    values = np.sort(np.asarray(scores, dtype=np.float64), axis=-1)
    if values.ndim == 0 or values.shape[-1] == 0:
        raise ValueError(f"{OWNER}: an interquartile mean needs at least one score")
    cut = int(TRIMMED * values.shape[-1])
    return np.asarray(values[..., cut : values.shape[-1] - cut].mean(axis=-1))


@dataclass(frozen=True)
class Interval:
    """An estimate and its 95 % bootstrap interval."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, value: Any, resamples: Floats) -> Interval:
        """Of the values of the resamples, (B,)."""
        low, high = np.percentile(resamples, PERCENTILES)
        return cls(float(value), float(low), float(high))

    def content(self) -> dict[str, Any]:
        """As plain values."""
        return {"value": self.value, "ci95": [self.low, self.high]}

    def __str__(self) -> str:
        return f"{self.value:.3f} [{self.low:.3f}, {self.high:.3f}]"


class Scores:
    """What the policies of one method were worth: one for each training seed.

    Attributes:
        tasks: that were played.
        means: of each match, (policies, matches), in the order of the tasks.
    """

    def __init__(
        self, tasks: Sequence[BenchmarkTask], worth: Sequence[Sequence[Floats]], resamples: int, seed: int = 0
    ) -> None:
        """Score games.

        Args:
            tasks: T.
            worth: of each task, of each of its matches: what every game was worth, (policies, games).
            resamples: of the bootstrap, B.
            seed: of the bootstrap.

        Raises:
            ValueError: no tasks, or no resamples.
        """
        if not tasks:
            raise ValueError(f"{OWNER}: there is no task to score")
        self.tasks = tuple(tasks)
        self._resamples = validation.whole(OWNER, "resamples", resamples, 1, 10**6)
        matches = [match for task in worth for match in task]
        ends = np.cumsum([len(task) for task in worth])
        self._places = [slice(end - len(task), end) for end, task in zip(ends.tolist(), worth, strict=True)]
        self.means: Floats = np.array([match.mean(axis=1) for match in matches]).T
        self._drawn = _resampled(matches, self._resamples, np.random.default_rng(seed))

    @property
    def policies(self) -> int:
        """R, training seeds."""
        return len(self.means)

    def of_matches(self, task: int) -> Floats:
        """Means of the matches of a task, (policies, matches of the task)."""
        found: Floats = self.means[:, self._places[task]]
        return found

    def score(self, task: int) -> Interval:
        """Of a task, in its unit: the mean over policies of the largest mean of its matches."""
        return Interval.of(self._raw[:, task].mean(), self._raw_drawn[..., task].mean(axis=1))

    def normalised(self, task: int) -> Interval:
        """Of a task, on the line on which its references are 0 and 1."""
        return Interval.of(self._line[:, task].mean(), self._line_drawn[..., task].mean(axis=1))

    def interquartile_mean(self, belongs: Callable[[BenchmarkTask], bool] = lambda _: True) -> Interval | None:
        """Over all policies and the tasks that belong to a group; None where none does."""
        return self._over(interquartile_mean, belongs)

    def mean(self, belongs: Callable[[BenchmarkTask], bool] = lambda _: True) -> Interval | None:
        """The plain mean; otherwise as `interquartile_mean`."""
        return self._over(lambda scores: scores.mean(axis=-1), belongs)

    def _over(self, what: Callable[[Floats], Floats], belongs: Callable[[BenchmarkTask], bool]) -> Interval | None:
        chosen = [place for place, task in enumerate(self.tasks) if belongs(task)]
        if not chosen:
            return None
        drawn = self._line_drawn[..., chosen].reshape(self._resamples, -1)
        return Interval.of(what(self._line[:, chosen].reshape(-1)), what(drawn))

    @cached_property
    def _raw(self) -> Floats:
        """Scores of the policies, (R, T)."""
        return self._largest(self.means)

    @cached_property
    def _raw_drawn(self) -> Floats:
        """Scores of the resamples, (B, R, T)."""
        return self._largest(self._drawn)

    @cached_property
    def _line(self) -> Floats:
        """Normalised scores of the policies, (R, T)."""
        return self._normalised(self._raw)

    @cached_property
    def _line_drawn(self) -> Floats:
        """Normalised scores of the resamples, (B, R, T)."""
        return self._normalised(self._raw_drawn)

    def _largest(self, means: Floats) -> Floats:
        """The largest mean of the matches of each task, (..., matches) to (..., T)."""
        return np.stack([means[..., place].max(axis=-1) for place in self._places], axis=-1)

    def _normalised(self, scores: Floats) -> Floats:
        return np.stack([task.normalised(scores[..., i]) for i, task in enumerate(self.tasks)], axis=-1)


def _resampled(matches: Sequence[Floats], resamples: int, rng: np.random.Generator) -> Floats:
    """Means of games that are drawn with replacement within each match, of policies drawn for all matches together.

    Game i is seeded alike for every policy, so games are drawn for all policies of a match together.

    Args:
        matches: what every game was worth, (R, games) each.
        resamples: B.
        rng: draws.

    Returns:
        (B, R, matches).
    """
    policies = len(matches[0])
    drawn = rng.integers(policies, size=(resamples, policies))
    result = np.empty((resamples, policies, len(matches)))
    rows: NDArray[np.int64] = np.arange(resamples)[:, None]
    for place, worth in enumerate(matches):
        means = np.empty((resamples, policies))
        for first in range(0, resamples, BATCH):
            size = min(BATCH, resamples - first)
            games = rng.integers(worth.shape[1], size=(size, worth.shape[1]))
            means[first : first + size] = np.stack([one[games].mean(axis=1) for one in worth], axis=1)
        result[:, :, place] = means[rows, drawn]
    return result
