"""What every filter run in expectation has in common.

Neither the transitions nor the gains of a filter depend on what a spoofer does, so its mean error and its mean
innovation follow from the offsets alone (Liu 2018, eqs 32-34). With s what the offsets add to the measurements,

    e⁻ = Φ e,      r = H e⁻ - s,      u = L⁻¹ r,      e = e⁻ - U u.

`loose/mean.py` and `tight/mean.py` write these equations down, one function each.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.error_model import POSITION, VELOCITY
from spoofgym.parallel import RunSlices


class Means(NamedTuple):
    """The state of N mean filters.

    Attributes:
        prior: mean error before the coming measurement, (N, n).
        error: mean error after the last measurement, (N, n).
        whitened: mean whitened innovation of the last epoch, (N, m).
        coming: mean whitened innovation of the coming epoch if the offset is held, (N, m).
    """

    prior: Floats
    error: Floats
    whitened: Floats
    coming: Floats


class MeanFilter(ABC):
    """N filters of one kind run in expectation along one game, every measurement used.

    Attributes:
        prior: mean error before the coming measurement, (N, n).
        error: mean error after the last measurement, (N, n).
        whitened: mean whitened innovation of the last epoch, (N, m); in the position domain, (N, 3), for ranges.
        coming: mean whitened innovation of the coming epoch if the offset is held, shaped like `whitened`.
    """

    grain: int
    """Runs below which a slice is not worth a thread."""

    def __init__(self, num_runs: int, num_states: int, dimension: int, slices: RunSlices) -> None:
        """Allocate filters that start without any offset.

        Args:
            num_runs: N.
            num_states: n, of the error state.
            dimension: m, of the innovation that is told.
            slices: the threads to use.
        """
        self.prior = np.zeros((num_runs, num_states))
        self.error = np.zeros((num_runs, num_states))
        self.whitened = np.zeros((num_runs, dimension))
        self.coming = np.zeros((num_runs, dimension))
        self._means = Means(self.prior, self.error, self.whitened, self.coming)
        self._slices = slices
        self._all = np.arange(num_runs)

    @property
    def velocity_error(self) -> Floats:
        """Mean error of the velocity after the last measurement, (N, 3), m/s ENU."""
        return self.error[:, VELOCITY]

    @property
    def position_error(self) -> Floats:
        """Mean error of the position after the last measurement, (N, 3), m ENU."""
        return self.error[:, POSITION]

    @property
    def clock_error(self) -> Floats:
        """Mean error of the receiver's clock after the last measurement, (N,), m; zero in a filter of fixes."""
        return np.zeros(len(self.error))

    def reset(self, runs: Runs) -> None:
        """Start anew at epoch 0, where no offset has acted yet."""
        for array in (self.prior, self.error, self.whitened, self.coming):
            array[runs] = 0.0

    def advance(self, index: Runs, offset: Floats, previous: Floats, interval: Floats) -> None:
        """Use the measurements of the present epoch, then predict those of the coming one.

        Args:
            index: the present epoch of each run, (N,).
            offset: of this epoch, (N, 3), m ENU; (N, 4), with that of the clock, m, for a filter that takes ranges.
            previous: offset of the epoch before, shaped like ``offset``.
            interval: time since that epoch, (N,), s.
        """
        means, advance = self._means, self._advance
        self._slices.call(lambda part: advance(part, index, offset, previous, interval, means), self._all, self.grain)

    @abstractmethod
    def _advance(
        self, runs: Runs, index: Runs, offset: Floats, previous: Floats, interval: Floats, means: Means
    ) -> None:
        """Advance a slice of the runs; only ``means`` is changed."""

    @abstractmethod
    def offset_for(self, index: Runs, whitened: Floats) -> Floats:
        """The offset that causes a wanted mean innovation at the coming epoch.

        Args:
            index: the coming epoch of each run, (N,).
            whitened: the wanted mean whitened innovation of the position, (N, 3).

        Returns:
            s, (N, 3), m ENU.

        Raises:
            ValueError: the filter has more measurements than an offset can move independently.
        """
