"""Statistics of detectors on clean fixes: white innovations of a matched filter, or clean runs of a scenario."""

from __future__ import annotations

import copy
import math
import sys
from collections.abc import Callable, Sequence

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import Detector, seen_dimension, statistic_of
from spoofgym.navigation.facts import FilterFacts
from spoofgym.navigation.interface import Epoch
from spoofgym.navigation.white import WhiteInnovations
from spoofgym.scenario import Scenario
from spoofgym.simulation import Simulation

CleanStatistics = Callable[[Detector, int, np.random.Generator], tuple[Floats, Floats]]
"""(detector, runs, randomness) -> its statistic in the burn-in (n, B) and in the clean epochs after it (n, K)."""

JointStatistics = Callable[[Sequence[Detector], int, np.random.Generator], list[tuple[Floats, Floats]]]
"""(detectors, runs, randomness) -> of each detector what `CleanStatistics` gives, all on the same clean runs."""


def white_statistics(
    innovations: WhiteInnovations | Floats, num_epochs: int, facts: FilterFacts | None = None
) -> CleanStatistics:
    """Statistics on the innovations of a matched filter, which are white.

    Args:
        innovations: by epoch; or L, lower, of every epoch (m, m), or of epochs 0..K (K+1, m, m).
        num_epochs: K, of a run.
        facts: of the filter, for detectors that ask for them.
    """
    if isinstance(innovations, WhiteInnovations):
        white = innovations
    else:
        white = WhiteInnovations(innovations.reshape(-1, *innovations.shape[-2:]))

    def statistics(detector: Detector, runs: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        detector.bind(runs, seen_dimension(detector, white.dimension, white.range_response is not None))
        if facts is not None:
            detector.know(facts)
        kept = np.empty((runs, detector.memory + num_epochs))
        for k in range(kept.shape[1]):
            index = np.full(runs, k - detector.memory)
            innovation = white.innovation(k - detector.memory, rng.standard_normal((runs, white.dimension)))
            kept[:, k] = statistic_of(detector, Epoch(index, index.astype(np.float64), innovation))
        return kept[:, : detector.memory], kept[:, detector.memory :]

    return statistics


class _BurnIn(Detector):
    """A detector that never alarms, and keeps the highest statistic of each run in its burn-in in ``peak``."""

    threshold = sys.float_info.max

    def __init__(self, detector: Detector) -> None:
        self._detector = detector
        self.memory = detector.memory
        self.demands = detector.demands
        self.in_position = detector.in_position

    @property
    def name(self) -> str:
        """That of the detector."""
        return self._detector.name

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate a memory of its own for the detector."""
        self._detector = copy.copy(self._detector)
        self._detector.bind(num_runs, dimension)
        self.peak = np.full(num_runs, -math.inf)

    def know(self, facts: FilterFacts) -> None:
        """Tell the detector."""
        self._detector.know(facts)

    def take(self, runs: Runs, other: Detector) -> None:
        """Copy the peaks and what the detector remembers."""
        assert isinstance(other, _BurnIn)
        self.peak[runs] = other.peak
        self._detector.take(runs, other._detector)

    def update(self, epoch: Epoch) -> Floats:
        """The detector's statistic, (N,)."""
        statistic = statistic_of(self._detector, epoch)
        before = (epoch.index < 0) & (epoch.index >= -self.memory)
        self.peak = np.where(before, np.maximum(self.peak, statistic), self.peak)
        return statistic


def joint_statistics(scenario: Scenario, fidelity: str, threads: int = 1) -> JointStatistics:
    """Statistics of several detectors on common clean runs: the highest of the burn-in, all from epoch 0 on."""

    def statistics(detectors: Sequence[Detector], runs: int, rng: np.random.Generator) -> list[tuple[Floats, Floats]]:
        watches = [_BurnIn(detector) for detector in detectors]
        seed = int(rng.integers(2**31))
        simulation = Simulation(scenario, None, watches, None, runs, seed, fidelity=fidelity, threads=threads)
        kept = np.empty((len(watches), runs, scenario.timeline.num_epochs + 1))
        epoch = simulation.reset()
        for k in range(kept.shape[2]):
            if k:
                simulation.resolve()
                epoch = simulation.observe()
            for place, watch in enumerate(watches):
                kept[place, :, k] = epoch.statistics[watch.name]
        return [(watch.peak[:, None], values) for watch, values in zip(watches, kept, strict=True)]

    return statistics
