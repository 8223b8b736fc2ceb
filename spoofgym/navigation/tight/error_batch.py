"""N runs of the true error of a tightly coupled filter in the linear fidelity, whatever its gains."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.error_batch import LinearErrorBatch
from spoofgym.navigation.interface import Demands
from spoofgym.navigation.tight.code_errors import CodeErrors
from spoofgym.navigation.tight.model import TightModel
from spoofgym.navigation.tight.states import BIAS, CLOCK
from spoofgym.navigation.tight.truth import ErrorRuns
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams

Kind = TypeVar("Kind", np.float64, np.bool_)


class TightErrorBatch(LinearErrorBatch):
    """N runs of the true error under a linear filter on ranges.

    Attributes:
        model: the game.
        normals: standard normals of the episode, (N, K+1, n): process noise, or the true values of a new satellite's
            states; write into it to inject a noise path.
    """

    def __init__(self, model: TightModel, num_runs: int, slices: RunSlices, demands: Demands) -> None:
        """Allocate ``num_runs`` runs; `reset` starts them.

        Args:
            model: of the game.
            num_runs: N.
            slices: the threads to use.
            demands: of the players.
        """
        n = model.dynamics.num_states
        super().__init__(n, num_runs, model.dimension, slices, demands, model.dynamics.num_slots)
        self.model = model
        self.normals = np.zeros((num_runs, model.num_epochs + 1, n))
        self._runs = ErrorRuns(self.index, self.state, self.true_bias, self.normals)
        self._code_errors = CodeErrors(model, num_runs)

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0.

        Args:
            runs: which, (k,).
            initial: the true error, then the biases that the filter has estimated, (k, n + 6).
            streams: the random streams of all runs.
        """
        super().reset(runs, initial, streams)
        n = self.state.shape[1]
        self.state[runs] = initial[:, :n]
        self._code_errors.begin(runs, initial)
        self.true_bias[runs] = initial[:, n:] + initial[:, BIAS]
        for run in runs.tolist():
            streams(run, "imu").standard_normal(out=self.normals[run])

    @property
    def clock_error(self) -> Floats:
        """Estimate minus truth of the receiver's clock, (N,), m."""
        return self.state[:, CLOCK].copy()

    @property
    def measured(self) -> Floats:
        """Code and second observable as they were measured, (N, m), m and m/s; see `RangeNavigator.measured`."""
        return self._deviation + self._code_errors.added(self.index, self.normals)


def at_epochs(table: NDArray[Kind], rows: Runs) -> NDArray[Kind]:
    """The rows of a table by epoch, (len(rows), ...); a view where all are the same."""
    if len(rows) and (rows == rows[0]).all():
        return np.broadcast_to(table[rows[0]], (len(rows), *table.shape[1:]))
    return table[rows]
