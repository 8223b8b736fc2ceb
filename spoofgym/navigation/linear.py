"""The linear fidelity: N error states, one step per GNSS epoch, along the precomputed model of the true trajectory."""

from __future__ import annotations

import numpy as np
from numba import njit

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation import kalman
from spoofgym.navigation.error_model import NUM_NAVIGATION, NUM_STATES
from spoofgym.navigation.interface import Decision, Innovation
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.warm_start import CONSTANT_BIAS, ERROR, INSTABILITY
from spoofgym.parallel import RunSlices
from spoofgym.sensors.imu import ImuGrade
from spoofgym.streams import RunStreams

GRAIN = 4096
"""Runs below which a slice of the light kernels is not worth a thread: handing it over takes about 0.1 ms."""
COVARIANCE_GRAIN = 128
POSITION = slice(6, 9)
BIAS = slice(9, 15)


class LinearNavigator:
    """N runs of the true error under a filter with shared, precomputed gains: every run uses every fix.

    Attributes:
        model: the game.
        state: the true error of the 15 states, (N, 15).
        index: the epoch where each run stands, (N,); -1 before the first.
        normals: standard normal process noise of the episode, (N, K+1, 9); overwrite it to inject a noise path.
        bias_steps: changes of the biases at each epoch, (N, K+1, 6), or (N, 0, 6) where they are constant.
        true_bias: gyro and accelerometer biases, (N, 6), rad/s and m/s².
    """

    def __init__(self, model: LinearModel, grade: ImuGrade, interval: float, num_runs: int, slices: RunSlices) -> None:
        """Allocate ``num_runs`` runs; `reset` starts them.

        Args:
            model: of the game.
            grade: of the IMU: its bias instability acts during the game.
            interval: between epochs, s.
            num_runs: N.
            slices: the threads to use.
        """
        epochs = model.num_epochs + 1
        self.model = model
        self.state = np.zeros((num_runs, NUM_STATES))
        self.index = np.full(num_runs, -1)
        self.normals = np.zeros((num_runs, epochs, NUM_NAVIGATION))
        unstable = bool(np.any(grade.instability_sigma))
        self.bias_steps = np.zeros((num_runs, epochs if unstable else 0, 6))
        self.true_bias = np.zeros((num_runs, 6))
        self._decay = float(np.exp(-interval / grade.correlation_time))
        self._instability = grade.instability_sigma
        self._slices = slices
        self._all = np.arange(num_runs)
        self._whitened = np.zeros((num_runs, model.dimension))

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0.

        Args:
            runs: which, (n,).
            initial: joint state y drawn for them, (n, 30).
            streams: the random streams of all runs.
        """
        self.index[runs] = -1
        self.state[runs] = initial[:, ERROR]
        self.true_bias[runs] = initial[:, CONSTANT_BIAS] + initial[:, INSTABILITY]
        for run in runs.tolist():
            streams(run, "imu").standard_normal(out=self.normals[run])
        if self.bias_steps.shape[1]:
            self._draw_bias_steps(runs, initial[:, INSTABILITY], streams)

    def _draw_bias_steps(self, runs: Runs, value: Floats, streams: RunStreams) -> None:
        """Gauss-Markov path of the bias instability; its changes act on the bias error."""
        driving = self._instability * np.sqrt(1.0 - self._decay**2)
        normals = np.stack([streams(run, "imu").standard_normal(self.bias_steps.shape[1:]) for run in runs])
        for k in range(self.bias_steps.shape[1]):
            following = self._decay * value + driving * normals[:, k]
            self.bias_steps[runs, k] = following - value
            value = following

    def propagate(self, runs: Runs | None = None) -> None:
        """Carry runs (all by default) to their next epoch."""
        model = self.model
        self._slices.call(
            lambda part: _propagate(
                part,
                self.index,
                self.state,
                model.transition_columns,
                model.noise_columns,
                self.normals,
                self.bias_steps,
            ),
            self._all if runs is None else runs,
            GRAIN,
        )
        if self.bias_steps.shape[1]:
            moved = self._all if runs is None else runs
            self.true_bias[moved] += self.bias_steps[moved, self.index[moved]]

    def innovate(self, deviation: Floats, runs: Runs | None = None) -> Innovation:
        """Form the innovation of runs (all by default).

        Args:
            deviation: receiver noise plus offset, (n, m).
            runs: which, (n,).
        """
        runs = self._all if runs is None else runs
        residual, whitened, nis = np.empty_like(deviation), np.empty_like(deviation), np.empty(len(runs))
        model = self.model
        self._slices.call(
            lambda part: _innovate(
                part,
                runs,
                self.index,
                self.state,
                model.observation,
                model.innovation_factor,
                deviation,
                residual,
                whitened,
                nis,
            ),
            self._all[: len(runs)],
            GRAIN,
        )
        self._whitened[runs] = whitened
        return Innovation(residual, model.innovation_covariance[self.index[runs]], whitened, nis)

    def resolve(self, decision: Decision, runs: Runs | None = None) -> None:
        """Apply the fix of runs (all by default).

        Raises:
            ValueError: a fix is left out, which shared gains cannot follow.
        """
        if not decision.use.all():
            raise ValueError("a fix is left out, but the gains are shared: the navigator needs a covariance per run")
        self._slices.call(
            lambda part: _correct_shared(part, self.index, self.state, self.model.whitened_gain, self._whitened),
            self._all if runs is None else runs,
            GRAIN,
        )

    @property
    def error(self) -> Floats:
        """Estimate minus truth, (N, 3), m ENU."""
        return self.state[:, POSITION].copy()

    @property
    def position_covariance(self) -> Floats:
        """The filter's covariance of the position before the fix of the present epoch, (N, 3, 3), m²."""
        return self.model.covariance[self.index, POSITION, POSITION]

    @property
    def estimated_bias(self) -> Floats:
        """Gyro and accelerometer biases that the filter has estimated, (N, 6), rad/s and m/s²."""
        return self.true_bias - self.state[:, BIAS]


