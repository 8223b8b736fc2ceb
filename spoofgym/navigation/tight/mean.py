"""The tightly coupled filter in expectation (ours, after Liu 2018, eqs 32-34).

With s what the spoofer adds to code and carrier (or range rate), the mean error e of all states and the mean innovation
follow from the offsets alone,

    e⁻ = Φ e,      z = H e⁻ - s,      w = L⁻¹ z,      e = e⁻ - U w.

The states of a satellite that rises are unknown, so that their mean error is zero. What is told of w is its part in the
position domain (Kujur 2024, eqs 17-20).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.error_model import NUM_NAVIGATION
from spoofgym.navigation.mean import MeanFilter, Means
from spoofgym.navigation.position_domain import project_onto_position
from spoofgym.navigation.tight import kalman as tight_filter
from spoofgym.navigation.tight.model import TightModel
from spoofgym.navigation.tight.states import CLOCK, NUM_COMMON, PER_SATELLITE, VELOCITY
from spoofgym.parallel import RunSlices

RATE_COLUMN = VELOCITY.start
"""First state that a range rate observes; those of code and carrier begin at the position."""


class MeanModel(NamedTuple):
    """The arrays of a `TightModel` that the mean recursion reads."""

    transition_columns: Floats
    decay: Floats
    intervals: Floats
    started: Flags
    present: Flags
    columns: Runs
    values: Floats
    innovation_factor: Floats
    whitened_gain: Floats
    position_response: Floats


class TightMeanFilter(MeanFilter):
    """N tightly coupled filters in expectation, every range used."""

    grain = 512

    def __init__(self, model: TightModel, num_runs: int, slices: RunSlices) -> None:
        """Allocate ``num_runs`` filters, which start without any offset.

        Args:
            model: the filter along the game.
            num_runs: N.
            slices: the threads to use.
        """
        super().__init__(num_runs, model.dynamics.num_states, 3, slices)
        self.model = model
        dynamics = model.dynamics
        self._arrays = MeanModel(
            dynamics.transition_columns,
            dynamics.decay,
            dynamics.intervals,
            dynamics.started,
            dynamics.present,
            dynamics.columns,
            dynamics.values,
            model.innovation_factor,
            model.whitened_gain,
            model.position_response,
        )

    @property
    def clock_error(self) -> Floats:
        """Mean error of the receiver's clock after the last ranges, (N,), m."""
        return self.error[:, CLOCK]

    def _advance(
        self, runs: Runs, index: Runs, offset: Floats, previous: Floats, interval: Floats, means: Means
    ) -> None:
        _advance(runs, index, offset, previous, interval, self._arrays, means)

    def offset_for(self, index: Runs, whitened: Floats) -> Floats:
        """Refused: there are more ranges than entries of an offset.

        Raises:
            ValueError: always.
        """
        raise ValueError("a tightly coupled filter has no offset for every innovation of its ranges")


@njit(cache=True, nogil=True, error_model="numpy")
def _forget_satellites(started: Flags, error: Floats) -> None:
    """A slot that holds a new satellite has no mean error; started (S,), error (n,) in place."""
    for s in range(started.shape[0]):
        if started[s]:
            for a in range(PER_SATELLITE):
                error[NUM_COMMON + PER_SATELLITE * s + a] = 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _spoofed(columns: Runs, values: Floats, present: Flags, offset: Floats, rate: Floats, added: Floats) -> None:
    """What an offset (4,) of position and clock, and its rate (4,), add to the ranges, (m,): H applied to them."""
    slots = present.shape[0]
    for a in range(added.shape[0]):
        moved = rate if columns[a, 0] == RATE_COLUMN else offset
        total = moved[3]
        for j in range(3):
            total += values[a, j] * moved[j]
        added[a] = total if present[a % slots] else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _in_position(response: Floats, ranges: Floats, axes: Floats) -> None:
    """The whitened innovation (1, m) in the position domain, (1, 3), overwritten."""
    residual, covariance, nis = np.empty((1, 3)), np.empty((1, 3, 3)), np.empty(1)
    project_onto_position(response, ranges, residual, covariance, axes, nis)


@njit(cache=True, nogil=True, error_model="numpy")
def _advance(
    runs: Runs, index: Runs, offset: Floats, previous: Floats, interval: Floats, model: MeanModel, means: Means
) -> None:
    """Use the ranges of the present epoch, then predict the coming ones, of a slice of the runs."""
    transition, decay, intervals, started, present, columns, values, factor, gain, response = model
    prior, error, whitened, coming = means
    m, n = columns.shape[0], prior.shape[1]
    added, residual, ranges = np.empty(m), np.empty(m), np.empty((1, m))
    noise, work, rate, still = np.zeros(n), np.empty(NUM_NAVIGATION), np.empty(4), np.zeros(4)
    last = transition.shape[0] - 1
    for run in runs:
        k = index[run]
        if k > 0:
            for a in range(4):
                rate[a] = (offset[run, a] - previous[run, a]) / interval[run]
            _spoofed(columns, values[k], present[k], offset[run], rate, added)
            tight_filter.observe(columns, values[k], prior[run], added, residual)
            kalman.whiten(factor[k], residual, ranges[0])
            _in_position(response[k : k + 1], ranges, whitened[run : run + 1])
            for i in range(n):
                error[run, i] = prior[run, i]
            tight_filter.correct_error(gain[k], ranges[0], error[run])
        if k < last:
            for i in range(n):
                prior[run, i] = error[run, i]
            tight_filter.predict_error(transition[k + 1], decay, intervals[k + 1], noise, prior[run], work)
            _forget_satellites(started[k + 1], prior[run])
            _spoofed(columns, values[k + 1], present[k + 1], offset[run], still, added)
            tight_filter.observe(columns, values[k + 1], prior[run], added, residual)
            kalman.whiten(factor[k + 1], residual, ranges[0])
            _in_position(response[k + 1 : k + 2], ranges, coming[run : run + 1])


@njit(cache=True, nogil=True, error_model="numpy")
def tell_coming(runs: Runs, index: Runs, offset: Floats, model: MeanModel, means: Means) -> None:
    """Mean innovations of the coming epoch if the offset is held, of a slice of the runs, from their prior."""
    _, _, _, _, present, columns, values, factor, _, response = model
    prior, _, _, coming = means
    m, still = columns.shape[0], np.zeros(4)
    added, residual, ranges = np.empty(m), np.empty(m), np.empty((1, m))
    for run in runs:
        k = index[run] + 1
        if k < values.shape[0]:
            _spoofed(columns, values[k], present[k], offset[run], still, added)
            tight_filter.observe(columns, values[k], prior[run], added, residual)
            kalman.whiten(factor[k], residual, ranges[0])
            _in_position(response[k : k + 1], ranges, coming[run : run + 1])
