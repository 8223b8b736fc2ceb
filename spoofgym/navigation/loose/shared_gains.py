"""The linear fidelity: N error states, one step per GNSS epoch, along the precomputed model of the true trajectory."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.batch import InnovationArrays, SharedGains, Weights
from spoofgym.navigation.error_model import NUM_NAVIGATION, POSITION
from spoofgym.navigation.history import History
from spoofgym.navigation.interface import NO_DEMANDS, Demands, Innovation
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.dynamics import ErrorBatch, carry_unaided, draw_process_noise, move_bias, observe
from spoofgym.parallel import RunSlices
from spoofgym.sensors.imu import ImuGrade

GRAIN = 4096
"""Runs below which a slice of the light kernels is not worth a thread: handing it over takes about 0.1 ms."""


class LinearNavigator(SharedGains, ErrorBatch):
    """N runs of the true error under a filter with shared, precomputed gains: every run uses every fix."""

    grain = carry_grain = GRAIN

    def __init__(
        self,
        model: LinearModel,
        grade: ImuGrade,
        interval: float,
        num_runs: int,
        slices: RunSlices,
        demands: Demands = NO_DEMANDS,
    ) -> None:
        """As for `ErrorBatch`."""
        super().__init__(model, grade, interval, num_runs, slices, demands)
        self.past = History(0, np.zeros((num_runs, 0, 0)))

    def _carry(self, runs: Runs, epochs: Runs, auxiliary: Floats) -> None:
        """One epoch: no run can go back."""
        columns, noise_columns = self.model.steps.transition_columns, self.model.steps.noise_columns
        _carry(runs, self.index, columns, noise_columns, self.normals, self.bias_steps, self.state, self.true_bias)
        if auxiliary.shape[1]:
            carry_unaided(runs, self.index, columns, auxiliary)

    def _innovate(self, runs: Runs, weights: Weights) -> Innovation:
        model, m = self.model, self.model.dimension
        covariance = model.innovation_covariance[self.index[self._where(runs)]]
        formed = InnovationArrays(np.empty((len(runs), m)), covariance, np.empty((len(runs), m)), np.empty(len(runs)))
        self._on_slices(
            lambda part: _innovate(
                part,
                runs,
                self.index,
                self.state,
                model.observation,
                model.innovation_factor,
                self._deviation,
                formed,
            ),
            self._all[: len(runs)],
        )
        self._whitened[self._where(runs)] = formed.whitened
        return Innovation(*formed)

    def _correct(self, runs: Runs) -> None:
        self._on_slices(
            lambda part: _correct(part, self.index, self.model.whitened_gain, self._whitened, self.state), runs
        )

    @property
    def position_covariance(self) -> Floats:
        """The filter's covariance of the position before the fix of the present epoch, (N, 3, 3), m²."""
        return self.model.covariance[self.index, POSITION, POSITION]


@njit(cache=True, nogil=True, error_model="numpy")
def _carry(
    runs: Runs,
    index: Runs,
    transition_columns: Floats,
    noise_columns: Floats,
    normals: Floats,
    bias_steps: Floats,
    state: Floats,
    true_bias: Floats,
) -> None:
    """Carry runs to their next epoch: x <- Φ x + w, and the true biases."""
    work, noise = np.empty(NUM_NAVIGATION), np.zeros(state.shape[1])
    for run in runs:
        index[run] += 1
        k = index[run]
        draw_process_noise(noise_columns[k], normals[run, k], noise)
        if bias_steps.shape[1] > 0:
            move_bias(bias_steps[run, k], true_bias[run], noise)
        kalman.predict_error(transition_columns[k], noise, state[run], work)


@njit(cache=True, nogil=True, error_model="numpy")
def _innovate(
    places: Runs,
    runs: Runs,
    index: Runs,
    state: Floats,
    observation: Floats,
    factor: Floats,
    deviation: Floats,
    formed: InnovationArrays,
) -> None:
    """Innovation with shared S; outputs stand at the places of the runs."""
    residual, whitened, nis = formed.residual, formed.whitened, formed.nis
    for place in places:
        run = runs[place]
        k = index[run]
        observe(observation[k], state[run], deviation[run], residual[place])
        nis[place] = kalman.whiten(factor[k], residual[place], whitened[place])


@njit(cache=True, nogil=True, error_model="numpy")
def _correct(runs: Runs, index: Runs, gain: Floats, whitened: Floats, state: Floats) -> None:
    """x <- x - U w."""
    for run in runs:
        kalman.correct_error(gain[index[run]], whitened[run], state[run])