class OwnCovarianceNavigator(LinearNavigator):
    """N runs of the true error, each with a covariance of its own, because a fix can be left out.

    Attributes:
        covariance: the filter's P of each run, (N, 15, 15).
    """

    def __init__(self, model: LinearModel, grade: ImuGrade, interval: float, num_runs: int, slices: RunSlices) -> None:
        """As for `LinearNavigator`."""
        super().__init__(model, grade, interval, num_runs, slices)
        m = model.dimension
        self.covariance = np.zeros((num_runs, NUM_STATES, NUM_STATES))
        self._gain = np.zeros((num_runs, NUM_STATES, m))

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0, with the filter's warm covariance."""
        super().reset(runs, initial, streams)
        self.covariance[runs] = self.model.prior_covariance

    def propagate(self, runs: Runs | None = None) -> None:
        """Carry runs (all by default) to their next epoch."""
        super().propagate(runs)
        model = self.model
        self._slices.call(
            lambda part: _propagate_covariance(
                part, self.index, self.covariance, model.transition, model.process_noise
            ),
            self._all if runs is None else runs,
            COVARIANCE_GRAIN,
        )

    def innovate(self, deviation: Floats, runs: Runs | None = None) -> Innovation:
        """Form the innovation of runs (all by default)."""
        runs = self._all if runs is None else runs
        residual, whitened, nis = np.empty_like(deviation), np.empty_like(deviation), np.empty(len(runs))
        innovation = np.empty((len(runs), self.model.dimension, self.model.dimension))
        model = self.model
        self._slices.call(
            lambda part: _innovate_own(
                part,
                runs,
                self.index,
                self.state,
                self.covariance,
                model.observation,
                model.measurement_covariance,
                deviation,
                innovation,
                self._gain,
                residual,
                whitened,
                nis,
            ),
            self._all[: len(runs)],
            COVARIANCE_GRAIN,
        )
        self._whitened[runs] = whitened
        return Innovation(residual, innovation, whitened, nis)

    def resolve(self, decision: Decision, runs: Runs | None = None) -> None:
        """Apply the fix where the decision says so; elsewhere the run coasts."""
        self._slices.call(
            lambda part: _correct_own(part, self.state, self.covariance, self._gain, self._whitened),
            (self._all if runs is None else runs)[decision.use],
            COVARIANCE_GRAIN,
        )

    @property
    def position_covariance(self) -> Floats:
        """The filter's covariance of the position, (N, 3, 3), m²."""
        return self.covariance[:, POSITION, POSITION].copy()


