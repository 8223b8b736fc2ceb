"""The linear fidelity: N error states, one step per GNSS epoch, along the precomputed model of the true trajectory."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.batch import InnovationArrays, SharedGains, Weights, empty_innovation
from spoofgym.navigation.error_model import NUM_NAVIGATION, NUM_STATES, POSITION
from spoofgym.navigation.history import History
from spoofgym.navigation.interface import NO_DEMANDS, Demands, Innovation
from spoofgym.navigation.linear_model import LinearGains, LinearModel, LinearSteps
from spoofgym.navigation.loose.dynamics import ErrorBatch, ErrorRuns, carry_error, carry_unaided, observe
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
        _carry(runs, epochs, self.model.steps, self._runs, auxiliary)

    def _innovate(self, runs: Runs, weights: Weights) -> Innovation:
        model, deviation = self.model, self._deviation
        formed = empty_innovation(len(runs), model.dimension)
        self._on_slices(
            lambda part: _innovate(part, runs, model.gains, self._runs, deviation, formed), self._all[: len(runs)]
        )
        self._whitened[runs] = formed.whitened
        return Innovation(formed.residual, model.innovation_covariance[self.index[runs]], formed.whitened, formed.nis)

    def _correct(self, runs: Runs) -> None:
        self._on_slices(lambda part: _correct(part, self.model.gains, self._runs, self._whitened), runs)

    @property
    def position_covariance(self) -> Floats:
        """The filter's covariance of the position before the fix of the present epoch, (N, 3, 3), m²."""
        return self.model.covariance[self.index, POSITION, POSITION]


@njit(cache=True, nogil=True, error_model="numpy")
def _carry(runs: Runs, epochs: Runs, steps: LinearSteps, errors: ErrorRuns, auxiliary: Floats) -> None:
    """Carry runs over so many epochs each."""
    work, noise, nothing = np.empty(NUM_NAVIGATION), np.zeros(errors.state.shape[1]), np.zeros(NUM_STATES)
    for run in runs:
        for _ in range(epochs[run]):
            k = carry_error(run, steps, errors, noise, work)
            carry_unaided(steps.transition_columns[k], auxiliary[run], nothing, work)


@njit(cache=True, nogil=True, error_model="numpy")
def _innovate(
    places: Runs, runs: Runs, gains: LinearGains, errors: ErrorRuns, deviation: Floats, formed: InnovationArrays
) -> None:
    """Innovation with shared S; outputs stand at the places of the runs."""
    for place in places:
        run = runs[place]
        k = errors.epoch[run]
        observe(gains.observation[k], errors.state[run], deviation[run], formed.residual[place])
        formed.nis[place] = kalman.whiten(gains.innovation_factor[k], formed.residual[place], formed.whitened[place])


@njit(cache=True, nogil=True, error_model="numpy")
def _correct(runs: Runs, gains: LinearGains, errors: ErrorRuns, whitened: Floats) -> None:
    """x <- x - U w."""
    for run in runs:
        kalman.correct_error(gains.whitened_gain[errors.epoch[run]], whitened[run], errors.state[run])
