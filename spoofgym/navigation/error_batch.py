"""What linear filters of any kind share: N runs of the true error, whose first fifteen states are the inertial ones."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.batch import FilterBatch
from spoofgym.navigation.error_model import BIAS, INERTIAL, POSITION, VELOCITY
from spoofgym.navigation.interface import Demands
from spoofgym.parallel import RunSlices


class LinearErrorBatch(FilterBatch):
    """N runs of the true error under a linear filter.

    Attributes:
        state: the true error of all states, (N, n).
        true_bias: gyro and accelerometer biases, (N, 6), rad/s and m/s².
    """

    def __init__(
        self, num_states: int, num_runs: int, dimension: int, slices: RunSlices, demands: Demands, num_slots: int = 0
    ) -> None:
        """Allocate ``num_runs`` runs of ``num_states`` states; other arguments as `FilterBatch`."""
        super().__init__(num_runs, dimension, slices, demands, num_slots)
        self.state = np.zeros((num_runs, num_states))
        self.true_bias = np.zeros((num_runs, 6))

    def _solution(self, runs: Runs) -> tuple[Floats, ...]:
        return (self.state[runs, INERTIAL],)

    def _moved(self, before: tuple[Floats, ...], after: tuple[Floats, ...]) -> Floats:
        return before[0] - after[0]

    @property
    def error(self) -> Floats:
        """Estimate minus truth, (N, 3), m ENU."""
        return self.state[:, POSITION].copy()

    @property
    def velocity_error(self) -> Floats:
        """Estimate minus truth, (N, 3), m/s ENU."""
        return self.state[:, VELOCITY].copy()

    @property
    def estimated_bias(self) -> Floats:
        """Gyro and accelerometer biases that the filter has estimated, (N, 6), rad/s and m/s²."""
        return self.true_bias - self.state[:, BIAS]
