"""A test whether the codes of the satellites move as their carriers say."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.detectors.raim import code_present
from spoofgym.detectors.ring import Ring
from spoofgym.navigation.facts import RANGES, FilterFacts
from spoofgym.navigation.interface import Epoch

DEFAULT_WINDOW = 20


class CodeMinusCarrier(ThresholdDetector):
    """Alarm where codes and carriers part: root mean square over the satellites of the change in code minus carrier, m.

    Code and carrier of a satellite have geometry and clocks in common. Their difference changes by noise, multipath and
    twice the ionosphere alone, unless a spoofer moves the code and not the Doppler, or pulls a receiver apart that does
    not follow. Where range rates are measured, their integral (trapezium) takes the place of the carrier. The change of
    a satellite is the mean over the last n epochs less the mean over the n before them; a satellite that is lost begins
    anew. Satellites with 2 n epochs count; without any the statistic is 0.

    White code noise σ alone leaves a mean square of 2 σ² / n; a code that parts by v m/s shows as v n Δt. A spoofer
    whose carriers follow leaves no trace.

    The filter does not matter, nor what a defender does with the ranges. ARL0 is calibrated. The window is ours.

    Args:
        n: epochs of each of the two windows.
        threshold: compared with the statistic, m.
        arl0: average run length between false alarms, epochs; 1e5 with nothing given.

    Raises:
        ValueError: both of the last two are given, or a value is out of range.
    """

    kind = "code-minus-carrier"
    needs = (RANGES,)
    needs_view = True

    def __init__(self, n: int = DEFAULT_WINDOW, threshold: float | None = None, arl0: float | None = None) -> None:
        self.n = validation.epochs(self.kind, "n", n, 1)
        self.memory = 2 * self.n - 1
        self.set_up(threshold, arl0, n=self.n)

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the two windows of every satellite."""
        slots = dimension // 2
        self._recent, self._before = Ring(num_runs, self.n, slots), Ring(num_runs, self.n, slots)
        self._level = np.zeros((num_runs, slots))
        self._last = np.zeros((num_runs, 2 * slots))
        self._age = np.zeros((num_runs, slots), dtype=np.int64)
        self._time = np.zeros(num_runs)

    def know(self, facts: FilterFacts) -> None:
        """Learn whether range rates are measured, or the carrier."""
        self._carrier = facts.observable == "carrier"

    def reset(self, runs: Runs) -> None:
        """Forget the satellites of these runs."""
        self._recent.reset(runs)
        self._before.reset(runs)
        self._level[runs], self._age[runs] = 0.0, 0

    def update(self, epoch: Epoch) -> Floats:
        """Root mean square of the changes, (N,), m."""
        if epoch.view is None:
            return np.zeros(len(epoch.index))
        present = code_present(epoch.innovation)
        if epoch.available is not None:
            present = present & epoch.available[:, None]
        self._level += np.where(present & (self._age > 0), self._parted(epoch), 0.0)
        self._age = np.where(present, self._age + 1, 0)
        self._last, self._time = epoch.view.measured, epoch.time.copy()
        self._before.push(self._recent.oldest.copy())
        self._recent.push(self._level.copy())
        change = (self._recent.values.sum(axis=1) - self._before.values.sum(axis=1)) / self.n
        return _root_mean_square(change, self._age >= 2 * self.n)

    def _parted(self, epoch: Epoch) -> Floats:
        """Change of code minus carrier since the epoch before, (N, S), m."""
        assert epoch.view is not None
        slots = self._level.shape[1]
        measured = epoch.view.measured
        code = measured[:, :slots] - self._last[:, :slots]
        if self._carrier:
            return np.asarray(code - (measured[:, slots:] - self._last[:, slots:]))
        elapsed = (epoch.time - self._time)[:, None]
        return np.asarray(code - 0.5 * elapsed * (measured[:, slots:] + self._last[:, slots:]))


def _root_mean_square(values: Floats, counted: Flags) -> Floats:
    """Of the values that count in each row, (N,); 0 without any."""
    total, count = np.zeros(len(values)), np.zeros(len(values))
    for column, there in zip(values.T, counted.T, strict=True):
        total += np.where(there, column**2, 0.0)
        count += there
    return np.asarray(np.sqrt(total / np.maximum(count, 1.0)))
