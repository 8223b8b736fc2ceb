"""The tightly coupled filter on recorded ranges with simulated inertial sensors."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.navigation.tight.replay import TightReplayNavigator
from spoofgym.navigation.tight.states import BIAS, INERTIAL, NUM_INERTIAL
from spoofgym.streams import RunStreams


class TightRestingNavigator(TightReplayNavigator):
    """N closed-loop filters on the ranges of a log, each with inertial sensors of its own.

    The samples get the white noise of the model, the biases wander as the filter believes; what acts on the ranges is
    in the log.
    """

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0; arguments as in `TightStrapdownNavigator`."""
        super().reset(runs, initial, streams)
        for run in runs.tolist():
            drawn = streams(run, "imu").standard_normal((self.range_normals.shape[1], BIAS.stop - BIAS.start))
            self.range_normals[run, :, BIAS] = drawn

    def joint(self, runs: Runs, start: StrapdownModel) -> Floats:
        """Where runs stand, beside the start of a model, as `reset` takes it, (k, n + 6)."""
        n = self.state.shape[1]
        joint = np.empty((len(runs), n + 6))
        joint[:, :n], joint[:, n:] = self.state[runs], self.bias[runs]
        beside = (
            np.broadcast_to(start.attitude, (len(runs), 3, 3)),
            np.broadcast_to(start.velocity, (len(runs), 3)),
            np.broadcast_to(start.position, (len(runs), 3)),
            self.bias[runs],
        )
        moved = self._moved(self._solution(runs), beside)
        joint[:, : INERTIAL.stop] = moved[:, :NUM_INERTIAL]
        joint[:, BIAS] = self.true_bias[runs] - self.bias[runs]
        return joint


