"""Scripted spoofers: the baselines that a learned one must beat."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline


class OffsetSequence(Attack):
    """An open-loop attack: the same offsets in every run."""

    def __init__(self, name: str, offsets: Floats) -> None:
        """Play ``offsets``, (K, 3), m ENU, at epochs 1..K."""
        self._name = name
        self._offsets = np.concatenate([np.zeros((1, 3)), offsets])

    @property
    def name(self) -> str:
        """What reports call it; no specification builds it."""
        return self._name

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Fit the attack to a game.

        Raises:
            ValueError: the sequence has not one offset for each epoch.
        """
        super().bind(timeline, num_runs)
        if len(self._offsets) != timeline.num_epochs + 1:
            raise ValueError(
                f"attack {self.name!r} has {len(self._offsets) - 1} offsets, the game {timeline.num_epochs} epochs"
            )

    def offset(self, clock: Clock) -> Floats:
        """The offset of each run's epoch, (N, 3), m ENU."""
        return self._offsets[clock.index]


class RandomRates(Attack):
    """Uniformly random rates within the drag-off limits: the spoofer that knows nothing and plans nothing."""

    def __init__(self, drag_off_rate: tuple[float, float, float]) -> None:
        """Draw each axis within ± ``drag_off_rate``, m/s."""
        self._rate = np.array(drag_off_rate)

    @property
    def name(self) -> str:
        """What reports call it."""
        return "random"

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Fit the attack to a game."""
        super().bind(timeline, num_runs)
        self._offsets = np.zeros((num_runs, timeline.num_epochs + 1, 3))

    def reset(self, runs: Runs, streams: RunStreams) -> None:
        """Draw the rates of new episodes."""
        for run in runs:
            draws = streams(run, "opponent").uniform(-1.0, 1.0, (self._offsets.shape[1] - 1, 3))
            self._offsets[run, 1:] = np.cumsum(draws * self._rate * self._timeline.intervals[:, None], axis=0)

    def offset(self, clock: Clock) -> Floats:
        """The offset of each run's epoch, (N, 3), m ENU."""
        return self._offsets[np.arange(len(clock.index)), clock.index]
