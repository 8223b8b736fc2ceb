"""The loosely coupled filter in expectation (Liu 2018, eqs 32-34).

The mean error and the mean innovation follow from the offsets alone,

    e⁻ = Φ e,      r = H e⁻ - s,      u = L⁻¹ r,      e = e⁻ - U u.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.error_model import NUM_NAVIGATION
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.mean import MeanFilter, Means
from spoofgym.parallel import RunSlices


class MeanModel(NamedTuple):
    """The arrays of a `LinearModel` that the mean recursion reads."""

    transition_columns: Floats
    observation: Floats
    innovation_factor: Floats
    whitened_gain: Floats


def mean_model(model: LinearModel) -> MeanModel:
    """The part of a model that the mean recursion reads."""
    return MeanModel(model.transition_columns, model.observation, model.innovation_factor, model.whitened_gain)


class LooseMeanFilter(MeanFilter):
    """N loosely coupled filters in expectation, every fix used."""

    grain = 4096

    def __init__(self, model: LinearModel, num_runs: int, slices: RunSlices) -> None:
        """Allocate ``num_runs`` filters, which start without any offset.

        Args:
            model: the filter along the game.
            num_runs: N.
            slices: the threads to use.
        """
        super().__init__(num_runs, model.num_states, model.dimension, slices)
        self.model = model
        self._arrays = mean_model(model)

    def _advance(
        self, runs: Runs, index: Runs, offset: Floats, previous: Floats, interval: Floats, means: Means
    ) -> None:
        _advance(runs, index, offset, previous, interval, self._arrays, means)

    def offset_for(self, index: Runs, whitened: Floats) -> Floats:
        """The offset that causes a wanted mean innovation of the position: s = H e⁻ - L u, (N, 3), m ENU.

        Args:
            index: the coming epoch of each run, (N,).
            whitened: u, (N, 3).
        """
        offset = np.empty((len(index), 3))
        _offset_for(index, whitened, self._arrays, self.prior, offset)
        return offset


def expected_sequence(model: LinearModel, offsets: Floats) -> tuple[Floats, Floats]:
    """The mean innovations of a whole game, and the mean error at its end.

    Args:
        model: the filter along epochs 0..K.
        offsets: of epochs 1..K, (K, 3), m ENU; the offset of epoch 0 is zero.

    Returns:
        u of epochs 1..K, (K, m), and e after epoch K, (n,).
    """
    whitened, error = np.empty((len(offsets), model.dimension)), np.zeros(model.num_states)
    _sequence(offsets, np.diff(model.time), mean_model(model), whitened, error)
    return whitened, error


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _predict(columns: Floats, noise: Floats, error: Floats, work: Floats) -> None:
    """x <- Φ x, for the first nine rows of Φ, stored by columns, or for all of them; noise zero, work (n,)."""
    if columns.shape[1] == NUM_NAVIGATION:
        kalman.predict_error(columns, noise, error, work)
    else:
        _predict_all(columns, error, work)


@njit(cache=True, nogil=True, error_model="numpy")
def _predict_all(columns: Floats, error: Floats, work: Floats) -> None:
    """x <- Φ x, for a Φ stored by columns, (n, n); x and work (n,)."""
    n = error.shape[0]
    for i in range(n):
        work[i] = 0.0
    for j in range(n):
        factor = error[j]
        for i in range(n):
            work[i] += columns[j, i] * factor
    for i in range(n):
        error[i] = work[i]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _observe(
    observation: Floats, error: Floats, offset: Floats, previous: Floats, interval: float, residual: Floats
) -> None:
    """r = H e⁻ - s; with a receiver that gives velocity, s holds the rate of the offset, too.

    Args:
        observation: H, (m, 9).
        error: e⁻, (n,).
        offset: of this epoch, (3,), m ENU.
        previous: offset of the epoch before, (3,), m ENU.
        interval: between both, s.
        residual: r, (m,), result.
    """
    for a in range(residual.shape[0]):
        total = -offset[a] if a < 3 else -(offset[a - 3] - previous[a - 3]) / interval
        for j in range(NUM_NAVIGATION):
            total += observation[a, j] * error[j]
        residual[a] = total


@njit(cache=True, nogil=True, error_model="numpy")
def _advance(
    runs: Runs, index: Runs, offset: Floats, previous: Floats, interval: Floats, model: MeanModel, means: Means
) -> None:
    """Use the fix of the present epoch, then predict the coming one, of a slice of the runs."""
    columns, observation, factor, gain = model
    prior, error, whitened, coming = means
    n = prior.shape[1]
    residual, noise, work = np.empty(observation.shape[1]), np.zeros(n), np.empty(n)
    last = columns.shape[0] - 1
    for run in runs:
        k = index[run]
        if k > 0:
            _observe(observation[k], prior[run], offset[run], previous[run], interval[run], residual)
            kalman.whiten(factor[k], residual, whitened[run])
            for i in range(n):
                error[run, i] = prior[run, i]
            kalman.correct_error(gain[k], whitened[run], error[run])
        if k < last:
            for i in range(n):
                prior[run, i] = error[run, i]
            _predict(columns[k + 1], noise, prior[run], work)
            _observe(observation[k + 1], prior[run], offset[run], offset[run], interval[run], residual)
            kalman.whiten(factor[k + 1], residual, coming[run])


@njit(cache=True, nogil=True, error_model="numpy")
def _sequence(offsets: Floats, intervals: Floats, model: MeanModel, whitened: Floats, error: Floats) -> None:
    """Go through epochs 1..K.

    Args:
        offsets: (K, 3), m ENU.
        intervals: from the epochs before, (K,), s.
        model: the filter along epochs 0..K.
        whitened: u, (K, m), result.
        error: e, (n,), in place.
    """
    columns, observation, factor, gain = model
    residual, noise, work = np.empty(observation.shape[1]), np.zeros(error.shape[0]), np.empty(error.shape[0])
    previous = np.zeros(3)
    for k in range(1, len(offsets) + 1):
        _predict(columns[k], noise, error, work)
        _observe(observation[k], error, offsets[k - 1], previous, intervals[k - 1], residual)
        kalman.whiten(factor[k], residual, whitened[k - 1])
        kalman.correct_error(gain[k], whitened[k - 1], error)
        previous = offsets[k - 1]


@njit(cache=True, nogil=True, error_model="numpy")
def _offset_for(index: Runs, whitened: Floats, model: MeanModel, prior: Floats, offset: Floats) -> None:
    """s = H e⁻ - L u of the position: whitened (N, 3), prior e⁻ (N, n); offset (N, 3), result."""
    observation, factor = model.observation, model.innovation_factor
    for run in range(len(index)):
        k = index[run]
        for a in range(3):
            total = 0.0
            for j in range(NUM_NAVIGATION):
                total += observation[k, a, j] * prior[run, j]
            for b in range(a + 1):
                total -= factor[k, a, b] * whitened[run, b]
            offset[run, a] = total
