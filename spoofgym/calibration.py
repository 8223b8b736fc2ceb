"""Thresholds at a stated ARL₀, the average run length between false alarms.

ARL₀ = clean epochs at risk / first alarms, each run counted until its first alarm or its end, memories warm (a clean burn-in without an
alarm), then restarted with new noise. Statistics of the runs are kept, so that the threshold is found without simulating again.

``python -m spoofgym.calibration`` prints the thresholds that `spoofgym.detectors.chi_square` ships.
"""

from __future__ import annotations

import argparse
import copy
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import stats

from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import Detector
from spoofgym.detectors.chi_square import Windowed
from spoofgym.navigation.interface import Epoch, Innovation
from spoofgym.scenario import Scenario
from spoofgym.simulation import Simulation

RUNS = 5000
FIRST_ALARMS = 200
SPARE = 20.0

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
    low = exposure / (0.5 * stats.chi2.ppf(0.975, 2 * events + 2))
    high = exposure / (0.5 * stats.chi2.ppf(0.025, 2 * events)) if events else float("inf")
    return float(low), float(high)


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
            innovation = Innovation(
                np.einsum("nj,ij->ni", whitened, factor), covariance, whitened, np.einsum("nj,nj->n", whitened, whitened)
            )
            index = np.full(runs, k - detector.memory)
            kept[:, k] = detector.update(Epoch(index, index.astype(np.float64), innovation))
        return kept[:, : detector.memory], kept[:, detector.memory :]

    return statistics