@njit(cache=True, nogil=True, error_model="numpy")
def _propagate(
    runs: Runs,
    index: Runs,
    state: Floats,
    transition_columns: Floats,
    noise_columns: Floats,
    normals: Floats,
    bias_steps: Floats,
) -> None:
    """index <- index + 1, x <- Φ x + w."""
    work, noise = np.empty(NUM_NAVIGATION), np.zeros(NUM_STATES)
    for run in runs:
        index[run] += 1
        k = index[run]
        for i in range(NUM_NAVIGATION):
            noise[i] = 0.0
        for j in range(NUM_NAVIGATION):
            factor = normals[run, k, j]
            for i in range(NUM_NAVIGATION):
                noise[i] += noise_columns[k, j, i] * factor
        if bias_steps.shape[1] > 0:
            for i in range(6):
                noise[NUM_NAVIGATION + i] = bias_steps[run, k, i]
        kalman.predict_error(transition_columns[k], noise, state[run], work)


@njit(cache=True, nogil=True, error_model="numpy")
def _observe(observation: Floats, state: Floats, deviation: Floats, residual: Floats) -> None:
    """z = H x - deviation."""
    for a in range(residual.shape[0]):
        total = -deviation[a]
        for j in range(NUM_NAVIGATION):
            total += observation[a, j] * state[j]
        residual[a] = total


@njit(cache=True, nogil=True, error_model="numpy")
def _innovate(
    places: Runs,
    runs: Runs,
    index: Runs,
    state: Floats,
    observation: Floats,
    factor: Floats,
    deviation: Floats,
    residual: Floats,
    whitened: Floats,
    nis: Floats,
) -> None:
    """Innovation with shared S; outputs stand at the places of the runs."""
    for place in places:
        run = runs[place]
        _observe(observation[index[run]], state[run], deviation[place], residual[place])
        nis[place] = kalman.whiten(factor[index[run]], residual[place], whitened[place])


@njit(cache=True, nogil=True, error_model="numpy")
def _correct_shared(runs: Runs, index: Runs, state: Floats, gain: Floats, whitened: Floats) -> None:
    """x <- x - U w."""
    for run in runs:
        kalman.correct_error(gain[index[run]], whitened[run], state[run])


@njit(cache=True, nogil=True, error_model="numpy")
def _propagate_covariance(
    runs: Runs, index: Runs, covariance: Floats, transition: Floats, process_noise: Floats
) -> None:
    """P <- Φ P Φ' + Q."""
    work = np.empty((NUM_NAVIGATION, NUM_STATES))
    for run in runs:
        k = index[run]
        kalman.predict_covariance(transition[k], process_noise[k], covariance[run], work)


@njit(cache=True, nogil=True, error_model="numpy")
def _innovate_own(
    places: Runs,
    runs: Runs,
    index: Runs,
    state: Floats,
    covariance: Floats,
    observation: Floats,
    measurement_covariance: Floats,
    deviation: Floats,
    innovation: Floats,
    gain: Floats,
    residual: Floats,
    whitened: Floats,
    nis: Floats,
) -> None:
    """Innovation with each run's own S, and its whitened gain."""
    m = observation.shape[1]
    cross, factor = np.empty((NUM_STATES, m)), np.empty((m, m))
    for place in places:
        run = runs[place]
        k = index[run]
        _observe(observation[k], state[run], deviation[place], residual[place])
        kalman.innovation_covariance(covariance[run], observation[k], measurement_covariance, cross, innovation[place])
        kalman.cholesky(innovation[place], factor)
        kalman.whitened_gain(cross, factor, gain[run])
        nis[place] = kalman.whiten(factor, residual[place], whitened[place])


@njit(cache=True, nogil=True, error_model="numpy")
def _correct_own(runs: Runs, state: Floats, covariance: Floats, gain: Floats, whitened: Floats) -> None:
    """x <- x - U w, P <- P - U U'."""
    for run in runs:
        kalman.correct_error(gain[run], whitened[run], state[run])
        kalman.update_covariance(gain[run], covariance[run])
