"""The strapdown fidelity: N loosely coupled INS/GNSS filters at the IMU rate, closed loop.

Between two fixes each run mechanizes its own noisy samples; the error dynamics are formed from the mean specific force
and the state in the middle of the epoch, and carry the covariance over the epoch (Φ to third order; process noise half
before, half after Φ). A long epoch, as an outage of a recorded log, is cut into parts of about a second, for each of
which this is done. The estimated error is fed back into the mechanization after every used fix.

The history is a ring of the states after each resolved epoch. A backtrack of n epochs restores the state after the fix
before them and mechanizes the stored inertial samples (their stored noise on the true motion) to the present epoch.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.geodesy import displace, position_difference
from spoofgym.navigation.divergence import NUM_HELD, blank, hold
from spoofgym.navigation.error_model import NUM_STATES
from spoofgym.navigation.interface import Decision, Demands, Innovation
from spoofgym.navigation.loose import kernels as closed_loop
from spoofgym.navigation.loose.shared_gains import NO_DEMANDS
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.navigation.loose.warm_start import CONSTANT_BIAS, ERROR, INSTABILITY
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams

GRAIN = 64
EPOCHS_DRAWN = 8
"""Epochs whose sensor noise a run draws at once: few long draws, since each hands the interpreter lock over."""


class StrapdownNavigator:
    """N closed-loop error-state filters on one game.

    Attributes:
        model: the game.
        attitude: C, body to ENU, (N, 3, 3).
        velocity: ENU, (N, 3), m/s.
        position: latitude rad, longitude rad, height m, (N, 3).
        bias: estimated gyro and accelerometer biases, (N, 6), rad/s and m/s².
        true_bias: what they really are, (N, 6).
        covariance: P, (N, 15, 15).
        index: the epoch where each run stands, (N,); -1 before the first.
        diverged: whether the filter has diverged since the episode began, (N,); its solution is then held.
        history: epochs that can be taken back.
        backtracked: epochs that the last `resolve` took back, (N,).
        auxiliary: error state of the unaided inertial solution minus that of the filter, (N, 15), to first order; (N,
            0) if not demanded.
    """

    def __init__(
        self, model: StrapdownModel, num_runs: int, slices: RunSlices, demands: Demands = NO_DEMANDS
    ) -> None:
        """Allocate ``num_runs`` runs; `reset` starts them."""
        m, slots = model.dimension, demands.history + 1 if demands.history else 0
        self.model = model
        self.history = demands.history
        self.attitude = np.zeros((num_runs, 3, 3))
        self.velocity = np.zeros((num_runs, 3))
        self.position = np.zeros((num_runs, 3))
        self.bias = np.zeros((num_runs, 6))
        self.true_bias = np.zeros((num_runs, 6))
        self.covariance = np.zeros((num_runs, NUM_STATES, NUM_STATES))
        self.index = np.full(num_runs, -1)
        self.diverged = np.zeros(num_runs, dtype=bool)
        self.backtracked = np.zeros(num_runs, dtype=np.int64)
        self.auxiliary = np.zeros((num_runs, NUM_STATES if demands.auxiliary else 0))
        self._held = np.zeros((num_runs, NUM_HELD))
        self._prior_covariance = model.prior_covariance
        self._instability = np.zeros((num_runs, 6))
        self._fix = np.zeros((num_runs, 6, 3))
        self._gain = np.zeros((num_runs, m, NUM_STATES))
        self._whitened = np.zeros((num_runs, m))
        self._residual = np.zeros((num_runs, m))
        self._deviation = np.zeros((num_runs, m))
        self._generators: dict[int, np.random.Generator] = {}
        self._noisy = bool(np.any(model.true_noise) or np.any(model.instability_sigma))
        width = closed_loop.NUM_SAMPLE_NOISES * model.max_samples + closed_loop.NUM_EPOCH_NOISES
        blocks = 1 if not slots else -(-slots // EPOCHS_DRAWN) + 2
        self._normals = np.zeros((num_runs, blocks * EPOCHS_DRAWN, width if self._noisy else 0))
        self._slices = slices
        self._all = np.arange(num_runs)
        self._ones = np.ones(num_runs)
        self._measurement_covariance = model.measurement_covariance
        self._noise_row = self.index
        self._process_scale = np.ones(num_runs)
        # what a resolved epoch leaves, in the order of the rings
        self._resolved: tuple[Floats, ...] = (
            self.attitude,
            self.velocity,
            self.position,
            self.bias,
            self.true_bias,
            self._instability,
            self.covariance,
        )
        self._past: tuple[Floats, ...] = tuple(np.zeros((num_runs, slots, *part.shape[1:])) for part in self._resolved)

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0.

        Args:
            runs: which, (n,).
            initial: joint state y drawn for them, (n, 30).
            streams: the random streams of all runs.
        """
        model, error = self.model, initial[:, ERROR]
        self.index[runs] = -1
        self.backtracked[runs] = 0
        self.auxiliary[runs] = 0.0
        self.covariance[runs] = model.prior_covariance
        self.position[runs] = displace(np.broadcast_to(model.position, (len(runs), 3)), error[:, 6:9])
        self.velocity[runs] = model.velocity + error[:, 3:6]
        for run, x in zip(runs, error, strict=True):
            self.attitude[run] = model.attitude
            closed_loop.rotate(self.attitude[run], -x[0], -x[1], -x[2])
            if self._noisy:
                self._generators[int(run)] = streams.spawn(run, "imu")
        self._instability[runs] = initial[:, INSTABILITY]
        self.true_bias[runs] = initial[:, CONSTANT_BIAS] + initial[:, INSTABILITY]
        self.bias[runs] = self.true_bias[runs] - error[:, 9:15]
        self.diverged[runs] = False
        self._hold(runs)

    def _hold(self, runs: Runs) -> None:
        """Keep what is valid; hold what has diverged."""
        hold(
            runs,
            self.attitude,
            self.velocity,
            self.position,
            self.bias,
            self.covariance,
            self.auxiliary,
            self._prior_covariance,
            self._held,
            self.diverged,
        )

    def restart_auxiliary(self, runs: Runs) -> None:
        """Let the unaided inertial solution of runs, where there is one, begin anew from the filter's."""
        self.auxiliary[runs] = 0.0

    def propagate(self, runs: Runs | None = None) -> None:
        """Carry runs (all by default) to their next epoch by inertial measurements."""
        runs = self._all if runs is None else runs
        self._keep(runs)
        self._slices.call(self._propagate_slice, runs, 1)
        self._hold(runs)

    def _keep(self, runs: Runs) -> None:
        """Write the resolved states into the history."""
        if self.history:
            slot = (self.index[runs] + 1) % (self.history + 1)
            for ring, part in zip(self._past, self._resolved, strict=True):
                ring[runs, slot] = part[runs]

    def _propagate_slice(self, runs: Runs) -> None:
        if self._noisy:
            for run in runs[(self.index[runs] + 1) % EPOCHS_DRAWN == 0].tolist():
                begin = (self.index[run] + 1) % self._normals.shape[1]
                self._generators[run].standard_normal(out=self._normals[run, begin : begin + EPOCHS_DRAWN])
        self._mechanize(runs, self.auxiliary)

    def _mechanize(self, runs: Runs, auxiliary: Floats) -> None:
        model = self.model
        closed_loop.propagate(
            runs,
            self.index,
            self.attitude,
            self.velocity,
            self.position,
            self.bias,
            self.true_bias,
            self._instability,
            self.covariance,
            self._fix,
            self._normals,
            model.angular_rate,
            model.specific_force,
            model.step,
            *model.parts,
            model.latency_samples,
            model.filter_density,
            self._process_scale,
            model.true_noise,
            model.instability_sigma,
            model.instability_decay,
            auxiliary,
        )

    def innovate(self, deviation: Floats, runs: Runs | None = None) -> Innovation:
        """Form the innovation of runs (all by default).

        Args:
            deviation: receiver noise plus offset, (n, m).
            runs: which, (n,).
        """
        runs = self._all if runs is None else runs
        self._deviation[runs] = deviation
        return self._innovate(runs, self._ones[: len(runs)])

    def _innovate(self, runs: Runs, noise_scale: Floats) -> Innovation:
        """The innovation of the present fix with R times ``noise_scale`` (n,)."""
        m, model = self.model.dimension, self.model
        residual, whitened, nis = np.empty((len(runs), m)), np.empty((len(runs), m)), np.empty(len(runs))
        innovation = np.empty((len(runs), m, m))
        self._slices.call(
            lambda part: closed_loop.innovate(
                part,
                runs,
                self.index,
                self._fix,
                self.covariance,
                model.fix_position,
                model.fix_velocity,
                model.lever_arm,
                float(model.latency_samples * model.step[0]),
                self._measurement_covariance,
                self._noise_row,
                noise_scale,
                self._deviation,
                innovation,
                self._gain,
                residual,
                whitened,
                nis,
            ),
            self._all[: len(runs)],
            GRAIN,
        )
        lost = self._lost(runs, nis)
        if len(lost):
            blank(lost, residual, innovation, whitened, nis)
        self._whitened[runs], self._residual[runs] = whitened, residual
        return Innovation(residual, innovation, whitened, nis)

    def _lost(self, runs: Runs, nis: Floats) -> Runs:
        """Places of innovations that are not finite, (k,): S is no longer positive, and their runs have diverged."""
        lost = np.flatnonzero(~np.isfinite(nis))
        if len(lost):
            self.diverged[runs[lost]] = True
            self._gain[runs[lost]] = 0.0
        return lost

    def resolve(self, decision: Decision, runs: Runs | None = None) -> None:
        """Take fixes back, then apply the present one, or reset to it, where the decision says so; else coast.

        Raises:
            ValueError: a backtrack without a history.
        """
        runs = self._all if runs is None else runs
        before = self._solution(runs) if self.auxiliary.shape[1] else None
        again, used = self._take_back(decision, runs), decision.use
        if decision.noise_scale is not None:
            again = again | (decision.noise_scale != 1.0)
        fresh = np.flatnonzero(again & used)
        if len(fresh):
            scale = self._ones[: len(fresh)] if decision.noise_scale is None else decision.noise_scale[fresh]
            self._innovate(runs[fresh], scale)
        if decision.reset is not None:
            jumps = used & (decision.reset > 0.0)
            self._reset_to_fix(runs[jumps], decision.reset[jumps])
            used = used & ~jumps
        self._correct(runs[used])
        self._hold(runs)
        if before is not None:
            self._move_auxiliary(runs, before)

    def _move_auxiliary(self, runs: Runs, before: tuple[Floats, Floats, Floats, Floats]) -> None:
        """Let the unaided solution stay where it is while the filter's has moved."""
        self.auxiliary[runs] += _difference(before, self._solution(runs))

    def _correct(self, runs: Runs) -> None:
        """Apply the present fix."""
        self._slices.call(
            lambda part: closed_loop.resolve(
                part,
                self.attitude,
                self.velocity,
                self.position,
                self.bias,
                self.covariance,
                self._gain,
                self._whitened,
            ),
            runs,
            GRAIN,
        )

    def _take_back(self, decision: Decision, runs: Runs) -> Flags:
        """Backtrack where it is decided; whether the innovation must be formed anew, (n,)."""
        self.backtracked[runs] = 0
        if decision.backtrack is None or not decision.backtrack.any():
            return np.zeros(len(runs), dtype=bool)
        if not self.history:
            raise ValueError("a backtrack is decided, but the navigator keeps no history: demand one when it is built")
        depth = np.minimum(np.minimum(decision.backtrack, self.history), self.index[runs])
        self.backtracked[runs] = depth
        self._slices.call(self._backtrack_slice, runs[depth > 0], 1)
        return depth > 0

    def _backtrack_slice(self, runs: Runs) -> None:
        """Restore the state after epoch k - n - 1 and carry it to epoch k; runs join in when their depth is reached."""
        depth = self.backtracked[runs]
        deepest = int(depth.max(initial=0))
        for left in range(deepest, -1, -1):
            joining = runs[depth == left]
            if left and len(joining):
                slot = (self.index[joining] - left) % (self.history + 1)
                for ring, part in zip(self._past, self._resolved, strict=True):
                    part[joining] = ring[joining, slot]
                self.index[joining] -= left + 1
            active = runs[depth >= left]
            if left < deepest:
                self._keep(active[depth[depth >= left] > left])
            self._mechanize(active, self.auxiliary[:, :0])

    def _reset_to_fix(self, runs: Runs, variance: Floats) -> None:
        """Position and, where the receiver gives it, velocity jump to the fix; their correlations are forgotten."""
        if len(runs):
            closed_loop.reset(
                runs,
                variance,
                self._noise_row,
                self.velocity,
                self.position,
                self.covariance,
                self._measurement_covariance,
                self._residual[runs],
            )

    def _solution(self, runs: Runs) -> tuple[Floats, Floats, Floats, Floats]:
        return self.attitude[runs], self.velocity[runs], self.position[runs], self.bias[runs]

    @property
    def error(self) -> Floats:
        """Estimate minus truth, (N, 3), m ENU."""
        return position_difference(self.position, self.model.true_position[self.index])

    @property
    def velocity_error(self) -> Floats:
        """Estimate minus truth, (N, 3), m/s ENU."""
        return self.velocity - self.model.true_velocity[self.index]

    @property
    def auxiliary_offset(self) -> Floats:
        """Position of the unaided inertial solution minus that of the filter, (N, 3), m ENU.

        Raises:
            RuntimeError: nobody demanded an unaided solution.
        """
        if not self.auxiliary.shape[1]:
            raise RuntimeError("this navigator has no unaided inertial solution: demand it when it is built")
        return self.auxiliary[:, 6:9].copy()

    @property
    def position_covariance(self) -> Floats:
        """The filter's covariance of the position, (N, 3, 3), m²."""
        return self.covariance[:, 6:9, 6:9].copy()

    @property
    def estimated_bias(self) -> Floats:
        """Gyro and accelerometer biases that the filter has estimated, (N, 6), rad/s and m/s²."""
        return self.bias.copy()

    def recomputed_error(self, epochs: int) -> Floats:
        """Errors after each of the last epochs as backtracking has rewritten them, (N, epochs, 3), m ENU, oldest first.

        As `OwnCovarianceNavigator.recomputed_error`.

        Raises:
            ValueError: more epochs than the history holds.
        """
        if not 0 <= epochs <= self.history:
            raise ValueError(f"epochs must be from 0 to the history of {self.history}, got {epochs}")
        order = self.index[:, None] - epochs + np.arange(epochs)
        position = self._past[2][self._all[:, None], (order + 1) % (self.history + 1)]
        truth = self.model.true_position[np.maximum(order, 0)]
        error = position_difference(position.reshape(-1, 3), truth.reshape(-1, 3)).reshape(*order.shape, 3)
        return np.where(order[:, :, None] >= 0, error, 0.0)


def _difference(one: tuple[Floats, ...], other: tuple[Floats, ...]) -> Floats:
    """Error state of one solution minus that of another, (n, 15), to first order.

    With C₁ = (I - [φ₁ x]) C and likewise C₂, C₁ C₂' = I - [(φ₁ - φ₂) x]; a bias error is true minus estimated.
    """
    turn = np.einsum("nij,nkj->nik", one[0], other[0])
    attitude = 0.5 * np.stack(
        [turn[:, 1, 2] - turn[:, 2, 1], turn[:, 2, 0] - turn[:, 0, 2], turn[:, 0, 1] - turn[:, 1, 0]], axis=1
    )
    return np.concatenate(
        [attitude, one[1] - other[1], position_difference(one[2], other[2]), other[3] - one[3]], axis=1
    )
