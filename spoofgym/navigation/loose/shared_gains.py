"""The linear fidelity: N error states, one step per GNSS epoch, along the precomputed model of the true trajectory."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.error_model import NUM_NAVIGATION, NUM_STATES
from spoofgym.navigation.interface import Decision, Demands, Innovation
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.warm_start import CONSTANT_BIAS, ERROR, INSTABILITY
from spoofgym.parallel import RunSlices
from spoofgym.sensors.imu import ImuGrade
from spoofgym.streams import RunStreams

NO_DEMANDS = Demands()
GRAIN = 4096
"""Runs below which a slice of the light kernels is not worth a thread: handing it over takes about 0.1 ms."""
VELOCITY = slice(3, 6)
POSITION = slice(6, 9)
BIAS = slice(9, 15)


class LinearNavigator:
    """N runs of the true error under a filter with shared, precomputed gains: every run uses every fix.

    Attributes:
        model: the game.
        state: the true error of the 15 states, (N, 15).
        index: the epoch where each run stands, (N,); -1 before the first.
        diverged: whether the filter has diverged, (N,); a linear one never does.
        normals: standard normal process noise of the episode, (N, K+1, 9); overwrite it to inject a noise path.
        bias_steps: changes of the biases at each epoch, (N, K+1, 6), or (N, 0, 6) where they are constant.
        true_bias: gyro and accelerometer biases, (N, 6), rad/s and m/s².
        backtracked: epochs that the last `resolve` took back, (N,).
        auxiliary: state of the unaided inertial solution minus that of the filter, (N, 15), or (N, 0) if not demanded:
            both meet the same noise, so that Φ alone carries it.
    """

    def __init__(
        self,
        model: LinearModel,
        grade: ImuGrade,
        interval: float,
        num_runs: int,
        slices: RunSlices,
        demands: Demands = NO_DEMANDS,
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
        epochs = model.num_epochs + 1
        self.model = model
        self.state = np.zeros((num_runs, NUM_STATES))
        self.index = np.full(num_runs, -1)
        self.diverged = np.zeros(num_runs, dtype=bool)  # a linear filter never does
        self.normals = np.zeros((num_runs, epochs, NUM_NAVIGATION))
        unstable = bool(np.any(grade.instability_sigma))
        self.bias_steps = np.zeros((num_runs, epochs if unstable else 0, 6))
        self.true_bias = np.zeros((num_runs, 6))
        self._decay = float(np.exp(-interval / grade.correlation_time))
        self._instability = grade.instability_sigma
        self._slices = slices
        self._all = np.arange(num_runs)
        self._whitened = np.zeros((num_runs, model.dimension))
        self.backtracked = np.zeros(num_runs, dtype=np.int64)
        self.auxiliary = np.zeros((num_runs, NUM_STATES if demands.auxiliary else 0))

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
        self.backtracked[runs] = 0
        self.auxiliary[runs] = 0.0
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

    def restart_auxiliary(self, runs: Runs) -> None:
        """Let the unaided inertial solution of runs, where there is one, begin anew from the filter's."""
        self.auxiliary[runs] = 0.0

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
        self._follow(self._all if runs is None else runs)

    def _follow(self, runs: Runs) -> None:
        """Carry what goes along with the error states of runs to the epoch that these have reached."""
        if self.bias_steps.shape[1]:
            self.true_bias[runs] += self.bias_steps[runs, self.index[runs]]
        if self.auxiliary.shape[1]:
            _propagate_auxiliary(runs, self.index, self.model.transition_columns, self.auxiliary)

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
        others = (decision.backtrack, decision.reset, decision.noise_scale)
        if not decision.use.all() or any(part is not None for part in others):
            raise ValueError("a fix is left out, but the gains are shared: the navigator needs a covariance per run")
        with self._keep_auxiliary(self._all if runs is None else runs):
            self._apply(runs)

    def _apply(self, runs: Runs | None) -> None:
        self._slices.call(
            lambda part: _correct_shared(part, self.index, self.state, self.model.whitened_gain, self._whitened),
            self._all if runs is None else runs,
            GRAIN,
        )

    @contextmanager
    def _keep_auxiliary(self, runs: Runs) -> Iterator[None]:
        """Let the filter's state change without moving the unaided solution."""
        before = self.state[runs] if self.auxiliary.shape[1] else None
        yield
        if before is not None:
            self.auxiliary[runs] += before - self.state[runs]

    @property
    def auxiliary_offset(self) -> Floats:
        """Position of the unaided inertial solution minus that of the filter, (N, 3), m ENU.

        Raises:
            RuntimeError: nobody demanded an unaided solution.
        """
        if not self.auxiliary.shape[1]:
            raise RuntimeError("this navigator has no unaided inertial solution: demand it when it is built")
        return self.auxiliary[:, POSITION].copy()

    @property
    def error(self) -> Floats:
        """Estimate minus truth, (N, 3), m ENU."""
        return self.state[:, POSITION].copy()

    @property
    def velocity_error(self) -> Floats:
        """Estimate minus truth, (N, 3), m/s ENU."""
        return self.state[:, VELOCITY].copy()

    @property
    def position_covariance(self) -> Floats:
        """The filter's covariance of the position before the fix of the present epoch, (N, 3, 3), m²."""
        return self.model.covariance[self.index, POSITION, POSITION]

    @property
    def estimated_bias(self) -> Floats:
        """Gyro and accelerometer biases that the filter has estimated, (N, 6), rad/s and m/s²."""
        return self.true_bias - self.state[:, BIAS]


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
        draw_process_noise(run, k, noise_columns, normals, bias_steps, noise)
        kalman.predict_error(transition_columns[k], noise, state[run], work)


@njit(cache=True, nogil=True, error_model="numpy")
def draw_process_noise(
    run: int, epoch: int, noise_columns: Floats, normals: Floats, bias_steps: Floats, noise: Floats
) -> None:
    """The noise w that acts on a run's error up to an epoch, (15,), from the episode's stored normals."""
    for i in range(NUM_NAVIGATION):
        noise[i] = 0.0
    for j in range(NUM_NAVIGATION):
        factor = normals[run, epoch, j]
        for i in range(NUM_NAVIGATION):
            noise[i] += noise_columns[epoch, j, i] * factor
    if bias_steps.shape[1] > 0:
        for i in range(6):
            noise[NUM_NAVIGATION + i] = bias_steps[run, epoch, i]


@njit(cache=True, nogil=True, error_model="numpy")
def _propagate_auxiliary(runs: Runs, index: Runs, transition_columns: Floats, auxiliary: Floats) -> None:
    """d <- Φ d."""
    work, nothing = np.empty(NUM_NAVIGATION), np.zeros(NUM_STATES)
    for run in runs:
        kalman.predict_error(transition_columns[index[run]], nothing, auxiliary[run], work)


@njit(cache=True, nogil=True, error_model="numpy")
def observe(observation: Floats, state: Floats, deviation: Floats, residual: Floats) -> None:
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
        observe(observation[index[run]], state[run], deviation[place], residual[place])
        nis[place] = kalman.whiten(factor[index[run]], residual[place], whitened[place])


@njit(cache=True, nogil=True, error_model="numpy")
def _correct_shared(runs: Runs, index: Runs, state: Floats, gain: Floats, whitened: Floats) -> None:
    """x <- x - U w."""
    for run in runs:
        kalman.correct_error(gain[index[run]], whitened[run], state[run])
