"""The linear fidelity with a covariance per run, because a fix can be left out, and with a history to go back in."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.batch import InnovationArrays, Weights, empty_innovation
from spoofgym.navigation.error_model import NUM_INERTIAL, NUM_NAVIGATION, POSITION
from spoofgym.navigation.history import History, Ring, keep
from spoofgym.navigation.interface import NO_DEMANDS, Demands, Innovation
from spoofgym.navigation.linear_model import LinearModel, LinearSteps
from spoofgym.navigation.loose.dynamics import (
    ErrorBatch,
    ErrorRuns,
    carry_unaided,
    draw_process_noise,
    move_bias,
    observe,
)
from spoofgym.navigation.loose.innovation import FilterNoise, FilterRuns, FixNoise, constant_noise, form_innovation
from spoofgym.parallel import RunSlices
from spoofgym.sensors.imu import ImuGrade
from spoofgym.streams import RunStreams

GRAIN = 128
"""Runs below which a slice is not worth a thread."""


class OwnCovarianceNavigator(ErrorBatch):
    """N runs of the true error, each with a covariance of its own.

    Attributes:
        covariance: the filter's P of each run, (N, n, n).
    """

    grain = carry_grain = GRAIN

    def __init__(
        self,
        model: LinearModel,
        grade: ImuGrade,
        interval: float,
        num_runs: int,
        slices: RunSlices,
        demands: Demands = NO_DEMANDS,
        noise: FilterNoise | None = None,
    ) -> None:
        """As for `ErrorBatch`; ``noise`` is what the filters believe, by default that of the model."""
        super().__init__(model, grade, interval, num_runs, slices, demands)
        n = model.num_states
        self.covariance = np.zeros((num_runs, n, n))
        self._gain = np.zeros((num_runs, model.dimension, n))
        self._filters = FilterRuns(self.covariance, self._gain, self._deviation, self._whitened)
        self._noise = constant_noise(model.measurement_covariance, num_runs) if noise is None else noise
        self.past = History(demands.history, self.covariance, state=self.state)
        if self.bias_steps.shape[1]:  # else the true biases are constant
            self.past.add(true_bias=self.true_bias)

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0, with the filter's warm covariance."""
        super().reset(runs, initial, streams)
        self.covariance[runs] = self.model.prior_covariance

    def _carry(self, runs: Runs, epochs: Runs, auxiliary: Floats) -> None:
        steps = self.model.steps
        _carry(runs, epochs, steps, self._noise.process_scale, self._runs, self.past.ring)
        if auxiliary.shape[1]:
            carry_unaided(runs, self.index, steps.transition_columns, auxiliary)

    def _innovate(self, runs: Runs, weights: Weights) -> Innovation:
        formed = empty_innovation(len(runs), self.model.dimension)
        noise = FixNoise(self._noise.covariance, self._noise.row, weights.noise_scale)
        self._on_slices(
            lambda part: _innovate(
                part, runs, self.index, self.state, self.model.observation, noise, self._filters, formed
            ),
            self._all[: len(runs)],
        )
        self._whitened[self._where(runs)] = formed.whitened
        return Innovation(*formed)

    def _correct(self, runs: Runs) -> None:
        self._on_slices(lambda part: _correct(part, self._gain, self._whitened, self.state, self.covariance), runs)

    def _reset_to_fix(self, runs: Runs, variance: Floats) -> None:
        """Position and, where the receiver gives it, velocity jump to the fix; their correlations are forgotten."""
        observation = self.model.observation
        _reset(runs, variance, self.index, self.state, observation, self._noise, self._filters)

    def _past_error(self, epochs: Runs) -> Floats:
        state: Floats = self.past.recall("state", epochs)
        return state[:, :, POSITION]

    @property
    def position_covariance(self) -> Floats:
        """The filter's covariance of the position, (N, 3, 3), m²."""
        return self.covariance[:, POSITION, POSITION].copy()

    @property
    def fix_gain(self) -> Floats:
        """U' for the fix of the present epoch, (N, m, 15)."""
        return self._gain[:, :, :NUM_INERTIAL].copy()


