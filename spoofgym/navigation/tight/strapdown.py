"""The tightly coupled filter in the strapdown fidelity: mechanization at the IMU rate, ranges to the satellites.

The inertial solution is the nonlinear one of `loose`, and the predicted ranges are distances from its position. What is
linear by itself (clock, atmosphere, multipath, ambiguities) is carried as its error, as in the linear fidelity.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.geodesy import displace, geodetic_to_ecef
from spoofgym.navigation.batch import Weights
from spoofgym.navigation.divergence import blank
from spoofgym.navigation.history import History
from spoofgym.navigation.interface import NO_DEMANDS, Demands
from spoofgym.navigation.loose.inertial import InertialBatch
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.navigation.tight import kernels
from spoofgym.navigation.tight.code_errors import CodeErrors
from spoofgym.navigation.tight.kalman import RangeInnovations
from spoofgym.navigation.tight.model import TightDynamics, TightModel
from spoofgym.navigation.tight.own_covariances import TightOwnCovariances
from spoofgym.navigation.tight.states import BIAS, CLOCK, INERTIAL
from spoofgym.navigation.tight.truth import ErrorRuns
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams

GRAIN = 16
"""Runs below which a slice is not worth a thread."""


class TightStrapdownNavigator(TightOwnCovariances, InertialBatch):
    """N closed-loop tightly coupled filters on one game.

    Attributes:
        tight: Φ, Q, H and R of the states beside the inertial ones.
        state: error of the states beside the inertial ones, (N, n); the first fifteen are zero.
        range_normals: standard normals of their noise in the episode, (N, K+1, n).
    """

    grain = GRAIN

    def __init__(
        self,
        model: StrapdownModel,
        tight: TightModel,
        satellites: Floats,
        num_runs: int,
        slices: RunSlices,
        demands: Demands = NO_DEMANDS,
    ) -> None:
        """Allocate ``num_runs`` runs; `reset` starts them.

        Args:
            model: the inertial part of the game.
            tight: the filter, on the same epochs.
            satellites: their positions, (K+1, S, 3), ECEF at the time of reception, m.
            num_runs: N.
            slices: the threads to use.
            demands: of the players.
        """
        n, m, slots = tight.dynamics.num_states, tight.dimension, tight.dynamics.num_slots
        super().__init__(model, tight.prior_covariance, m, num_runs, slices, demands, slots)
        self.tight = tight
        antenna = geodetic_to_ecef(model.true_position)
        distance = np.sqrt(np.square(satellites - antenna[:, None]).sum(axis=2))
        # of one layout in every scenario: kernels are compiled once
        self._sky = kernels.Sky(*map(np.ascontiguousarray, (satellites, distance, model.true_velocity)))
        self.state = np.zeros((num_runs, n))
        self.range_normals = np.zeros((num_runs, tight.num_epochs + 1, n))
        self._response = np.zeros((num_runs, m, 3))
        errors = ErrorRuns(self.index, self.state, self.true_bias, self.range_normals)
        self._code_errors = CodeErrors(tight, num_runs)
        self._vehicles = kernels.Vehicles(errors, self._inertial, self._fix, self._normals)
        # the true bias goes back, too: the stored noise then carries it forward to the same bits
        self.past = History(
            demands.history,
            self.covariance,
            **self._inertial._asdict(),
            true_bias=self.true_bias,
            state=self.state,
        )

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0; ``initial`` is that of `TightErrorBatch.reset`."""
        super().reset(runs, initial, streams)
        n = self.state.shape[1]
        self.state[runs] = initial[:, :n]
        self._code_errors.begin(runs, initial)
        self.state[runs, INERTIAL] = 0.0
        self.bias[runs] = initial[:, n:]
        self.true_bias[runs] = initial[:, n:] + initial[:, BIAS]
        for run in runs.tolist():
            streams(run, "imu").standard_normal(out=self.range_normals[run])
        self._start(runs, initial[:, INERTIAL], streams)
        self._settle(runs)

    def _settle(self, runs: Runs) -> None:
        super()._settle(runs)
        if self.diverged.any():  # what a diverged filter believes of clock and atmosphere may not be finite
            self.state[self.diverged] = 0.0

    @property
    def _dynamics(self) -> TightDynamics:
        return self.tight.dynamics

    def _carry(self, runs: Runs, epochs: Runs, auxiliary: Floats) -> None:
        self._draw(runs)
        dynamics = self.tight.dynamics
        kernels.carry(
            runs,
            epochs,
            self.model.steps,
            dynamics.filter_steps,
            dynamics.error_steps,
            self._vehicles,
            self.past.ring,
            auxiliary,
        )

    def _fill(self, places: Runs, runs: Runs, weights: Weights, formed: RangeInnovations) -> None:
        kernels.innovate(
            places, runs, self._sky, self.tight.dynamics.ranges, weights, self._vehicles, self._filters, formed
        )

    def _check(self, runs: Runs, formed: RangeInnovations) -> None:
        lost = self._lost(runs, formed.nis)
        if len(lost):
            blank(lost, formed.residual, formed.covariance, formed.whitened, formed.nis)
            formed.response[lost] = 0.0

    def _correct(self, runs: Runs) -> None:
        self._on_slices(lambda part: kernels.correct(part, self._inertial, self.state, self._filters), runs)

    def _reset_to_fix(self, runs: Runs, variance: Floats) -> None:
        """The position jumps to where the ranges ask for it; its correlations are forgotten."""
        self.position[runs] = displace(self.position[runs], -self._forget_position(runs, variance))

    @property
    def clock_error(self) -> Floats:
        """Estimate minus truth of the receiver's clock, (N,), m."""
        return self.state[:, CLOCK].copy()

    @property
    def measured(self) -> Floats:
        """Code and second observable as they were measured, (N, m), m and m/s; see `RangeNavigator.measured`."""
        return self._deviation + self._code_errors.added(self.index, self.range_normals)
