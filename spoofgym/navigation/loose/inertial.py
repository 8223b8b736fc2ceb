"""N inertial solutions at the IMU rate in closed loop with a filter, whatever fixes correct them.

The estimated error is fed back into the mechanization after every used fix. The sensor noise of each run is drawn in
blocks and stored as far back as the history reaches, so that a backtrack mechanizes the same samples again.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.geodesy import displace, position_difference
from spoofgym.navigation.batch import FilterBatch
from spoofgym.navigation.divergence import NUM_HELD, Solution, hold
from spoofgym.navigation.error_model import POSITION, VELOCITY
from spoofgym.navigation.interface import Demands
from spoofgym.navigation.loose import kernels
from spoofgym.navigation.loose.innovation import FilterRuns
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams

EPOCHS_DRAWN = 8
"""Epochs whose sensor noise a run draws at once: few long draws, since each hands the interpreter lock over."""


class InertialBatch(FilterBatch):
    """N closed-loop error-state filters around a strapdown mechanization.

    Attributes:
        model: the game.
        attitude: C, body to ENU, (N, 3, 3).
        velocity: ENU, (N, 3), m/s.
        position: latitude rad, longitude rad, height m, (N, 3).
        bias: estimated gyro and accelerometer biases, (N, 6), rad/s and m/s².
        true_bias: what they really are, (N, 6).
        covariance: P, (N, n, n).
    """

    carry_grain = 1

    def __init__(
        self,
        model: StrapdownModel,
        prior_covariance: Floats,
        dimension: int,
        num_runs: int,
        slices: RunSlices,
        demands: Demands,
        num_slots: int = 0,
    ) -> None:
        """Allocate ``num_runs`` runs; `reset` starts them.

        Args:
            model: the inertial part of the game.
            prior_covariance: the filter's P before epoch 0, (n, n).
            dimension: m, of the measurement.
            num_runs: N.
            slices: the threads to use.
            demands: of the players.
            num_slots: S, of satellites, where ranges are measured.
        """
        super().__init__(num_runs, dimension, slices, demands, num_slots)
        n = len(prior_covariance)
        self.model = model
        self.attitude = np.zeros((num_runs, 3, 3))
        self.velocity = np.zeros((num_runs, 3))
        self.position = np.zeros((num_runs, 3))
        self.bias = np.zeros((num_runs, 6))
        self.true_bias = np.zeros((num_runs, 6))
        self.covariance = np.zeros((num_runs, n, n))
        self._inertial = Solution(self.attitude, self.velocity, self.position, self.bias)
        self._prior_covariance = prior_covariance
        self._held = np.zeros((num_runs, NUM_HELD))
        self._fix = np.zeros((num_runs, 6, 3))
        self._gain = np.zeros((num_runs, dimension, n))
        self._filters = FilterRuns(self.covariance, self._gain, self._deviation, self._whitened)
        self._generators: dict[int, np.random.Generator] = {}
        self._noisy = bool(np.any(model.true_noise) or np.any(model.instability_sigma))
        width = kernels.NUM_SAMPLE_NOISES * model.max_samples + kernels.NUM_EPOCH_NOISES
        blocks = 1 if not demands.history else -(-(demands.history + 1) // EPOCHS_DRAWN) + 2
        self._normals = np.zeros((num_runs, blocks * EPOCHS_DRAWN, width if self._noisy else 0))
        self._drawn = np.zeros(num_runs, dtype=np.int64)

    def _start(self, runs: Runs, error: Floats, streams: RunStreams) -> None:
        """Put solutions of runs beside the truth before epoch 0 by errors (n, 15), whose biases are left out."""
        model = self.model
        self.covariance[runs] = self._prior_covariance
        self.position[runs] = displace(np.broadcast_to(model.position, (len(runs), 3)), error[:, POSITION])
        self.velocity[runs] = model.velocity + error[:, VELOCITY]
        self._drawn[runs] = 0
        for run, x in zip(runs.tolist(), error, strict=True):
            self.attitude[run] = model.attitude
            kernels.rotate(self.attitude[run], -x[0], -x[1], -x[2])
            if self._noisy:
                self._generators[run] = streams.spawn(run, "imu")

    def _draw(self, runs: Runs) -> None:
        """Draw the sensor noise of the epoch that follows, where it is not drawn yet: in a backtrack it is."""
        if self._noisy:
            for run in runs[self.index[runs] + 1 == self._drawn[runs]].tolist():
                begin = self._drawn[run] % self._normals.shape[1]
                self._generators[run].standard_normal(out=self._normals[run, begin : begin + EPOCHS_DRAWN])
                self._drawn[run] += EPOCHS_DRAWN

    def _settle(self, runs: Runs) -> None:
        """Keep what is valid; hold what has diverged."""
        hold(runs, self._inertial, self.covariance, self.auxiliary, self._prior_covariance, self._held, self.diverged)

    def _lost(self, runs: Runs, nis: Floats) -> Runs:
        """Places of innovations that are not finite, (k,): S is no longer positive, and their runs have diverged."""
        lost = np.flatnonzero(~np.isfinite(nis))
        if len(lost):
            self.diverged[runs[lost]] = True
            self._gain[runs[lost]] = 0.0
        return lost

    def _solution(self, runs: Runs) -> tuple[Floats, ...]:
        return self.attitude[runs], self.velocity[runs], self.position[runs], self.bias[runs]

    def _moved(self, before: tuple[Floats, ...], after: tuple[Floats, ...]) -> Floats:
        """To first order: with C₁ = (I - [φ₁ x]) C and C₂ alike, C₁ C₂' = I - [(φ₁ - φ₂) x].

        A bias error is true minus estimated.
        """
        turn = np.einsum("nij,nkj->nik", before[0], after[0])
        attitude = 0.5 * np.stack(
            [turn[:, 1, 2] - turn[:, 2, 1], turn[:, 2, 0] - turn[:, 0, 2], turn[:, 0, 1] - turn[:, 1, 0]], axis=1
        )
        position = position_difference(before[2], after[2])
        return np.concatenate([attitude, before[1] - after[1], position, after[3] - before[3]], axis=1)

    def _past_error(self, epochs: Runs) -> Floats:
        position = self.past.recall("position", epochs)
        truth = self.model.true_position[np.maximum(epochs, 0)]
        return position_difference(position.reshape(-1, 3), truth.reshape(-1, 3)).reshape(*epochs.shape, 3)

    @property
    def error(self) -> Floats:
        """Estimate minus truth, (N, 3), m ENU."""
        return position_difference(self.position, self.model.true_position[self.index])

    @property
    def velocity_error(self) -> Floats:
        """Estimate minus truth, (N, 3), m/s ENU."""
        return self.velocity - self.model.true_velocity[self.index]

    @property
    def position_covariance(self) -> Floats:
        """The filter's covariance of the position, (N, 3, 3), m²."""
        return self.covariance[:, POSITION, POSITION].copy()

    @property
    def estimated_bias(self) -> Floats:
        """Gyro and accelerometer biases that the filter has estimated, (N, 6), rad/s and m/s²."""
        return self.bias.copy()
