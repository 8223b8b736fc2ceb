"""The tightly coupled filter in the linear fidelity with a covariance per run, because ranges can be left out."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation.batch import Weights
from spoofgym.navigation.error_model import NUM_NAVIGATION
from spoofgym.navigation.history import History, Ring, keep
from spoofgym.navigation.interface import NO_DEMANDS, Demands
from spoofgym.navigation.loose.innovation import FilterRuns
from spoofgym.navigation.tight import kalman as tight_filter
from spoofgym.navigation.tight.error_batch import TightErrorBatch
from spoofgym.navigation.tight.kalman import FilterSteps, RangeInnovations, Ranges
from spoofgym.navigation.tight.model import TightDynamics, TightModel
from spoofgym.navigation.tight.own_covariances import TightOwnCovariances
from spoofgym.navigation.tight.states import POSITION
from spoofgym.navigation.tight.truth import ErrorRuns, ErrorSteps, carry_error, error_work
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams

GRAIN = 16
"""Runs below which a slice is not worth a thread."""


class TightOwnNavigator(TightOwnCovariances, TightErrorBatch):
    """N runs of the true error, each with a covariance of its own, and with a history to go back in.

    The history takes 14 kB for each epoch and run with eight satellites.
    """

    grain = carry_grain = GRAIN

    def __init__(
        self, model: TightModel, num_runs: int, slices: RunSlices, demands: Demands = NO_DEMANDS
    ) -> None:
        """As for `TightErrorBatch`."""
        super().__init__(model, num_runs, slices, demands)
        m, n = model.dimension, model.dynamics.num_states
        self.covariance = np.zeros((num_runs, n, n))
        self._response = np.zeros((num_runs, m, 3))
        self._filters = FilterRuns(self.covariance, np.zeros((num_runs, m, n)), self._deviation, self._whitened)
        self.past = History(demands.history, self.covariance, state=self.state, true_bias=self.true_bias)

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0, with the filter's warm covariance."""
        super().reset(runs, initial, streams)
        self.covariance[runs] = self.model.prior_covariance

    @property
    def _dynamics(self) -> TightDynamics:
        return self.model.dynamics

    def _carry(self, runs: Runs, epochs: Runs, auxiliary: Floats) -> None:
        dynamics = self.model.dynamics
        _carry(runs, epochs, dynamics.filter_steps, dynamics.error_steps, self._runs, self.past.ring, auxiliary)

    def _fill(self, places: Runs, runs: Runs, weights: Weights, formed: RangeInnovations) -> None:
        _innovate(places, runs, self.model.dynamics.ranges, weights, self._runs, self._filters, formed)

    def _correct(self, runs: Runs) -> None:
        self._on_slices(lambda part: _correct(part, self.state, self._filters), runs)

    def _reset_to_fix(self, runs: Runs, variance: Floats) -> None:
        """The position jumps to where the ranges ask for it; its correlations are forgotten."""
        self.state[runs, POSITION] -= self._forget_position(runs, variance)

    def _past_error(self, epochs: Runs) -> Floats:
        state: Floats = self.past.recall("state", epochs)
        return state[:, :, POSITION]


@njit(cache=True, nogil=True, error_model="numpy")
def _carry(
    runs: Runs,
    epochs: Runs,
    steps: FilterSteps,
    error_steps: ErrorSteps,
    errors: ErrorRuns,
    ring: Ring,
    auxiliary: Floats,
) -> None:
    """Carry runs over so many epochs each: keep the states, x <- Φ x + w, P <- Φ P Φ' + Q."""
    work, product = error_work(error_steps), np.empty((NUM_NAVIGATION, errors.state.shape[1]))
    epoch, covariance, remembers = errors.epoch, ring.covariance, ring.past_covariance.shape[1] > 0
    for run in runs:
        for _ in range(epochs[run]):
            if remembers:
                keep(run, epoch[run] + 1, ring)
            k = carry_error(run, error_steps, errors, auxiliary, work)
            tight_filter.predict_filter(k, steps, covariance[run], product)


@njit(cache=True, nogil=True, error_model="numpy")
def _innovate(
    places: Runs,
    runs: Runs,
    ranges: Ranges,
    weights: Weights,
    errors: ErrorRuns,
    filters: FilterRuns,
    formed: RangeInnovations,
) -> None:
    """Innovation with each run's own S, and its whitened gain; outputs but the gain stand at the places of the runs."""
    epoch, state = errors.epoch, errors.state
    columns, values, residuals = ranges.columns, ranges.values, formed.residual
    covariance, gain, deviation, _ = filters
    work = tight_filter.workspace(ranges, state.shape[1])
    for place in places:
        run = runs[place]
        k, residual = epoch[run], residuals[place]
        tight_filter.observe(columns, values[k], state[run], deviation[run], residual)
        tight_filter.form_innovation(place, k, ranges, weights, covariance[run], gain[run], formed, work)


@njit(cache=True, nogil=True, error_model="numpy")
def _correct(runs: Runs, state: Floats, filters: FilterRuns) -> None:
    """x <- x - U w, P <- P - U U'."""
    covariance, gain, _, whitened = filters
    for run in runs:
        tight_filter.correct_error(gain[run], whitened[run], state[run])
        tight_filter.update_covariance(gain[run], covariance[run])
