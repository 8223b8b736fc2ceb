"""The spoofer's copy of a tightly coupled filter, run in expectation.

As `spoofgym.envs.shadow`, with ranges in place of fixes: with s what the spoofer adds to code and carrier (or range
rate), the mean error e of all states and the mean innovation follow from the offsets alone (ours, after Liu 2018, eqs
32-34),

    e⁻ = Φ e,      z = H e⁻ - s,      w = L⁻¹ z,      e = e⁻ - U w.

The states of a satellite that rises are unknown, so that their mean error is zero. What is shown of w is its part in
the position domain (Kujur 2024, eqs 17-20).
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.error_model import NUM_NAVIGATION
from spoofgym.navigation.position_domain import project_onto_position
from spoofgym.navigation.tight import kalman as tight_filter
from spoofgym.navigation.tight.model import TightModel
from spoofgym.navigation.tight.states import CLOCK, NUM_COMMON, PER_SATELLITE, VELOCITY
from spoofgym.parallel import RunSlices

GRAIN = 512
"""Lanes below which a slice is not worth a thread."""
RATE_COLUMN = VELOCITY.start
"""First state that a range rate observes; those of code and carrier begin at the position."""


class TightShadowFilter:
    """N shadow filters along one game; it assumes that the victim uses every range.

    Attributes:
        prior: mean error before the coming ranges, (N, n).
        mean: mean error after the last ranges, (N, n).
        whitened: mean whitened innovation of the last epoch in the position domain, (N, 3).
        coming: the same of the coming epoch if the offset is held, (N, 3).
    """

    def __init__(self, model: TightModel, num_runs: int, slices: RunSlices) -> None:
        """Allocate ``num_runs`` filters, which start without any offset."""
        n = model.dynamics.num_states
        self.model = model
        self.prior = np.zeros((num_runs, n))
        self.mean = np.zeros((num_runs, n))
        self.whitened = np.zeros((num_runs, 3))
        self.coming = np.zeros((num_runs, 3))
        self._slices = slices
        self._all = np.arange(num_runs)

    @property
    def clock(self) -> Floats:
        """Mean error of the receiver's clock after the last ranges, (N,), m."""
        return self.mean[:, CLOCK]

    def reset(self, runs: Runs) -> None:
        """Start anew at epoch 0, where no offset has acted yet."""
        for array in (self.prior, self.mean, self.whitened, self.coming):
            array[runs] = 0.0

    def advance(self, index: Runs, offset: Floats, previous: Floats, interval: Floats) -> None:
        """Go through the ranges of the present epoch.

        Args:
            index: the present epoch of each run, (N,).
            offset: of the position, m ENU, then of the clock, m, (N, 4).
            previous: that of the epoch before, (N, 4).
            interval: time since that epoch, (N,), s.
        """
        model, dynamics = self.model, self.model.dynamics
        self._slices.call(
            lambda part: _advance(
                part,
                index,
                offset,
                previous,
                interval,
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
                self.prior,
                self.mean,
                self.whitened,
                self.coming,
            ),
            self._all,
            GRAIN,
        )


@njit(cache=True, nogil=True, error_model="numpy")
def _advance(
    runs: Runs,
    index: Runs,
    offset: Floats,
    previous: Floats,
    interval: Floats,
    transition_columns: Floats,
    decay: Floats,
    intervals: Floats,
    started: Flags,
    present: Flags,
    columns: Runs,
    values: Floats,
    factor: Floats,
    gain: Floats,
    response: Floats,
    prior: Floats,
    mean: Floats,
    whitened: Floats,
    coming: Floats,
) -> None:
    m, n = columns.shape[0], prior.shape[1]
    added, residual, ranges = np.empty(m), np.empty(m), np.empty((1, m))
    nothing, work, rate, still = np.zeros(n), np.empty(NUM_NAVIGATION), np.empty(4), np.zeros(4)
    last = transition_columns.shape[0] - 1
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
                mean[run, i] = prior[run, i]
            tight_filter.correct_error(gain[k], ranges[0], mean[run])
        if k < last:
            for i in range(n):
                prior[run, i] = mean[run, i]
            tight_filter.predict_error(transition_columns[k + 1], decay, intervals[k + 1], nothing, prior[run], work)
            _forget_satellites(started[k + 1], prior[run])
            _spoofed(columns, values[k + 1], present[k + 1], offset[run], still, added)
            tight_filter.observe(columns, values[k + 1], prior[run], added, residual)
            kalman.whiten(factor[k + 1], residual, ranges[0])
            _in_position(response[k + 1 : k + 2], ranges, coming[run : run + 1])


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
def _forget_satellites(started: Flags, error: Floats) -> None:
    """A slot that holds a new satellite has no mean error; started (S,), error (n,) in place."""
    for s in range(started.shape[0]):
        if started[s]:
            for a in range(PER_SATELLITE):
                error[NUM_COMMON + PER_SATELLITE * s + a] = 0.0
