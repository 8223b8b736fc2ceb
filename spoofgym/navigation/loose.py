"""The strapdown fidelity: N loosely coupled INS/GNSS filters at the IMU rate, closed loop.

Between two fixes each run mechanizes its own noisy samples; at the epoch the error dynamics are formed once, from the
mean specific force and the state in the middle of the epoch, and carry the covariance over the epoch (Φ to third order;
process noise half before, half after Φ). The estimated error is fed back into the mechanization after every used fix.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.geodesy import displace, position_difference
from spoofgym.navigation import closed_loop
from spoofgym.navigation.error_model import NUM_STATES
from spoofgym.navigation.interface import Decision, Innovation
from spoofgym.navigation.strapdown_model import StrapdownModel
from spoofgym.navigation.warm_start import CONSTANT_BIAS, ERROR, INSTABILITY
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams

GRAIN = 64
EPOCHS_DRAWN = 8
"""Epochs whose sensor noise a run draws at once: few long draws, since each hands the interpreter lock over."""


class StrapdownNavigator:
    """N closed-loop error-state filters on one game.

    Attributes:
        model: the game.
        attitude: C, body to ENU, (N, 3, 3).
        velocity: ENU, (N, 3), m/s.
        position: latitude rad, longitude rad, height m, (N, 3).
        bias: estimated gyro and accelerometer biases, (N, 6), rad/s and m/s².
        true_bias: what they really are, (N, 6).
        covariance: P, (N, 15, 15).
        index: the epoch where each run stands, (N,); -1 before the first.
    """

    def __init__(self, model: StrapdownModel, num_runs: int, slices: RunSlices) -> None:
        """Allocate ``num_runs`` runs; `reset` starts them."""
        m = model.dimension
        self.model = model
        self.attitude = np.zeros((num_runs, 3, 3))
        self.velocity = np.zeros((num_runs, 3))
        self.position = np.zeros((num_runs, 3))
        self.bias = np.zeros((num_runs, 6))
        self.true_bias = np.zeros((num_runs, 6))
        self.covariance = np.zeros((num_runs, NUM_STATES, NUM_STATES))
        self.index = np.full(num_runs, -1)
        self._instability = np.zeros((num_runs, 6))
        self._fix = np.zeros((num_runs, 6, 3))
        self._gain = np.zeros((num_runs, NUM_STATES, m))
        self._whitened = np.zeros((num_runs, m))
        self._generators: dict[int, np.random.Generator] = {}
        self._noisy = bool(np.any(model.true_noise) or np.any(model.instability_sigma))
        width = closed_loop.NUM_SAMPLE_NOISES * model.max_samples + closed_loop.NUM_EPOCH_NOISES
        self._normals = np.zeros((num_runs, EPOCHS_DRAWN, width if self._noisy else 0))
        self._slices = slices
        self._all = np.arange(num_runs)

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0.

        Args:
            runs: which, (n,).
            initial: joint state y drawn for them, (n, 30).
            streams: the random streams of all runs.
        """
        model, error = self.model, initial[:, ERROR]
        self.index[runs] = -1
        self.covariance[runs] = model.prior_covariance
        self.position[runs] = displace(np.broadcast_to(model.position, (len(runs), 3)), error[:, 6:9])
        self.velocity[runs] = model.velocity + error[:, 3:6]
        for run, x in zip(runs, error, strict=True):
            self.attitude[run] = model.attitude
            closed_loop.rotate(self.attitude[run], -x[0], -x[1], -x[2])
            if self._noisy:
                self._generators[int(run)] = streams(run, "imu").spawn(1)[0]
        self._instability[runs] = initial[:, INSTABILITY]
        self.true_bias[runs] = initial[:, CONSTANT_BIAS] + initial[:, INSTABILITY]
        self.bias[runs] = self.true_bias[runs] - error[:, 9:15]

    def propagate(self, runs: Runs | None = None) -> None:
        """Carry runs (all by default) to their next epoch by inertial measurements."""
        self._slices.call(self._propagate_slice, self._all if runs is None else runs, 1)

    def _propagate_slice(self, runs: Runs) -> None:
        model = self.model
        if self._noisy:
            for run in runs[(self.index[runs] + 1) % EPOCHS_DRAWN == 0].tolist():
                self._generators[run].standard_normal(out=self._normals[run])
        closed_loop.propagate(
            runs,
            self.index,
            self.attitude,
            self.velocity,
            self.position,
            self.bias,
            self.true_bias,
            self._instability,
            self.covariance,
            self._fix,
            self._normals,
            model.angular_rate,
            model.specific_force,
            model.step,
            model.boundaries,
            model.latency_samples,
            model.filter_density,
            model.true_noise,
            model.instability_sigma,
            model.instability_decay,
        )

    def innovate(self, deviation: Floats, runs: Runs | None = None) -> Innovation:
        """Form the innovation of runs (all by default).

        Args:
            deviation: receiver noise plus offset, (n, m).
            runs: which, (n,).
        """
        runs = self._all if runs is None else runs
        model = self.model
        residual, whitened, nis = np.empty_like(deviation), np.empty_like(deviation), np.empty(len(runs))
        innovation = np.empty((len(runs), model.dimension, model.dimension))
        self._slices.call(
            lambda part: closed_loop.innovate(
                part,
                runs,
                self.index,
                self._fix,
                self.covariance,
                model.fix_position,
                model.fix_velocity,
                model.lever_arm,
                float(model.latency_samples * model.step[0]),
                model.measurement_covariance,
                deviation,
                innovation,
                self._gain,
                residual,
                whitened,
                nis,
            ),
            self._all[: len(runs)],
            GRAIN,
        )
        self._whitened[runs] = whitened
        return Innovation(residual, innovation, whitened, nis)

    def resolve(self, decision: Decision, runs: Runs | None = None) -> None:
        """Apply the fix where the decision says so, and feed the estimated error back."""
        self._slices.call(
            lambda part: closed_loop.resolve(
                part,
                self.attitude,
                self.velocity,
                self.position,
                self.bias,
                self.covariance,
                self._gain,
                self._whitened,
            ),
            (self._all if runs is None else runs)[decision.use],
            GRAIN,
        )

    @property
    def error(self) -> Floats:
        """Estimate minus truth, (N, 3), m ENU."""
        return position_difference(self.position, self.model.true_position[self.index])

    @property
    def position_covariance(self) -> Floats:
        """The filter's covariance of the position, (N, 3, 3), m²."""
        return self.covariance[:, 6:9, 6:9].copy()

    @property
    def estimated_bias(self) -> Floats:
        """Gyro and accelerometer biases that the filter has estimated, (N, 6), rad/s and m/s²."""
        return self.bias.copy()
