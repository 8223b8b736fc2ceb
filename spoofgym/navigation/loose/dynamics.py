"""The true error of N runs in the linear fidelity: what noise and bias instability make of it, epoch by epoch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.error_batch import LinearErrorBatch
from spoofgym.navigation.error_model import INERTIAL, NUM_NAVIGATION
from spoofgym.navigation.interface import Demands
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.warm_start import CONSTANT_BIAS, ERROR, INSTABILITY
from spoofgym.parallel import RunSlices
from spoofgym.sensors.imu import ImuGrade
from spoofgym.streams import RunStreams


class ErrorRuns(NamedTuple):
    """The arrays of `ErrorBatch` that a run goes through an epoch with."""

    epoch: Runs
    state: Floats
    true_bias: Floats
    normals: Floats
    bias_steps: Floats


class ErrorBatch(LinearErrorBatch):
    """N runs of the true error under a linear filter.

    Attributes:
        model: the game.
        normals: standard normal process noise of the episode, (N, K+1, 9); write into it to inject a noise path.
        bias_steps: changes of the biases at each epoch, (N, K+1, 6); shape (N, 0, 6) where they are constant.
    """

    def __init__(
        self,
        model: LinearModel,
        grade: ImuGrade,
        interval: float,
        num_runs: int,
        slices: RunSlices,
        demands: Demands,
    ) -> None:
        """Allocate ``num_runs`` runs; `reset` starts them.

        Args:
            model: of the game.
            grade: of the IMU: its bias instability acts during the game.
            interval: between epochs, s.
            num_runs: N.
            slices: the threads to use.
            demands: of the players.
        """
        super().__init__(model.num_states, num_runs, model.dimension, slices, demands)
        epochs = model.num_epochs + 1
        self.model = model
        self.normals = np.zeros((num_runs, epochs, NUM_NAVIGATION))
        unstable = bool(np.any(grade.instability_sigma))
        self.bias_steps = np.zeros((num_runs, epochs if unstable else 0, 6))
        self._decay = float(np.exp(-interval / grade.correlation_time))
        self._instability = grade.instability_sigma
        self._runs = ErrorRuns(self.index, self.state, self.true_bias, self.normals, self.bias_steps)

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0.

        Args:
            runs: which, (n,).
            initial: joint state y drawn for them, (n, 30).
            streams: the random streams of all runs.
        """
        super().reset(runs, initial, streams)
        self.state[runs] = 0.0
        self.state[runs, INERTIAL] = initial[:, ERROR]
        self.true_bias[runs] = initial[:, CONSTANT_BIAS] + initial[:, INSTABILITY]
        for run in runs.tolist():
            streams(run, "imu").standard_normal(out=self.normals[run])
        if self.bias_steps.shape[1]:
            self._draw_bias_steps(runs, initial[:, INSTABILITY], streams)

    def _draw_bias_steps(self, runs: Runs, value: Floats, streams: RunStreams) -> None:
        """Draw the Gauss-Markov path of the bias instability; its changes act on the bias error."""
        driving = self._instability * np.sqrt(1.0 - self._decay**2)
        normals = np.stack([streams(run, "imu").standard_normal(self.bias_steps.shape[1:]) for run in runs])
        for k in range(self.bias_steps.shape[1]):
            following = self._decay * value + driving * normals[:, k]
            self.bias_steps[runs, k] = following - value
            value = following


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def draw_process_noise(noise_columns: Floats, normals: Floats, noise: Floats) -> None:
    """Write the white noise that acts on a run's navigation states up to an epoch, from the epoch's normals (9,)."""
    for i in range(NUM_NAVIGATION):
        noise[i] = 0.0
    for j in range(NUM_NAVIGATION):
        factor = normals[j]
        for i in range(NUM_NAVIGATION):
            noise[i] += noise_columns[j, i] * factor


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def move_bias(step: Floats, true_bias: Floats, noise: Floats) -> None:
    """Let the biases of a run (6,) take a step (6,), which acts on their errors, too."""
    for a in range(6):
        noise[NUM_NAVIGATION + a] = step[a]
        true_bias[a] += step[a]


@njit(cache=True, nogil=True, error_model="numpy")
def carry_unaided(runs: Runs, index: Runs, transition_columns: Floats, auxiliary: Floats) -> None:
    """d <- Φ d of the unaided solutions of runs minus the filters', to the epochs that these have reached."""
    work, nothing = np.empty(NUM_NAVIGATION), np.zeros(auxiliary.shape[1])
    for run in runs:
        columns = transition_columns[index[run], : auxiliary.shape[1]]
        kalman.predict_error(columns, nothing, auxiliary[run], work)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def observe(observation: Floats, state: Floats, deviation: Floats, residual: Floats) -> None:
    """z = H x - deviation; H (m, h), x (n,), the others (m,)."""
    observed = observation.shape[1]
    if observed == NUM_NAVIGATION:
        _observe(NUM_NAVIGATION, observation, state, deviation, residual)
    else:
        _observe(observed, observation, state, deviation, residual)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _observe(observed: int, observation: Floats, state: Floats, deviation: Floats, residual: Floats) -> None:
    for a in range(residual.shape[0]):
        total = -deviation[a]
        for j in range(observed):
            total += observation[a, j] * state[j]
        residual[a] = total
