"""The true error of N runs under an aided filter, in the linear fidelity."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.error_model import NUM_INERTIAL, NUM_NAVIGATION
from spoofgym.navigation.interface import Demands
from spoofgym.navigation.loose.aided.batch import AidedBatch
from spoofgym.navigation.loose.aided.kernels import AidedErrors
from spoofgym.navigation.loose.aided.model import AidedModel
from spoofgym.navigation.loose.dynamics import ErrorBatch
from spoofgym.parallel import RunSlices
from spoofgym.sensors.imu import ImuGrade
from spoofgym.streams import RunStreams


class AidedErrorBatch(AidedBatch, ErrorBatch):
    """N runs of the true error under an aided filter.

    Attributes:
        normals: standard normal process noise of the episode, (N, S, 9); write into it to inject a noise path.
        walk_normals: standard normals of the walk of the aids' states, (N, S, a).
        aid_normals: standard normals of the measurements of the aids, (N, B, R).
    """

    model: AidedModel

    def __init__(
        self,
        model: AidedModel,
        grade: ImuGrade,
        interval: float,
        num_runs: int,
        slices: RunSlices,
        demands: Demands,
    ) -> None:
        """Allocate ``num_runs`` runs; arguments as for `ErrorBatch`."""
        super().__init__(model, grade, interval, num_runs, slices, demands)
        count, rows, n = model.measurements.observation.shape
        steps = len(model.aid_steps.transition)
        self.normals = np.zeros((num_runs, steps, NUM_NAVIGATION))
        self.walk_normals = np.zeros((num_runs, steps, n - NUM_INERTIAL))
        self.aid_normals = np.zeros((num_runs, count, rows))
        self._listen(model.aids, n, demands)
        self._errors = AidedErrors(
            self.index,
            self.state,
            self.true_bias,
            self.normals,
            self.bias_steps,
            self.walk_normals,
            self.aid_normals,
        )

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0; the last columns of ``initial`` are of the aids' states."""
        super().reset(runs, initial, streams)
        own = self.state.shape[1] - NUM_INERTIAL
        self.state[runs, NUM_INERTIAL:] = initial[:, initial.shape[1] - own :]
        self._draw_aids(runs, streams)

    def _solution(self, runs: Runs) -> tuple[Floats, ...]:
        return (self.state[runs],)
