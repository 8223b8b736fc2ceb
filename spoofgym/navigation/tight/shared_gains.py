"""The tightly coupled filter in the linear fidelity: N error states on ranges, every run using every range."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.batch import InnovationArrays, SharedGains, Weights, empty_innovation
from spoofgym.navigation.history import History
from spoofgym.navigation.interface import NO_DEMANDS, Demands, Innovation
from spoofgym.navigation.tight import kalman as tight_filter
from spoofgym.navigation.tight.error_batch import TightErrorBatch, at_epochs
from spoofgym.navigation.tight.model import TightGains, TightModel
from spoofgym.navigation.tight.states import INERTIAL, POSITION
from spoofgym.navigation.tight.truth import ErrorRuns, ErrorSteps, carry_error, error_work
from spoofgym.parallel import RunSlices

GRAIN = 512
"""Runs below which a slice is not worth a thread."""


class TightNavigator(SharedGains, TightErrorBatch):
    """N runs of the true error under a tightly coupled filter with shared, precomputed gains."""

    shared_gains = True
    grain = carry_grain = GRAIN

    def __init__(
        self, model: TightModel, num_runs: int, slices: RunSlices, demands: Demands = NO_DEMANDS
    ) -> None:
        """As for `TightErrorBatch`."""
        super().__init__(model, num_runs, slices, demands)
        self.past = History(0, np.zeros((num_runs, 0, 0)))

    def _carry(self, runs: Runs, epochs: Runs, auxiliary: Floats) -> None:
        _carry(runs, epochs, self.model.dynamics.error_steps, self._runs, auxiliary)

    def _innovate(self, runs: Runs, weights: Weights) -> Innovation:
        model, rows, deviation = self.model, self.index[self._where(runs)], self._deviation
        formed = empty_innovation(len(runs), model.dimension)
        self._on_slices(
            lambda part: _innovate(part, runs, model.gains, self._runs, deviation, formed), self._all[: len(runs)]
        )
        self._whitened[self._where(runs)] = formed.whitened
        return Innovation(
            formed.residual,
            at_epochs(model.innovation_covariance, rows),
            formed.whitened,
            formed.nis,
            at_epochs(model.position_response, rows),
            np.tile(at_epochs(model.dynamics.present, rows), (1, 2)),
        )

    def _correct(self, runs: Runs) -> None:
        self._on_slices(lambda part: _correct(part, self.model.gains, self._runs, self._whitened), runs)

    @property
    def inertial_covariance(self) -> Floats:
        """The filter's covariance of the inertial states before the ranges of the present epoch, (N, 15, 15)."""
        return at_epochs(self.model.covariance, self.index)[:, INERTIAL, INERTIAL]

    @property
    def position_covariance(self) -> Floats:
        """The filter's covariance of the position before the ranges of the present epoch, (N, 3, 3), m²."""
        return np.array(at_epochs(self.model.covariance, self.index)[:, POSITION, POSITION])

    @property
    def position_gain(self) -> Floats:
        """U' of the position for the ranges of the present epoch, (N, m, 3), m."""
        return at_epochs(self.model.whitened_gain, self.index)[:, :, POSITION]


@njit(cache=True, nogil=True, error_model="numpy")
def _carry(runs: Runs, epochs: Runs, steps: ErrorSteps, errors: ErrorRuns, auxiliary: Floats) -> None:
    """Carry runs over so many epochs each."""
    work = error_work(steps)
    for run in runs:
        for _ in range(epochs[run]):
            carry_error(run, steps, errors, auxiliary, work)


@njit(cache=True, nogil=True, error_model="numpy")
def _innovate(
    places: Runs, runs: Runs, gains: TightGains, errors: ErrorRuns, deviation: Floats, formed: InnovationArrays
) -> None:
    """Innovation with shared S; outputs stand at the places of the runs."""
    # named tuples are taken apart here: in the loop that would cost more than the equations
    columns, values, factor = gains.columns, gains.values, gains.innovation_factor
    epoch, state = errors.epoch, errors.state
    residual, whitened, nis = formed.residual, formed.whitened, formed.nis
    for place in places:
        run = runs[place]
        k = epoch[run]
        tight_filter.observe(columns, values[k], state[run], deviation[run], residual[place])
        nis[place] = kalman.whiten(factor[k], residual[place], whitened[place])


@njit(cache=True, nogil=True, error_model="numpy")
def _correct(runs: Runs, gains: TightGains, errors: ErrorRuns, whitened: Floats) -> None:
    """x <- x - U w."""
    epoch, state, gain = errors.epoch, errors.state, gains.whitened_gain
    for run in runs:
        tight_filter.correct_error(gain[epoch[run]], whitened[run], state[run])
