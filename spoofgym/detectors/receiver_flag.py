"""A model of a receiver's own spoofing flag, which looks at signals, as no other detector does."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.navigation.interface import Epoch

STREAM = "receiver flag"
DETECTS, LASTS, FLICKERS = 0.9, 1.0, 30.0
"""Share of transitions that it shows; mean time that it stays on, and between firings of counterfeit signals, s."""


class ReceiverFlag(ThresholdDetector):
    """The receiver's own flag: it fires where counterfeit signals take over or go, and flickers in between.

    Users report that such a flag comes at the transition, lasts about a second, comes and goes while the spoofing goes
    on, and comes without any (PX4-Autopilot issue 21244 and pull request 23366, betaflight issue 14274, Safecast issue
    58). The flag is a chain of two states. From one fix to the next it goes on with the probability ``detects`` where
    signals have become counterfeit or authentic, 1 - exp(-Δ / flickers) while they are counterfeit, and 1 / arl0 while
    they are authentic; it goes off with 1 - exp(-Δ / lasts). The second of ``lasts`` is from the reports; no report
    states figures for the others, which are assumed.

    It is the one detector that is told whether the fix is spoofed: it stands for a receiver that measures powers
    and correlations, which are not simulated. So it knows nothing of how strong an attack is. Its statistic is 1 while
    the flag is on, else 0; without a simulated game it is 0.

    Args:
        detects: probability that it fires at a transition.
        lasts: mean time that it stays on, s.
        flickers: mean time between firings while signals are counterfeit, s.
        arl0: mean number of clean epochs before it fires without reason; exact, nothing is calibrated.

    Raises:
        ValueError: a value is out of range.
    """

    kind = "receiver-flag"
    needs_view = True

    def __init__(
        self, detects: float = DETECTS, lasts: float = LASTS, flickers: float = FLICKERS, arl0: float | None = None
    ) -> None:
        self.detects = validation.share(self.kind, "detects", detects)
        self.lasts = validation.above(self.kind, "lasts", lasts)
        self.flickers = validation.above(self.kind, "flickers", flickers)
        self.set_up(None, arl0, detects=self.detects, lasts=self.lasts, flickers=self.flickers)
        assert self.target_arl0 is not None
        self._false = 1.0 / self.target_arl0
        self.threshold, self.arl0, self.target_arl0, self.calibrated = 0.5, self.target_arl0, None, True
        self._game: Any = None

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the flags of ``num_runs`` runs."""
        epochs = 0 if self._game is None else self._game.scenario.timeline.num_epochs + 1
        self._on = np.zeros(num_runs, dtype=bool)
        self._counterfeit = np.zeros(num_runs, dtype=bool)
        self._draws = np.zeros((num_runs, epochs))

    def join(self, simulation: Any) -> None:
        """Take the game whose signals the receiver gets."""
        self._game = simulation
        self.bind(simulation.num_runs, simulation.scenario.dimension)

    def update(self, epoch: Epoch) -> Floats:
        """1 while the flag is on, else 0, (N,)."""
        if self._game is None or epoch.view is None:
            return np.zeros(len(epoch.index))
        runs = epoch.view.runs
        begins = epoch.index <= 0
        self._on[begins] = self._counterfeit[begins] = False
        for place in np.flatnonzero(epoch.index == 0).tolist():
            self._game.streams(int(runs[place]), STREAM).random(out=self._draws[place])
        counterfeit = self._game.attacked[runs] & (epoch.index > 0)
        draw = self._draws[np.arange(len(runs)), np.maximum(epoch.index, 0)]
        self._on[:] = (draw < self._chance(counterfeit)) & (epoch.index >= 0)
        self._counterfeit[:] = counterfeit
        return self._on.astype(np.float64)

    def _chance(self, counterfeit: Flags) -> Floats:
        """Probability that the flag is on at this fix, by where it was and what the signals are, (N,)."""
        interval = self._game.scenario.timeline.interval
        goes_on = np.where(counterfeit, -math.expm1(-interval / self.flickers), self._false)
        goes_on[counterfeit != self._counterfeit] = self.detects
        return np.where(self._on, np.maximum(math.exp(-interval / self.lasts), goes_on), goes_on)
