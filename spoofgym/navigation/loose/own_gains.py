"""The linear fidelity with a covariance per run, because a fix can be left out, and with a history to go back in."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.error_model import NUM_NAVIGATION, NUM_STATES
from spoofgym.navigation.interface import Decision, Demands, Innovation
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.shared_gains import (
    NO_DEMANDS,
    POSITION,
    LinearNavigator,
    draw_process_noise,
    observe,
)
from spoofgym.parallel import RunSlices
from spoofgym.sensors.imu import ImuGrade
from spoofgym.streams import RunStreams

GRAIN = 128
"""Runs below which a slice is not worth a thread."""
NUM_PACKED = NUM_STATES * (NUM_STATES + 1) // 2


class OwnCovarianceNavigator(LinearNavigator):
    """N runs of the true error, each with a covariance of its own.

    The history is a ring of the states after each resolved epoch. A backtrack of n epochs restores the state after the
    fix before them and carries it to the present epoch by the stored transitions and the stored noise of the episode,
    writing the ring over with the unaided states.

    Attributes:
        covariance: the filter's P of each run, (N, 15, 15).
        history: epochs that can be taken back.
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
        """As for `LinearNavigator`."""
        super().__init__(model, grade, interval, num_runs, slices, demands)
        m, slots = model.dimension, demands.history + 1 if demands.history else 0
        self.covariance = np.zeros((num_runs, NUM_STATES, NUM_STATES))
        self.history = demands.history
        self._gain = np.zeros((num_runs, m, NUM_STATES))
        self._deviation = np.zeros((num_runs, m))
        self._past_state = np.zeros((num_runs, slots, NUM_STATES))
        self._past_covariance = np.zeros((num_runs, slots, NUM_PACKED))
        self._ones = np.ones(num_runs)
        self._measurement_covariance = np.tile(model.measurement_covariance, (num_runs, 1, 1))
        self._process_scale = np.ones(num_runs)

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0, with the filter's warm covariance."""
        super().reset(runs, initial, streams)
        self.covariance[runs] = self.model.prior_covariance

    def propagate(self, runs: Runs | None = None) -> None:
        """Carry runs (all by default) to their next epoch."""
        model = self.model
        runs = self._all if runs is None else runs
        self._slices.call(
            lambda part: _propagate(
                part,
                self.index,
                self.state,
                self.covariance,
                model.transition_columns,
                model.transition,
                model.process_noise,
                self._process_scale,
                model.noise_columns,
                self.normals,
                self.bias_steps,
                self._past_state,
                self._past_covariance,
            ),
            runs,
            GRAIN,
        )
        self._follow(runs)

    def innovate(self, deviation: Floats, runs: Runs | None = None) -> Innovation:
        """Form the innovation of runs (all by default)."""
        runs = self._all if runs is None else runs
        self._deviation[runs] = deviation
        return self._innovate(runs, self._ones[: len(runs)])

    def _innovate(self, runs: Runs, noise_scale: Floats) -> Innovation:
        """The innovation of the present fix with R times ``noise_scale`` (n,)."""
        m, model = self.model.dimension, self.model
        residual, whitened, nis = np.empty((len(runs), m)), np.empty((len(runs), m)), np.empty(len(runs))
        covariance = np.empty((len(runs), m, m))
        self._slices.call(
            lambda part: _innovate_own(
                part,
                runs,
                self.index,
                self.state,
                self.covariance,
                model.observation,
                self._measurement_covariance,
                noise_scale,
                self._deviation,
                covariance,
                self._gain,
                residual,
                whitened,
                nis,
            ),
            self._all[: len(runs)],
            GRAIN,
        )
        self._whitened[runs] = whitened
        return Innovation(residual, covariance, whitened, nis)

    def resolve(self, decision: Decision, runs: Runs | None = None) -> None:
        """Take fixes back, then apply the present one, or reset to it, where the decision says so; else coast.

        Raises:
            ValueError: a backtrack without a history.
        """
        runs = self._all if runs is None else runs
        with self._keep_auxiliary(runs):
            fresh = self._take_back(decision, runs)
            used = decision.use
            if decision.noise_scale is not None:
                fresh |= decision.noise_scale != 1.0
            again = np.flatnonzero(fresh & used)
            if len(again):
                scale = self._ones[: len(again)] if decision.noise_scale is None else decision.noise_scale[again]
                self._innovate(runs[again], scale)
            if decision.reset is not None:
                jumps = used & (decision.reset > 0.0)
                self._reset_to_fix(runs[jumps], decision.reset[jumps])
                used = used & ~jumps
            self._correct(runs[used])

    def _correct(self, runs: Runs) -> None:
        """Apply the present fix."""
        self._slices.call(
            lambda part: _correct_own(part, self.state, self.covariance, self._gain, self._whitened), runs, GRAIN
        )

    def _take_back(self, decision: Decision, runs: Runs) -> Flags:
        """Backtrack where it is decided; whether the innovation must be formed anew, (n,)."""
        self.backtracked[runs] = 0
        fresh = np.zeros(len(runs), dtype=bool)
        if decision.backtrack is None or not decision.backtrack.any():
            return fresh
        if not self.history:
            raise ValueError("a backtrack is decided, but the navigator keeps no history: demand one when it is built")
        depth = np.minimum(np.minimum(decision.backtrack, self.history), self.index[runs])
        self.backtracked[runs] = depth
        fresh = depth > 0
        self._go_back(runs[fresh])
        return fresh

    def _go_back(self, runs: Runs) -> None:
        """Restore the state before the fixes taken back, and carry it to the present epoch without them."""
        model = self.model
        self._slices.call(
            lambda part: _backtrack(
                part,
                self.backtracked,
                self.index,
                self.state,
                self.covariance,
                model.transition_columns,
                model.transition,
                model.process_noise,
                self._process_scale,
                model.noise_columns,
                self.normals,
                self.bias_steps,
                self._past_state,
                self._past_covariance,
            ),
            runs,
            1,
        )

    def _reset_to_fix(self, runs: Runs, variance: Floats) -> None:
        """Position and, where the receiver gives it, velocity jump to the fix; their correlations are forgotten."""
        if len(runs):
            _reset(
                runs,
                variance,
                self.index,
                self.state,
                self.covariance,
                self.model.observation,
                self._measurement_covariance,
                self._deviation,
            )

    @property
    def position_covariance(self) -> Floats:
        """The filter's covariance of the position, (N, 3, 3), m²."""
        return self.covariance[:, POSITION, POSITION].copy()

    def recomputed_error(self, epochs: int) -> Floats:
        """Errors after each of the last epochs as backtracking has rewritten them, (N, epochs, 3), m ENU, oldest first.

        The present epoch, which is not resolved yet or has been resolved last, is not among them. Epochs before the
        episode are zero. Errors of record are those of the real-time output, `error`.

        Raises:
            ValueError: more epochs than the history holds.
        """
        if not 0 <= epochs <= self.history:
            raise ValueError(f"epochs must be from 0 to the history of {self.history}, got {epochs}")
        order = self.index[:, None] - epochs + np.arange(epochs)
        slots = self._past_state.shape[1]
        track = self._past_state[self._all[:, None], (order + 1) % max(slots, 1)][:, :, POSITION]
        return np.where(order[:, :, None] >= 0, track, 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _pack(covariance: Floats, packed: Floats) -> None:
    """The lower triangle by rows, (120,)."""
    place = 0
    for i in range(NUM_STATES):
        for j in range(i + 1):
            packed[place] = covariance[i, j]
            place += 1


@njit(cache=True, nogil=True, error_model="numpy")
def _unpack(packed: Floats, covariance: Floats) -> None:
    place = 0
    for i in range(NUM_STATES):
        for j in range(i + 1):
            covariance[i, j] = packed[place]
            covariance[j, i] = packed[place]
            place += 1


@njit(cache=True, nogil=True, error_model="numpy")
def _scaled(process_noise: Floats, scale: float, work: Floats) -> Floats:
    """Scale times Q, in work (15, 15) unless it is Q itself."""
    if scale == 1.0:
        return process_noise
    for i in range(NUM_STATES):
        for j in range(NUM_STATES):
            work[i, j] = scale * process_noise[i, j]
    return work


@njit(cache=True, nogil=True, error_model="numpy")
def _propagate(
    runs: Runs,
    index: Runs,
    state: Floats,
    covariance: Floats,
    transition_columns: Floats,
    transition: Floats,
    process_noise: Floats,
    process_scale: Floats,
    noise_columns: Floats,
    normals: Floats,
    bias_steps: Floats,
    past_state: Floats,
    past_covariance: Floats,
) -> None:
    """Keep the resolved state, index <- index + 1, x <- Φ x + w, P <- Φ P Φ' + Q."""
    work, noise = np.empty(NUM_NAVIGATION), np.zeros(NUM_STATES)
    product, scaled = np.empty((NUM_NAVIGATION, NUM_STATES)), np.empty((NUM_STATES, NUM_STATES))
    slots = past_state.shape[1]
    for run in runs:
        index[run] += 1
        k = index[run]
        if slots > 0:
            past_state[run, k % slots] = state[run]
            _pack(covariance[run], past_covariance[run, k % slots])
        draw_process_noise(run, k, noise_columns, normals, bias_steps, noise)
        kalman.predict_error(transition_columns[k], noise, state[run], work)
        noise_added = _scaled(process_noise[k], process_scale[run], scaled)
        kalman.predict_covariance(transition[k], noise_added, covariance[run], product)


@njit(cache=True, nogil=True, error_model="numpy")
def _backtrack(
    runs: Runs,
    depth: Runs,
    index: Runs,
    state: Floats,
    covariance: Floats,
    transition_columns: Floats,
    transition: Floats,
    process_noise: Floats,
    process_scale: Floats,
    noise_columns: Floats,
    normals: Floats,
    bias_steps: Floats,
    past_state: Floats,
    past_covariance: Floats,
) -> None:
    """Restore the state after epoch k - n - 1 and carry it to epoch k by inertial measurements alone."""
    work, noise = np.empty(NUM_NAVIGATION), np.zeros(NUM_STATES)
    product, scaled = np.empty((NUM_NAVIGATION, NUM_STATES)), np.empty((NUM_STATES, NUM_STATES))
    slots = past_state.shape[1]
    for run in runs:
        first, last = index[run] - depth[run], index[run]
        state[run] = past_state[run, first % slots]
        _unpack(past_covariance[run, first % slots], covariance[run])
        for k in range(first, last + 1):
            if k > first:
                past_state[run, k % slots] = state[run]
                _pack(covariance[run], past_covariance[run, k % slots])
            draw_process_noise(run, k, noise_columns, normals, bias_steps, noise)
            kalman.predict_error(transition_columns[k], noise, state[run], work)
            noise_added = _scaled(process_noise[k], process_scale[run], scaled)
            kalman.predict_covariance(transition[k], noise_added, covariance[run], product)


@njit(cache=True, nogil=True, error_model="numpy")
def _innovate_own(
    places: Runs,
    runs: Runs,
    index: Runs,
    state: Floats,
    covariance: Floats,
    observation: Floats,
    measurement_covariance: Floats,
    noise_scale: Floats,
    deviation: Floats,
    innovation: Floats,
    gain: Floats,
    residual: Floats,
    whitened: Floats,
    nis: Floats,
) -> None:
    """Innovation with each run's own S, and its whitened gain; outputs but the gain stand at the places of the runs."""
    m = observation.shape[1]
    cross, factor = np.empty((m, NUM_STATES)), np.empty((m, m))
    for place in places:
        run = runs[place]
        k = index[run]
        observe(observation[k], state[run], deviation[run], residual[place])
        noise = measurement_covariance[run]
        kalman.innovation_covariance(covariance[run], observation[k], noise, cross, innovation[place])
        kalman.scale_noise(noise_scale[place], noise, innovation[place])
        kalman.cholesky(innovation[place], factor)
        kalman.whitened_gain(cross, factor, gain[run])
        nis[place] = kalman.whiten(factor, residual[place], whitened[place])


@njit(cache=True, nogil=True, error_model="numpy")
def _correct_own(runs: Runs, state: Floats, covariance: Floats, gain: Floats, whitened: Floats) -> None:
    """x <- x - U w, P <- P - U U'."""
    for run in runs:
        kalman.correct_error(gain[run], whitened[run], state[run])
        kalman.update_covariance(gain[run], covariance[run])


@njit(cache=True, nogil=True, error_model="numpy")
def _reset(
    runs: Runs,
    variance: Floats,
    index: Runs,
    state: Floats,
    covariance: Floats,
    observation: Floats,
    measurement_covariance: Floats,
    deviation: Floats,
) -> None:
    """Move velocity, then position, by what is left of the residual, so that it becomes zero."""
    m = observation.shape[1]
    residual = np.empty(m)
    for place in range(len(runs)):
        run = runs[place]
        k = index[run]
        if m == 6:
            observe(observation[k], state[run], deviation[run], residual)
            for a in range(3):
                state[run, 3 + a] -= residual[3 + a]
                kalman.forget_correlations(3 + a, measurement_covariance[run, 3 + a, 3 + a], covariance[run])
        observe(observation[k], state[run], deviation[run], residual)
        for a in range(3):
            state[run, 6 + a] -= residual[a]
            kalman.forget_correlations(6 + a, variance[place], covariance[run])
