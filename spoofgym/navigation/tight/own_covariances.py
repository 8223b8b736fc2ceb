"""What N tightly coupled filters with covariances of their own have in common in both fidelities."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.batch import FilterBatch, Weights
from spoofgym.navigation.interface import Innovation
from spoofgym.navigation.loose.innovation import FilterRuns
from spoofgym.navigation.position_domain import project_onto_position
from spoofgym.navigation.tight.error_batch import at_epochs
from spoofgym.navigation.tight.kalman import RangeInnovations, empty_innovations
from spoofgym.navigation.tight.model import TightDynamics
from spoofgym.navigation.tight.states import INERTIAL, POSITION


class TightOwnCovariances(FilterBatch):
    """N filters on ranges, each with a covariance of its own, because ranges can be left out.

    Attributes:
        covariance: the filter's P of each run, (N, n, n).
    """

    shared_gains = False
    covariance: Floats
    _filters: FilterRuns
    _response: Floats
    """L⁻¹ H on the position of the last innovation, (N, m, 3)."""

    @property
    @abstractmethod
    def _dynamics(self) -> TightDynamics:
        """Of the game's epochs."""

    @abstractmethod
    def _fill(self, places: Runs, runs: Runs, weights: Weights, formed: RangeInnovations) -> None:
        """Form the innovations of ``runs[places]`` at these places; called on slices by threads."""

    def _check(self, runs: Runs, formed: RangeInnovations) -> None:
        """Called after the innovations of runs have been formed: put right what is not finite."""

    def _innovate(self, runs: Runs, weights: Weights) -> Innovation:
        dynamics = self._dynamics
        formed = empty_innovations(len(runs), dynamics.dimension)
        self._on_slices(lambda part: self._fill(part, runs, weights, formed), self._all[: len(runs)])
        self._check(runs, formed)
        where = self._where(runs)
        self._whitened[where], self._response[where] = formed.whitened, formed.response
        present = np.tile(at_epochs(dynamics.present, self.index[where]) & weights.satellites, (1, 2))
        return Innovation(*formed, present)

    def _forget_position(self, runs: Runs, variance: Floats) -> Floats:
        """Let the position of runs have this variance (k,) and no correlations.

        Returns:
            Estimated position minus that which the present ranges ask for, (k, 3), m ENU.
        """
        residual, axes, nis = np.empty((len(runs), 3)), np.empty((len(runs), 3)), np.empty(len(runs))
        covariance = np.empty((len(runs), 3, 3))
        project_onto_position(self._response[runs], self._whitened[runs], residual, covariance, axes, nis)
        for axis in range(POSITION.start, POSITION.stop):
            self.covariance[runs, axis, :] = 0.0
            self.covariance[runs, :, axis] = 0.0
            self.covariance[runs, axis, axis] = variance
        return residual

    @property
    def inertial_covariance(self) -> Floats:
        """The filter's covariance of the inertial states, (N, 15, 15)."""
        return self.covariance[:, INERTIAL, INERTIAL].copy()

    @property
    def position_covariance(self) -> Floats:
        """The filter's covariance of the position, (N, 3, 3), m²."""
        return self.covariance[:, POSITION, POSITION].copy()

    @property
    def position_gain(self) -> Floats:
        """U' of the position for the ranges of the present epoch, (N, m, 3), m."""
        return self._filters.gain[:, :, POSITION].copy()
