"""Thresholds at a stated ARL₀, the average run length between false alarms.

ARL₀ = clean epochs at risk / first alarms, each run counted until its first alarm or its end, memories warm (a clean
burn-in without an alarm), then restarted with new noise. What every threshold would have done is kept from one pass.

``python -m spoofgym.calibration`` prints the thresholds that `spoofgym.detectors.chi_square` ships.
"""

from __future__ import annotations

import argparse
import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import Detector
from spoofgym.detectors.chi_square import DEFAULT_ARL0, DEFAULT_WINDOW, Windowed
from spoofgym.navigation.interface import Epoch, Innovation
from spoofgym.scenario import Scenario
from spoofgym.simulation import Simulation

RUNS = 5000
FIRST_ALARMS = 200
CONFIDENCE = 0.95

CleanStatistics = Callable[[Detector, int, np.random.Generator], tuple[Floats, Floats]]
"""(detector, runs, randomness) -> its statistic in the burn-in (n, B) and in the clean epochs after it (n, K)."""


@dataclass(frozen=True)
class Calibration:
    """A threshold and the ARL₀ measured at it.

    Attributes:
        threshold: compared with the statistic.
        arl0: epochs at risk per first alarm.
        interval: its 95 % Poisson interval, epochs.
        first_alarms: how many.
        epochs_at_risk: clean epochs.
    """

    threshold: float
    arl0: float
    interval: tuple[float, float]
    first_alarms: int
    epochs_at_risk: int


def poisson_interval(events: int, exposure: int) -> tuple[float, float]:
    """95 % interval of exposure per event; infinite above where there was none (Garwood 1936)."""
    tail = (1.0 - CONFIDENCE) / 2.0
    most = float(special.gammaincinv(events + 1, 1.0 - tail))
    least = float(special.gammaincinv(events, tail)) if events else 0.0
    return exposure / most, exposure / least if least else math.inf


# --- where clean statistics come from ---------------------------------------------------------------------------------