def simulated_statistics(scenario: Scenario, fidelity: str, threads: int = 1) -> CleanStatistics:
    """Statistics on clean runs of a scenario, whose simulation warms the memories up itself."""

    def statistics(detector: Detector, runs: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        detector.set_threshold(1e300)
        seed = int(rng.integers(2**31))
        simulation = Simulation(scenario, None, [detector], None, runs, seed, fidelity=fidelity, threads=threads)
        simulation.reset()
        kept = np.empty((runs, scenario.timeline.num_epochs))
        for k in range(kept.shape[1]):
            simulation.resolve()
            kept[:, k] = simulation.observe().statistics[detector.name]
        return np.empty((runs, 0)), kept

    return statistics


def count_alarms(threshold: float, worst: Floats, kept: Floats) -> tuple[int, int]:
    """First alarms and epochs at risk of runs whose burn-in had no alarm; the epoch of the alarm counts as at risk."""
    valid = kept[worst <= threshold]
    over = valid > threshold
    alarmed = over.any(axis=1)
    at_risk = np.where(alarmed, over.argmax(axis=1) + 1, kept.shape[1])
    return int(alarmed.sum()), int(at_risk.sum())


def calibrate(
    detector: Detector, clean: CleanStatistics, arl0: float, *, first_alarms: int = FIRST_ALARMS, seed: int = 0
) -> Calibration:
    """The threshold at which the measured ARL₀ is the one asked for.

    Args:
        detector: whose statistic; it is not changed.
        clean: where clean statistics come from.
        arl0: wanted, epochs.
        first_alarms: how many decide; the relative standard error of ARL₀ is one over their root.
        seed: of the clean runs.

    Raises:
        ValueError: ``arl0`` is not greater than 1, or fewer than 10 alarms are asked for.
    """
    if not arl0 > 1:
        raise ValueError(f"arl0 must be greater than 1 epoch, got {arl0}")
    if first_alarms < 10:
        raise ValueError(f"first_alarms must be 10 or more, got {first_alarms}")
    rng = np.random.default_rng(seed)
    worst, kept = [], []
    exposure = quiet = 0
    while exposure < first_alarms * arl0:
        burn_in, statistics = clean(copy.copy(detector), RUNS, rng)
        exposure += statistics.size
        near = _near_alarm(statistics, arl0)
        quiet += statistics.size - statistics[near].size
        worst.append(burn_in[near].max(axis=1, initial=-np.inf))
        kept.append(statistics[near])
    burnt, paths = np.concatenate(worst), np.concatenate(kept)
    low, high = float(np.min(paths)), float(np.max(paths))
    for _ in range(60):
        middle = 0.5 * (low + high)
        alarms, at_risk = count_alarms(middle, burnt, paths)
        low, high = (low, middle) if at_risk + quiet > arl0 * alarms else (middle, high)
    alarms, at_risk = count_alarms(high, burnt, paths)
    return _calibration(high, alarms, at_risk + quiet)


def _near_alarm(statistics: Floats, arl0: float) -> Runs:
    """The runs of a batch that come nearest to an alarm, many more than will have one: only their paths need be kept."""
    share = min(1.0, SPARE * statistics.shape[1] / arl0)
    return np.argsort(statistics.max(axis=1))[-max(1, int(np.ceil(share * len(statistics)))) :]


def _calibration(threshold: float, alarms: int, at_risk: int) -> Calibration:
    arl0 = at_risk / alarms if alarms else float("inf")
    return Calibration(threshold, arl0, poisson_interval(alarms, at_risk), alarms, at_risk)


def measure_arl0(
    detector: Detector, clean: CleanStatistics, threshold: float, *, min_epochs: float, seed: int = 0
) -> Calibration:
    """ARL₀ at a given threshold, on at least ``min_epochs`` clean epochs."""
    rng = np.random.default_rng(seed)
    alarms = at_risk = 0
    while at_risk < min_epochs:
        burn_in, kept = clean(copy.copy(detector), RUNS, rng)
        counted = count_alarms(threshold, burn_in.max(axis=1, initial=-np.inf), kept)
        alarms, at_risk = alarms + counted[0], at_risk + counted[1]
    return _calibration(threshold, alarms, at_risk)


_KNOWN: dict[tuple[str, str, str], Calibration] = {}


def calibrated(detector: Detector, scenario: Scenario, fidelity: str = "linear") -> Detector:
    """The detector with its threshold set for a scenario.

    A threshold from theory, from a preset or by hand stays. One that was asked for by its ARL₀ is calibrated: on white innovations where
    the scenario's filter is matched, else on clean runs of the scenario; once per program for each pair of detector and scenario.
    """
    detector.bind(1, scenario.dimension)
    if detector.target_arl0 is None or detector.calibrated:
        return detector
    if detector.threshold is not None and scenario.matched:
        return detector
    key = (detector.name, scenario.name, fidelity)
    if key not in _KNOWN:
        if scenario.matched:
            factor = scenario.linear_model().innovation_factor[0]
            clean = white_statistics(factor, scenario.timeline.num_epochs)
        else:
            clean = simulated_statistics(scenario, fidelity)
        _KNOWN[key] = calibrate(detector, clean, detector.target_arl0)
    detector.set_threshold(_KNOWN[key].threshold, _KNOWN[key].arl0)
    return detector


def main() -> None:
    """Print the threshold of a windowed test on white innovations."""
    parser = argparse.ArgumentParser(prog="python -m spoofgym.calibration", description=main.__doc__)
    parser.add_argument("--dimension", type=int, default=3, choices=(3, 6), help="of the fix (default: %(default)s)")
    parser.add_argument("--window", type=int, default=20, help="n, epochs (default: %(default)s)")
    parser.add_argument("--arl0", type=float, default=1e5, help="epochs (default: %(default)s)")
    parser.add_argument("--epochs", type=int, default=1000, help="of a run (default: %(default)s)")
    parser.add_argument("--alarms", type=int, default=5000, help="first alarms that decide (default: %(default)s)")
    options = parser.parse_args()
    clean = white_statistics(np.eye(options.dimension), options.epochs)
    result = calibrate(Windowed(options.window), clean, options.arl0, first_alarms=options.alarms)
    low, high = result.interval
    print(
        f"windowed n={options.window} m={options.dimension}: threshold {result.threshold:.3f} at ARL0 {result.arl0:.4g} "
        f"epochs, 95 % [{low:.4g}, {high:.4g}], {result.first_alarms} first alarms in {result.epochs_at_risk:.3g} epochs"
    )


if __name__ == "__main__":
    main()
