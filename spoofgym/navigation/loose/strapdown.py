"""The strapdown fidelity: N loosely coupled INS/GNSS filters at the IMU rate, closed loop.

Between two fixes each run mechanizes its own noisy samples; the error dynamics are formed from the mean specific force
and the state in the middle of the epoch, and carry the covariance over the epoch (Φ to third order; process noise half
before, half after Φ). A long epoch, as an outage of a recorded log, is cut into parts of about a second, for each of
which this is done.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.batch import Weights, empty_innovation
from spoofgym.navigation.divergence import blank
from spoofgym.navigation.error_model import NUM_INERTIAL
from spoofgym.navigation.history import History
from spoofgym.navigation.interface import NO_DEMANDS, Demands, Innovation
from spoofgym.navigation.loose import kernels
from spoofgym.navigation.loose.inertial import InertialBatch
from spoofgym.navigation.loose.innovation import FilterNoise, FixNoise
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.navigation.loose.sweep import Sweep, sweep
from spoofgym.navigation.loose.warm_start import CONSTANT_BIAS, ERROR, INSTABILITY
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams

GRAIN = 64
"""Runs below which a slice is not worth a thread."""


class StrapdownNavigator(InertialBatch):
    """N closed-loop error-state filters on one game, corrected by fixes of position and, where given, velocity."""

    grain = GRAIN

    def __init__(
        self,
        model: StrapdownModel,
        num_runs: int,
        slices: RunSlices,
        demands: Demands = NO_DEMANDS,
        noise: FilterNoise | None = None,
    ) -> None:
        """Allocate ``num_runs`` runs; `reset` starts them.

        Args:
            model: the game.
            num_runs: N.
            slices: the threads to use.
            demands: of the players.
            noise: what the filters believe, by default R of the model's epochs.
        """
        super().__init__(model, model.prior_covariance, model.dimension, num_runs, slices, demands)
        instability = np.zeros((num_runs, 6))
        self._residual = np.zeros((num_runs, model.dimension))
        self._vehicles = kernels.StrapdownRuns(
            self.index, self._inertial, self.true_bias, instability, self._fix, self._normals
        )
        by_epoch = FilterNoise(np.ascontiguousarray(model.measurement_covariance), self.index, np.ones(num_runs))
        self._noise = by_epoch if noise is None else noise
        self.past = History(
            demands.history,
            self.covariance,
            **self._inertial._asdict(),
            true_bias=self.true_bias,
            instability=instability,
        )

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0.

        Args:
            runs: which, (n,).
            initial: joint state y drawn for them, (n, 30).
            streams: the random streams of all runs.
        """
        super().reset(runs, initial, streams)
        error = initial[:, ERROR]
        self._start(runs, error, streams)
        self._vehicles.instability[runs] = initial[:, INSTABILITY]
        self.true_bias[runs] = initial[:, CONSTANT_BIAS] + initial[:, INSTABILITY]
        self.bias[runs] = self.true_bias[runs] - error[:, 9:15]
        self._settle(runs)

    def _carry(self, runs: Runs, epochs: Runs, auxiliary: Floats) -> None:
        self._draw(runs)
        scale, ring = self._noise.process_scale, self.past.ring
        kernels.carry(runs, epochs, self.model.steps, scale, self._vehicles, ring, auxiliary)

    def _innovate(self, runs: Runs, weights: Weights) -> Innovation:
        formed = empty_innovation(len(runs), self.model.dimension)
        noise = FixNoise(self._noise.covariance, self._noise.row, weights.noise_scale)
        reference = self.model.reference
        self._on_slices(
            lambda part: kernels.innovate(part, runs, self.index, self._fix, reference, noise, self._filters, formed),
            self._all[: len(runs)],
        )
        lost = self._lost(runs, formed.nis)
        if len(lost):
            blank(lost, *formed)
        where = self._where(runs)
        self._whitened[where], self._residual[where] = formed.whitened, formed.residual
        return Innovation(*formed)

    def _correct(self, runs: Runs) -> None:
        self._on_slices(
            lambda part: kernels.correct(part, self._inertial, self._gain, self._whitened, self.covariance), runs
        )

    def _reset_to_fix(self, runs: Runs, variance: Floats) -> None:
        """Position and, where the receiver gives it, velocity jump to the fix; their correlations are forgotten."""
        kernels.reset(runs, variance, self._noise, self._inertial, self.covariance, self._residual[runs])

    def sweep(self) -> Sweep | None:
        """Carry a single run, just started, over all epochs of the model, every fix used; None = the filter diverges.

        Innovations equal those of `propagate`, `innovate` and `resolve` in turn. The run is at its end afterwards.
        """
        epochs = self.model.num_epochs + 1
        found = Sweep(empty_innovation(epochs, self.model.dimension), *np.empty((2, epochs, 3)))
        noise = FixNoise(self._noise.covariance, self._noise.row, np.ones(1))
        reference, ring = self.model.reference, self.past.ring
        lasts = sweep(self.model.steps, self._vehicles, ring, reference, noise, self._filters, found)
        return found if lasts else None

    @property
    def fix_gain(self) -> Floats:
        """U' for the fix of the present epoch, (N, m, 15)."""
        return self._gain[:, :, :NUM_INERTIAL].copy()