def white_statistics(factor: Floats, num_epochs: int) -> CleanStatistics:
    """Statistics on the innovations of a matched filter, which are white: residual = L n.

    Args:
        factor: L, lower, (m, m).
        num_epochs: K, of a run.
    """
    m = len(factor)

    def statistics(detector: Detector, runs: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        detector.bind(runs, m)
        covariance = np.broadcast_to(factor @ factor.T, (runs, m, m))
        kept = np.empty((runs, detector.memory + num_epochs))
        for k in range(kept.shape[1]):
            whitened = rng.standard_normal((runs, m))
            residual = np.einsum("nj,ij->ni", whitened, factor)
            nis = np.einsum("nj,nj->n", whitened, whitened)
            index = np.full(runs, k - detector.memory)
            epoch = Epoch(index, index.astype(np.float64), Innovation(residual, covariance, whitened, nis))
            kept[:, k] = detector.update(epoch)
        return kept[:, : detector.memory], kept[:, detector.memory :]

    return statistics


class _BurnIn(Detector):
    """A detector that never alarms, and keeps the highest statistic of each run before epoch 0 in ``peak``."""

    threshold = math.inf

    def __init__(self, detector: Detector) -> None:
        self._detector = detector
        self.memory = detector.memory

    @property
    def name(self) -> str:
        """That of the detector."""
        return self._detector.name

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate a memory of its own for the detector."""
        self._detector = copy.copy(self._detector)
        self._detector.bind(num_runs, dimension)
        self.peak = np.full(num_runs, -math.inf)

    def take(self, runs: Runs, other: Detector) -> None:
        """Copy the peaks and what the detector remembers."""
        assert isinstance(other, _BurnIn)
        self.peak[runs] = other.peak
        self._detector.take(runs, other._detector)

    def update(self, epoch: Epoch) -> Floats:
        """The detector's statistic, (N,)."""
        statistic = self._detector.update(epoch)
        self.peak = np.where(epoch.index < 0, np.maximum(self.peak, statistic), self.peak)
        return statistic


def simulated_statistics(scenario: Scenario, fidelity: str, threads: int = 1) -> CleanStatistics:
    """Statistics on clean runs of a scenario: the highest of the burn-in, and all from the clean epoch 0 on."""

    def statistics(detector: Detector, runs: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        watch = _BurnIn(detector)
        seed = int(rng.integers(2**31))
        simulation = Simulation(scenario, None, [watch], None, runs, seed, fidelity=fidelity, threads=threads)
        kept = np.empty((runs, scenario.timeline.num_epochs + 1))
        kept[:, 0] = simulation.reset().statistics[watch.name]
        for k in range(1, kept.shape[1]):
            simulation.resolve()
            kept[:, k] = simulation.observe().statistics[watch.name]
        return watch.peak[:, None], kept

    return statistics


# --- thresholds and ARL₀ ----------------------------------------------------------------------------------------------


class FirstAlarms:
    """First alarms and epochs at risk of clean runs, for every threshold at once.

    A statistic that exceeds all earlier ones of its run is a record. With a threshold from the record before it up to
    this one the run's first alarm is at this epoch: the records tell what any threshold would have done.

    Attributes:
        floor: thresholds below are no longer told apart.
    """

    def __init__(self) -> None:
        self.floor = -math.inf
        self._runs = self._length = 0
        self._burn_in = np.empty(0)
        self._before = np.empty(0)
        self._record = np.empty(0)
        self._epoch: Runs = np.empty(0, dtype=np.int64)

    def add(self, burn_in: Floats, statistics: Floats) -> None:
        """Count new runs.

        Args:
            burn_in: statistic in the burn-in, (n, B).
            statistics: in the K epochs at risk, (n, K), of the same K at every call.

        Raises:
            ValueError: there is no epoch, another K than before, or a statistic that is not a number.
        """
        runs, length = statistics.shape
        if length == 0 or (self._runs and length != self._length):
            raise ValueError(f"clean runs have {length} epochs at risk, those before them {self._length}")
        if np.isnan(statistics).any() or np.isnan(burn_in).any():
            raise ValueError("a statistic of a clean run is not a number")
        highest = np.empty((runs, length + 1))
        highest[:, 0] = burn_in.max(axis=1, initial=self.floor)
        np.maximum.accumulate(statistics, axis=1, out=highest[:, 1:])
        np.maximum(highest[:, 1:], highest[:, :1], out=highest[:, 1:])
        run, epoch = np.nonzero(highest[:, 1:] > highest[:, :-1])
        self._runs, self._length = self._runs + runs, length
        self._burn_in = np.concatenate([self._burn_in, highest[highest[:, 0] > self.floor, 0]])
        self._before = np.concatenate([self._before, highest[run, epoch]])
        self._record = np.concatenate([self._record, highest[run, epoch + 1]])
        self._epoch = np.concatenate([self._epoch, epoch + 1])

    def at(self, threshold: float) -> tuple[int, int]:
        """First alarms and epochs at risk with this threshold, not below the floor.

        The epoch of the alarm counts as at risk; a run that alarms in its burn-in does not count.
        """
        alarmed = (self._before <= threshold) & (threshold < self._record)
        alarms = int(np.count_nonzero(alarmed))
        quiet = self._runs - int(np.count_nonzero(self._burn_in > threshold)) - alarms
        return alarms, int(self._epoch[alarmed].sum()) + self._length * quiet

    def threshold(self, arl0: float) -> float:
        """The least threshold, to rounding, whose ARL₀ is not below ``arl0``."""
        low, high = float(self._before.min()), float(self._record.max())
        low = float(self._record.min()) - 1.0 if low == -math.inf else low
        while True:
            middle = 0.5 * (low + high)
            if not low < middle < high:
                return high
            alarms, at_risk = self.at(middle)
            low, high = (middle, high) if at_risk < arl0 * alarms else (low, middle)

    def forget_below(self, floor: float) -> None:
        """Drop what only thresholds below ``floor`` need; later runs are kept from there on only."""
        self.floor = floor
        self._burn_in = self._burn_in[self._burn_in > floor]
        kept = self._record > floor
        self._before, self._record, self._epoch = self._before[kept], self._record[kept], self._epoch[kept]


def calibrate(
    detector: Detector, clean: CleanStatistics, arl0: float, *, first_alarms: int = FIRST_ALARMS, seed: int = 0
) -> Calibration:
    """The threshold at which the measured ARL₀ is the one asked for.

    Args:
        detector: whose statistic; it is not changed.
        clean: where clean statistics come from.
        arl0: wanted, epochs.
        first_alarms: at least so many decide; the relative half-width of the interval is 1.96 over their root.
        seed: of the clean runs.

    Raises:
        ValueError: ``arl0`` is not greater than 1, fewer than 10 alarms are asked for, or no run gets through its
            burn-in or ever has a higher statistic in it.
    """
    arl0 = validation.above("calibration", "arl0", arl0, 1.0)
    first_alarms = validation.whole("calibration", "first_alarms", first_alarms, 10)
    rng = np.random.default_rng(seed)
    counted = FirstAlarms()
    while True:
        counted.add(*clean(copy.copy(detector), RUNS, rng))
        threshold = counted.threshold(arl0)
        alarms, at_risk = counted.at(threshold)
        if alarms >= first_alarms:
            return _calibration(threshold, alarms, at_risk)
        floor = counted.threshold(arl0 / 8.0)
        if counted.at(floor)[0] >= FIRST_ALARMS:
            counted.forget_below(floor)


def _calibration(threshold: float, alarms: int, at_risk: int) -> Calibration:
    arl0 = at_risk / alarms if alarms else math.inf
    return Calibration(threshold, arl0, poisson_interval(alarms, at_risk), alarms, at_risk)


def measure_arl0(
    detector: Detector, clean: CleanStatistics, threshold: float, *, min_epochs: float, seed: int = 0
) -> Calibration:
    """ARL₀ at a given threshold, on at least ``min_epochs`` clean epochs.

    Raises:
        ValueError: every run alarms in its burn-in, or ``min_epochs`` is not a positive finite number.
    """
    validation.above("calibration", "min_epochs", min_epochs)
    rng = np.random.default_rng(seed)
    alarms = at_risk = 0
    while at_risk < min_epochs:
        burn_in, statistics = clean(copy.copy(detector), RUNS, rng)
        counted = FirstAlarms()
        counted.forget_below(threshold)
        counted.add(burn_in, statistics)
        more_alarms, more_at_risk = counted.at(threshold)
        if more_at_risk == 0:
            raise ValueError(f"threshold {threshold:g}: every clean run alarms in its burn-in")
        alarms, at_risk = alarms + more_alarms, at_risk + more_at_risk
    return _calibration(threshold, alarms, at_risk)


_KNOWN: dict[tuple[str, str, str], Calibration] = {}


def calibrated(detector: Detector, scenario: Scenario, fidelity: str = "linear") -> Detector:
    """The detector with its threshold set for a scenario.

    A threshold from theory, from a preset or by hand stays. One that was asked for by its ARL₀ is calibrated, in a
    copy: on white innovations where the scenario's filter is matched, else on clean runs of the scenario; once per
    program for each pair of detector and scenario, always with the same noise. In a recorded scenario a shipped
    threshold for white innovations stays, without an ARL₀.

    Raises:
        ValueError: calibration is needed, and the scenario lacks the fidelity or has no randomness to calibrate with.
    """
    detector.bind(1, scenario.dimension)
    if detector.target_arl0 is None or detector.calibrated:
        return detector
    if detector.threshold is not None and (scenario.matched or not scenario.random):
        return detector
    if not scenario.random:
        raise ValueError(
            f"detector {detector.name!r} cannot be calibrated in scenario {scenario.name!r}, which has one "
            "realisation: give it a threshold"
        )
    key = (detector.name, scenario.name, fidelity)
    if key not in _KNOWN:
        if scenario.matched:
            clean = white_statistics(scenario.linear_model().innovation_factor[0], scenario.timeline.num_epochs)
        else:
            clean = simulated_statistics(scenario, fidelity)
        _KNOWN[key] = calibrate(detector, clean, detector.target_arl0)
    ready = copy.copy(detector)
    ready.set_threshold(_KNOWN[key].threshold, _KNOWN[key].arl0)
    return ready


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the threshold of a windowed test on white innovations."""
    parser = argparse.ArgumentParser(prog="python -m spoofgym.calibration", description=main.__doc__)
    parser.add_argument("--dimension", type=int, default=3, choices=(3, 6), help="of the fix (default: %(default)s)")
    parser.add_argument("--window", type=int, default=DEFAULT_WINDOW, help="n, epochs (default: %(default)s)")
    parser.add_argument("--arl0", type=float, default=DEFAULT_ARL0, help="epochs (default: %(default)s)")
    parser.add_argument("--epochs", type=int, default=1000, help="of a run (default: %(default)s)")
    parser.add_argument("--alarms", type=int, default=5000, help="first alarms that decide (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the noise (default: %(default)s)")
    options = parser.parse_args(arguments)
    clean = white_statistics(np.eye(options.dimension), options.epochs)
    try:
        detector = Windowed(options.window)
        result = calibrate(detector, clean, options.arl0, first_alarms=options.alarms, seed=options.seed)
    except ValueError as error:
        parser.error(str(error))
    low, high = result.interval
    print(
        f"windowed n={options.window} m={options.dimension}: threshold {result.threshold:.3f} "
        f"at ARL0 {result.arl0:.4g} epochs, 95 % [{low:.4g}, {high:.4g}], "
        f"{result.first_alarms} first alarms in {result.epochs_at_risk:.3g} epochs"
    )


if __name__ == "__main__":
    main()
