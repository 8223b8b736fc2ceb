"""Navigators that tune themselves, in both fidelities: the same filters with R and a factor on Q of each run's own."""

from __future__ import annotations

from typing import Any

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.batch import FilterBatch, Weights
from spoofgym.navigation.interface import NO_DEMANDS, Demands, Innovation
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.adaptation import Adaptation, LastFixes, Learnt, Rules, adapt, negative_ratio
from spoofgym.navigation.loose.innovation import FilterNoise
from spoofgym.navigation.loose.own_gains import GRAIN, OwnCovarianceNavigator
from spoofgym.navigation.loose.strapdown import StrapdownNavigator
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.parallel import RunSlices
from spoofgym.sensors.imu import ImuGrade
from spoofgym.streams import RunStreams


class SelfTuning:
    """What N filters have learnt of their noises.

    Attributes:
        adaptation: how they tune themselves.
        noise: R of each run, (N, m, m), m² and m²/s².
        scale: factor on Q₀ of each run, (N,).
        ratio: α of the last fix used, (N,); 1 where nothing was adapted.
        count: fixes that have entered the windows, (N,).
    """

    def __init__(self, adaptation: Adaptation, initial: Floats, num_runs: int, history: int, slices: RunSlices) -> None:
        """Allocate ``num_runs`` runs, which begin with R = ``initial`` (m, m).

        The windows hold so many more fixes that ``history`` epochs can be taken back.
        """
        m = len(initial)
        length = adaptation.window + adaptation.delay + history
        self.adaptation = adaptation
        self.noise = np.tile(initial, (num_runs, 1, 1))
        self.scale = np.ones(num_runs)
        self.ratio = np.ones(num_runs)
        self.count = np.zeros(num_runs, dtype=np.int64)
        residuals, innovations = np.zeros((num_runs, length, m)), np.zeros((num_runs, length, m))
        self._learnt = Learnt(residuals, innovations, self.count, self.ratio, self.noise, self.scale)
        self._last_fixes = LastFixes(
            np.zeros((num_runs, m, m)), np.zeros((num_runs, m)), np.zeros(num_runs), np.ones(num_runs)
        )
        self._rules = Rules(
            adaptation.window,
            adaptation.delay,
            adaptation.frozen_above,
            not adaptation.has("non-cumulative"),
            adaptation.ratio_range,
            adaptation.scale_range,
            adaptation.noise_range,
            np.array(initial),
        )
        self._slices = slices

    @property
    def filter_noise(self) -> FilterNoise:
        """R and the factor on Q of each run, as kernels take them."""
        return FilterNoise(self.noise, np.arange(len(self.scale)), self.scale)

    @property
    def learnt(self) -> dict[str, Any]:
        """What a backtrack takes back, for a history."""
        return {"noise": self.noise, "process_scale": self.scale, "count": self.count}

    def reset(self, runs: Runs) -> None:
        """Forget what runs have learnt."""
        self.noise[runs] = self._rules.initial
        self.scale[runs] = 1.0
        self.ratio[runs] = 1.0
        self.count[runs] = 0

    def note(self, runs: Runs, innovation: Innovation, weight: Floats) -> None:
        """Keep the innovation of runs, formed with R times ``weight`` (n,), until its fix is used."""
        fixes = self._last_fixes
        fixes.innovation[runs] = innovation.covariance
        fixes.gamma[runs] = innovation.residual
        fixes.nis[runs] = innovation.nis
        fixes.weight[runs] = weight

    def adapt(self, runs: Runs, index: Runs, time: Floats) -> None:
        """Renew R and the factor on Q of runs that have used a fix.

        Args:
            runs: which, (n,).
            index: epochs of all runs, (N,), and their times (E,), s, for the message.
            time: of the epochs, (E,), s.

        Raises:
            NegativeRatioError: an unguarded run has met α < 0.
        """
        self._slices.call(lambda part: adapt(part, self._rules, self._last_fixes, self._learnt), runs, GRAIN)
        if self.adaptation.literal:
            failed = runs[~(self.ratio[runs] >= 0.0)]
            if len(failed):
                run = int(failed[0])
                raise negative_ratio(run, int(index[run]), float(time[index[run]]), float(self.ratio[run]))


class SelfTuningBatch(FilterBatch):
    """N filters that tune themselves, in either fidelity.

    The innovation has the R matched to the fixes before it, R_{k-1}: with R_k, as the paper's (14) reads, S would hold
    the residual of the fix under test. A fix that is left out, or reset to, does not enter the windows. `resolve`
    raises `NegativeRatioError` where an unguarded run meets α < 0.

    Attributes:
        tuned: what the filters have learnt of their noises.
    """

    tuned: SelfTuning
    model: LinearModel | StrapdownModel

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0 with the initial R and Q and empty windows."""
        super().reset(runs, initial, streams)
        self.tuned.reset(runs)

    def _formed(self, runs: Runs, innovation: Innovation, weights: Weights) -> None:
        self.tuned.note(runs, innovation, weights.noise_scale)

    def _corrected(self, runs: Runs) -> None:
        self.tuned.adapt(runs, self.index, self.model.time)


class AdaptiveNavigator(SelfTuningBatch, OwnCovarianceNavigator):
    """N self-tuning filters in the linear fidelity."""

    model: LinearModel

    def __init__(
        self,
        model: LinearModel,
        grade: ImuGrade,
        interval: float,
        num_runs: int,
        slices: RunSlices,
        adaptation: Adaptation,
        demands: Demands = NO_DEMANDS,
    ) -> None:
        """As for `OwnCovarianceNavigator`; ``model`` is of the filter that all runs begin with."""
        self.tuned = SelfTuning(adaptation, model.measurement_covariance, num_runs, demands.history, slices)
        super().__init__(model, grade, interval, num_runs, slices, demands, self.tuned.filter_noise)
        self.past.add(**self.tuned.learnt)


class AdaptiveStrapdownNavigator(SelfTuningBatch, StrapdownNavigator):
    """N self-tuning filters in the strapdown fidelity."""

    model: StrapdownModel

    def __init__(
        self,
        model: StrapdownModel,
        num_runs: int,
        slices: RunSlices,
        adaptation: Adaptation,
        demands: Demands = NO_DEMANDS,
    ) -> None:
        """As for `StrapdownNavigator`; the filter begins with the R of the model's first epoch."""
        self.tuned = SelfTuning(adaptation, model.measurement_covariance[0], num_runs, demands.history, slices)
        super().__init__(model, num_runs, slices, demands, self.tuned.filter_noise)
        self.past.add(**self.tuned.learnt)
