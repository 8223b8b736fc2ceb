"""Chi-square tests of the innovation: of one epoch, and summed over a window.

Under a matched filter the normalised innovation squared of a fix of dimension m is chi-square with m degrees of
freedom, and independent from epoch to epoch. If ranges are measured, m is the number of ranges of the epoch. It changes
as satellites rise and set. The statistic is then converted to the degrees of freedom of all slots (`at_all_degrees`).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy import special

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import Detector
from spoofgym.detectors.ring import MovingSum, Ring
from spoofgym.navigation.interface import Epoch
from spoofgym.specification import spell

DEFAULT_P_FA = 1e-5
DEFAULT_ARL0 = 1e5
DEFAULT_WINDOW = 20

SHADMEHRI_THRESHOLD = 25.9
"""Chi-square quantile for 3 degrees of freedom at 1e-5 as published (Shadmehri and Esfanjani 2025, eq 15)."""

FOI_THRESHOLDS: dict[int, float] = {6: 1.0, 21: 2.0}
"""Thresholds of the windowed test by n = k + 1 (FOI-R-5687, table 4): the greatest value of clean runs, rounded up. The
report's receiver states three metres per axis and errs by far less, so that its nis hardly ever come near chi-square.
"""

WINDOWED_THRESHOLDS: dict[tuple[int, int, float], float] = {(3, 20, 1e5): 114.41}
"""Thresholds of the windowed test by (m, n, ARL0), for white innovations. A row is reproduced, with its interval, by
``python -m spoofgym.calibration --dimension 3 --window 20 --arl0 1e5``; the 95 % interval of their ARL0 is ± 3 %.
"""


def quantile(p_fa: float, degrees: int) -> float:
    """The value that chi-square with ``degrees`` degrees of freedom exceeds with probability ``p_fa``."""
    return float(2.0 * special.gammainccinv(degrees / 2.0, p_fa))


def exceedance(threshold: float, degrees: int) -> float:
    """The probability that chi-square with ``degrees`` degrees of freedom exceeds the threshold."""
    return float(special.gammaincc(degrees / 2.0, threshold / 2.0))


@lru_cache(maxsize=64)
def quantile_ratios(p_fa: float, most: int) -> Floats:
    """T(most) / T(d) for d = 0..most degrees of freedom, (most + 1,), with T the quantile at ``p_fa``.

    The first one, and all of them where there is no such quantile, are 1.
    """
    quantiles = 2.0 * special.gammainccinv(0.5 * np.arange(1, most + 1), p_fa)
    ratios = np.ones(most + 1)
    if np.all(np.isfinite(quantiles) & (quantiles > 0.0)):
        ratios[1:] = quantiles[-1] / quantiles
    ratios.setflags(write=False)
    return ratios


def at_all_degrees(statistic: Floats, degrees: Runs, p_fa: float, most: int) -> Floats:
    """A sum of squares with varying degrees of freedom, brought to ``most`` of them: q T(most) / T(degrees).

    It exceeds T(most) exactly where q exceeds its own quantile T(degrees), so that one threshold serves all epochs.

    Args:
        statistic: q, (N,), zero where there are no degrees of freedom.
        degrees: of each, (N,), up to ``most``.
        p_fa: the probability of exceedance at which the quantiles are taken.
        most: all there can be.
    """
    return statistic * quantile_ratios(p_fa, most).take(degrees)


def measured_degrees(epoch: Epoch) -> Runs:
    """Degrees of freedom of the nis, (N,); 0 where there is no fix."""
    degrees = epoch.innovation.degrees
    return degrees if epoch.available is None else degrees * epoch.available


def nominal_p_fa(target_arl0: float | None, threshold: float | None, degrees: int) -> float:
    """The probability of exceedance that a threshold is for: 1 / ARL0 where one is asked for, else that of chi-square.

    Raises:
        ValueError: neither is given.
    """
    if target_arl0 is not None:
        return 1.0 / target_arl0
    if threshold is None:
        raise ValueError("a test needs a threshold or an arl0")
    return exceedance(threshold, degrees)


class Snapshot(Detector):
    """Chi-square test of each epoch by itself: statistic nis, alarm above the threshold.

    With nothing given the threshold is the published 25.9 for m = 3 (preset ``shadmehri``), and the quantile at 1e-5
    for m = 6. The statistics of a matched filter are independent, so ARL0 = 1 / P_FA exactly, and ``arl0`` needs no
    simulation there. Of ranges m is that of all slots; epochs with fewer are brought to it (`at_all_degrees`).

    Args:
        threshold: compared with nis, no unit.
        p_fa: probability of a false alarm per epoch; the threshold is the chi-square quantile.
        preset: ``shadmehri``, a published threshold.
        arl0: average run length between false alarms, epochs.

    Raises:
        ValueError: more than one of these is given, or a value is out of range.
    """

    PRESETS = ("shadmehri",)

    def __init__(
        self,
        threshold: float | None = None,
        p_fa: float | None = None,
        preset: str | None = None,
        arl0: float | None = None,
    ) -> None:
        validation.at_most_one("snapshot", threshold=threshold, p_fa=p_fa, preset=preset, arl0=arl0)
        self.threshold = None if threshold is None else validation.above("snapshot", "threshold", threshold)
        self.target_arl0 = None if arl0 is None else validation.average_run_length("snapshot", "arl0", arl0)
        self._p_fa = None if p_fa is None else validation.probability("snapshot", "p_fa", p_fa)
        self._preset = None if preset is None else validation.one_of("snapshot", "preset", preset, self.PRESETS)
        self._name = spell("snapshot", threshold=self.threshold, p_fa=self._p_fa, preset=preset, arl0=self.target_arl0)
        self._given = self.threshold

    @property
    def name(self) -> str:
        """The specification that builds this detector."""
        return self._name

    def bind(self, num_runs: int, dimension: int) -> None:
        """Set the threshold for fixes of ``dimension`` m.

        Raises:
            ValueError: a preset published for another dimension.
        """
        if not self.calibrated:
            self.threshold = self._threshold(dimension)
            p_fa = exceedance(self.threshold, dimension)
            self.arl0 = self.target_arl0 or (1.0 / p_fa if p_fa > 0.0 else None)
        self._dimension = dimension
        self._nominal = nominal_p_fa(self.target_arl0, self.threshold, dimension)

    def update(self, epoch: Epoch) -> Floats:
        """The normalised innovation squared, (N,)."""
        if epoch.innovation.present is None:
            return epoch.innovation.nis
        return at_all_degrees(epoch.innovation.nis, measured_degrees(epoch), self._nominal, self._dimension)

    def _threshold(self, dimension: int) -> float:
        if self._given is not None:
            return self._given
        if self._p_fa is not None:
            return quantile(self._p_fa, dimension)
        if self.target_arl0 is not None:
            return quantile(1.0 / self.target_arl0, dimension)
        if self._preset == "shadmehri" and dimension != 3:
            raise ValueError(f"{self.name}: published for fixes of dimension 3, got {dimension}; give p_fa or arl0")
        return SHADMEHRI_THRESHOLD if dimension == 3 else quantile(DEFAULT_P_FA, dimension)


class Windowed(Detector):
    """Chi-square test of a sliding window: the sum of the nis of the last n epochs, m n degrees of freedom.

    ``n`` counts terms. FOI-R-5687's k counts the epochs before the present one: its test (3) sums n = k + 1 terms, so
    that fixes of position give it 3 (k + 1) degrees of freedom, not the 3k that its text states. Until n epochs have
    come the sum is over what there is; an epoch without a fix counts as zero. Of ranges the degrees of freedom are the
    measurements in the window, and the sum is brought to m n (`at_all_degrees`): with ``p_fa`` it is the cumulative
    innovation (CI) of Kujur 2024, eq 4.

    Windows overlap, so ARL0 is not 1 / P_FA: it is calibrated. With nothing given it is 1e5. Thresholds in
    `WINDOWED_THRESHOLDS` are taken from there; for any other combination ``threshold`` is None until calibration sets
    it.

    Args:
        n: terms of the sum, epochs.
        threshold: compared with the sum, no unit.
        p_fa: probability that the statistic of one epoch exceeds the threshold; ``arl0`` then stays unknown.
        preset: ``shadmehri``, the published 25.9 for the mean of the window, so 25.9 n for the sum. It is the quantile
            of a single epoch: the false-alarm probability of a mean of 5 is 3e-20 instead of 1e-5. ``foi``: the
            empirical 1 for n = 6 and 2 for n = 21 (k = 5 and 20), for a receiver that over-states its errors as FOI's
            does; with an honest covariance nearly every epoch exceeds them.
        arl0: average run length between false alarms, epochs.

    Raises:
        ValueError: more than one of the last four is given, a preset for another n, or a value is out of range.
    """

    PRESETS = ("shadmehri", "foi")

    def __init__(
        self,
        n: int = DEFAULT_WINDOW,
        threshold: float | None = None,
        p_fa: float | None = None,
        preset: str | None = None,
        arl0: float | None = None,
    ) -> None:
        self.n = validation.epochs("windowed", "n", n, 1)
        self.memory = self.n - 1
        validation.at_most_one("windowed", threshold=threshold, p_fa=p_fa, preset=preset, arl0=arl0)
        self.threshold = None if threshold is None else validation.above("windowed", "threshold", threshold)
        self._p_fa = None if p_fa is None else validation.probability("windowed", "p_fa", p_fa)
        self._preset = None if preset is None else validation.one_of("windowed", "preset", preset, self.PRESETS)
        if preset == "foi" and self.n not in FOI_THRESHOLDS:
            valid = " and ".join(str(terms) for terms in FOI_THRESHOLDS)
            raise ValueError(f"windowed: preset foi is for n = {valid} (k + 1), got {self.n}")
        if threshold is None and p_fa is None and preset is None:
            self.target_arl0 = validation.average_run_length("windowed", "arl0", DEFAULT_ARL0 if arl0 is None else arl0)
        self._name = spell(
            "windowed",
            n=None if self.n == DEFAULT_WINDOW else self.n,
            threshold=self.threshold,
            p_fa=self._p_fa,
            preset=preset,
            arl0=None if self.target_arl0 == DEFAULT_ARL0 else self.target_arl0,
        )
        self._given = self.threshold

    @property
    def name(self) -> str:
        """The specification that builds this detector."""
        return self._name

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the window, and set the threshold for fixes of ``dimension`` m where it is known.

        Raises:
            ValueError: a preset published for another dimension.
        """
        self._ring = Ring(num_runs, self.n)
        self._degrees = MovingSum(num_runs, self.n)
        if not self.calibrated:
            self.threshold = self._threshold(dimension)
            self.arl0 = None if self.threshold is None else self.target_arl0
        self._most = dimension * self.n
        self._nominal = nominal_p_fa(self.target_arl0, self.threshold, self._most)

    def reset(self, runs: Runs) -> None:
        """Empty the windows of these runs."""
        self._ring.reset(runs)
        self._degrees.reset(runs)

    def update(self, epoch: Epoch) -> Floats:
        """The sum over the window, (N,), added up anew at every epoch so that no rounding error accumulates."""
        self._ring.push(epoch.innovation.nis)
        total = np.add.reduce(self._ring.values, axis=1)
        if epoch.innovation.present is None:
            return total
        degrees = self._degrees.push(measured_degrees(epoch).astype(np.float64))
        return at_all_degrees(total, degrees.astype(np.int64), self._nominal, self._most)

    def _threshold(self, dimension: int) -> float | None:
        if self._p_fa is not None:
            return quantile(self._p_fa, dimension * self.n)
        if self._preset is not None:
            if dimension != 3:
                raise ValueError(f"{self.name}: published for fixes of dimension 3, got {dimension}; give p_fa or arl0")
            return FOI_THRESHOLDS[self.n] if self._preset == "foi" else SHADMEHRI_THRESHOLD * self.n
        if self.target_arl0 is not None:
            return WINDOWED_THRESHOLDS.get((dimension, self.n, self.target_arl0))
        return self._given