@njit(cache=True, nogil=True, error_model="numpy")
def _scaled(process_noise: Floats, scale: float, work: Floats) -> Floats:
    """Scale times Q, in work (n, n) unless it is Q itself."""
    if scale == 1.0:
        return process_noise
    for i in range(work.shape[0]):
        for j in range(work.shape[1]):
            work[i, j] = scale * process_noise[i, j]
    return work


@njit(cache=True, nogil=True, error_model="numpy")
def _carry(runs: Runs, epochs: Runs, steps: LinearSteps, process_scale: Floats, errors: ErrorRuns, ring: Ring) -> None:
    """Carry runs over so many epochs each: keep the states, x <- Φ x + w, P <- Φ P Φ' + Q."""
    # named tuples are taken apart here: in the loop that would cost more than the equations
    transition_columns, transition, process_noise, noise_columns = steps
    index, state, true_bias, normals, bias_steps = errors
    covariance, remembers = ring.covariance, ring.past_covariance.shape[1] > 0
    n = state.shape[1]
    work, noise = np.empty(NUM_NAVIGATION), np.zeros(n)
    product, scaled = np.empty((NUM_NAVIGATION, n)), np.empty((n, n))
    for run in runs:
        for _ in range(epochs[run]):
            index[run] += 1
            k = index[run]
            if remembers:
                keep(run, k, ring)
            draw_process_noise(noise_columns[k], normals[run, k], noise)
            if bias_steps.shape[1] > 0:
                move_bias(bias_steps[run, k], true_bias[run], noise)
            kalman.predict_error(transition_columns[k], noise, state[run], work)
            noise_added = _scaled(process_noise[k], process_scale[run], scaled)
            kalman.predict_covariance(transition[k], noise_added, covariance[run], product)


@njit(cache=True, nogil=True, error_model="numpy")
def _innovate(
    places: Runs,
    runs: Runs,
    index: Runs,
    state: Floats,
    observation: Floats,
    noise: FixNoise,
    filters: FilterRuns,
    formed: InnovationArrays,
) -> None:
    """Innovation with each run's own S, and its whitened gain; outputs but the gain stand at the places of the runs."""
    variance, row, scale = noise
    covariance, gain, deviation, _ = filters
    residual, innovation, whitened, nis = formed
    m = observation.shape[1]
    cross, factor = np.empty((m, state.shape[1])), np.empty((m, m))
    for place in places:
        run = runs[place]
        matrix = observation[index[run]]
        observe(matrix, state[run], deviation[run], residual[place])
        form_innovation(
            covariance[run], matrix, variance[row[run]], scale[place], innovation[place], gain[run], cross, factor
        )
        nis[place] = kalman.whiten(factor, residual[place], whitened[place])


@njit(cache=True, nogil=True, error_model="numpy")
def _correct(runs: Runs, gain: Floats, whitened: Floats, state: Floats, covariance: Floats) -> None:
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
    observation: Floats,
    noise: FilterNoise,
    filters: FilterRuns,
) -> None:
    """Move velocity, then position, by what is left of the residual, so that it becomes zero."""
    m = observation.shape[1]
    residual = np.empty(m)
    for place in range(len(runs)):
        run = runs[place]
        matrix, covariance, deviation = observation[index[run]], filters.covariance[run], filters.deviation[run]
        if m == 6:
            observe(matrix, state[run], deviation, residual)
            for a in range(3):
                state[run, 3 + a] -= residual[3 + a]
                kalman.forget_correlations(3 + a, noise.covariance[noise.row[run], 3 + a, 3 + a], covariance)
        observe(matrix, state[run], deviation, residual)
        for a in range(3):
            state[run, 6 + a] -= residual[a]
            kalman.forget_correlations(6 + a, variance[place], covariance)
