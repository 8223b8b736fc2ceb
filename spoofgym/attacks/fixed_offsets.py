"""The base class of attacks whose offsets depend on the game alone and do not differ between runs or episodes."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline


class FixedOffsets(Attack):
    """An attack whose offsets are known as soon as the vehicle's motion, or the victim's filter, is.

    A subclass gives all of them to `_lay` once, in `follow` or in `study`.
    """

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Fit the attack to a game.

        Raises:
            ValueError: the attack starts before the game or after its end.
        """
        super().bind(timeline, num_runs)
        self._offsets = np.zeros((timeline.num_epochs + 1, 3))

    def episode(self, runs: Runs, streams: RunStreams) -> Floats:
        """The same offsets in every run and episode, (n, K+1, 3), m ENU."""
        return np.broadcast_to(self._offsets, (len(runs), *self._offsets.shape))

    def offset(self, clock: Clock) -> Floats:
        """This epoch's offset, (N, 3), m ENU."""
        return self._offsets[np.maximum(clock.index, 0)]

    def _since(self) -> Floats:
        """Time of epochs 0..K since the onset, (K+1,), s; negative before it."""
        return self._timeline.times - self._onset

    def _lay(self, offsets: Floats) -> None:
        """Keep the offsets (K+1, 3), m ENU, of the epochs after the onset; those before it are zero."""
        after = self._since() > 1e-6 * self._timeline.interval
        self._offsets[:] = np.where(after[:, None], offsets, 0.0)
