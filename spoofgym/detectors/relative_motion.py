"""Tests of the relative motion of GNSS and an unaided inertial solution (FOI-R-5687)."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import Detector
from spoofgym.detectors.ring import Ring
from spoofgym.navigation.facts import INERTIAL_SOLUTION
from spoofgym.navigation.interface import Demands, Epoch
from spoofgym.specification import spell

DEFAULT_WINDOW = 20
DEFAULT_ARL0 = 1e5

FOI_THRESHOLDS: dict[tuple[int, int], float] = {(5, 5): 1.9, (20, 20): 4.5, (5, 1): 2.8, (20, 1): 9.7}
"""Thresholds in metres by (k, lag). The report describes its rule (the greatest of six clean runs, after the growth has
been subtracted) but prints no number; these came out of the rule on six clean runs of a drive rebuilt from the report.
"""


def relative_position(epoch: Epoch) -> Floats:
    """Position of the fix minus that of the unaided inertial solution, (N, 3), m ENU; NaN where there is no fix.

    The innovation knows residual = p_filter - p_GNSS, the view auxiliary_offset = p_unaided - p_filter; their sum is
    p_unaided - p_GNSS, and what the filter believes drops out. Before the game there is no unaided solution.
    """
    if epoch.view is None:
        return np.full((len(epoch.index), 3), np.nan)
    missing = epoch.index < 0
    if epoch.available is not None:
        missing |= ~epoch.available
    position = -(epoch.innovation.residual[:, :3] + epoch.view.auxiliary_offset)
    position[missing] = np.nan
    return np.asarray(position)


def distance(first: Floats, second: Floats) -> Floats:
    """Distance of positions (N, 3), in their unit, (N,)."""
    apart = first - second
    return np.asarray(np.sqrt(apart[:, 0] ** 2 + apart[:, 1] ** 2 + apart[:, 2] ** 2))


class RelativeMotion(Detector):
    """Alarm where GNSS and an unaided inertial solution have moved differently within a window (FOI-R-5687, 3.1, 5.1).

    With d = GNSS - INS (`relative_position`), over the last k epochs with a lag of l:

        T_i = Σ_{j=i-k+l..i} ‖d_j - d_{j-l}‖,      statistic = T_i - slope (t_i - t_0).

    l = k is the report's test (1), the first position against the last; l = 1 its test (2), ``pairwise``; a lag between
    is the test that the report leaves open. The inertial solution drifts, so that T grows in clean runs; the report
    subtracts its estimated linear growth. Here t_0 is epoch 0, and calibration fits the slope (least squares with a
    free intercept, through the mean of T over the epochs of clean runs) before it sets the threshold.

    Until k epochs of the game have come the statistic is 0, and so it is wherever a term of the window has no fix at
    either end. It does not depend on what the filter does with the fixes.

    ARL0 is calibrated on simulated clean runs, and 1e5 with nothing given. What is left of the drift makes late epochs
    likelier to alarm than early ones: it holds for whole games of the scenario, not for a part of one.

    Args:
        k: epochs that the window reaches back.
        lag: l, from 1 to k; None = k.
        slope: of the growth, m/s; None = fitted in calibration, or 0 beside a threshold.
        threshold: compared with the statistic, m.
        preset: ``foi``, `FOI_THRESHOLDS`; the slope is fitted in calibration.
        arl0: average run length between false alarms, epochs.

    Raises:
        ValueError: more than one of the last three is given, a preset for another window, or a value out of range.
    """

    PRESETS = ("foi",)
    KIND = "relative-motion"
    demands = Demands(auxiliary=True)
    needs = (INERTIAL_SOLUTION,)
    needs_view = True
    in_position = True

    def __init__(
        self,
        k: int = DEFAULT_WINDOW,
        lag: int | None = None,
        slope: float | None = None,
        threshold: float | None = None,
        preset: str | None = None,
        arl0: float | None = None,
    ) -> None:
        kind = self.KIND
        self.k = validation.epochs(kind, "k", k, 1)
        self.lag = self.k if lag is None else validation.epochs(kind, "lag", lag, 1)
        if self.lag > self.k:
            raise ValueError(f"{kind}: lag must be a whole number from 1 to k = {self.k}, got {lag!r}")
        validation.at_most_one(kind, threshold=threshold, preset=preset, arl0=arl0)
        self.slope = None if slope is None else validation.finite(kind, "slope", slope)
        self._preset = None if preset is None else self._of_preset(preset)
        if threshold is not None:
            self.threshold = validation.above(kind, "threshold", threshold)
            self.slope = 0.0 if self.slope is None else self.slope
        elif preset is not None:
            self.threshold = None if self.slope is None else self._preset
        else:
            self.target_arl0 = validation.average_run_length(kind, "arl0", DEFAULT_ARL0 if arl0 is None else arl0)
        self.lacks_slope = self.slope is None
        self._name = spell(
            kind,
            k=None if self.k == DEFAULT_WINDOW else self.k,
            lag=None if self.lag == self.k else self.lag,
            slope=None if slope is None else self.slope,
            threshold=None if threshold is None else self.threshold,
            preset=preset,
            arl0=None if self.target_arl0 == DEFAULT_ARL0 else self.target_arl0,
        )

    def _of_preset(self, preset: str) -> float:
        validation.one_of(self.KIND, "preset", preset, self.PRESETS)
        if (self.k, self.lag) not in FOI_THRESHOLDS:
            valid = ", ".join(f"k={k} with lag={lag}" for k, lag in FOI_THRESHOLDS)
            raise ValueError(f"{self.KIND}: preset foi is for {valid}, got k={self.k} with lag={self.lag}")
        return FOI_THRESHOLDS[self.k, self.lag]

    @property
    def name(self) -> str:
        """The specification that builds this detector."""
        return self._name

    def set_slope(self, slope: float) -> None:
        """Take the growth of clean runs, m/s, from calibration; the threshold of a preset then holds."""
        self.slope = validation.finite(self.name, "slope", slope)
        self.lacks_slope = False
        self.threshold = self.threshold if self._preset is None else self._preset

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the positions of the lag and the terms of the sum."""
        self._positions = Ring(num_runs, self.lag + 1, 3, empty=np.nan)
        self._changes = Ring(num_runs, self.k - self.lag + 1)
        self._start = np.full(num_runs, np.nan)

    def reset(self, runs: Runs) -> None:
        """Forget the positions of these runs."""
        self._positions.reset(runs)
        self._changes.reset(runs)
        self._start[runs] = np.nan

    def update(self, epoch: Epoch) -> Floats:
        """T less its growth, (N,), m; 0 where the window is not complete."""
        position = relative_position(epoch)
        self._positions.push(position)
        # a position that is missing makes its terms NaN, and these the sum, for as long as they are in the window
        self._changes.push(distance(position, self._positions.oldest))
        total = np.add.reduce(self._changes.values, axis=1)
        return np.where(np.isnan(total), 0.0, total - self._growth(epoch))

    def _growth(self, epoch: Epoch) -> Floats:
        """Slope times the time since epoch 0, (N,), m."""
        self._start = np.where(np.isnan(self._start) | (epoch.index <= 0), epoch.time, self._start)
        return np.asarray((self.slope or 0.0) * (epoch.time - self._start))
