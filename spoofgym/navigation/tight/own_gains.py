"""The tightly coupled filter in the linear fidelity with a covariance per run, because ranges can be left out."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation.batch import NO_DEMANDS
from spoofgym.navigation.error_model import NUM_NAVIGATION, NUM_STATES
from spoofgym.navigation.interface import Decision, Demands, Innovation
from spoofgym.navigation.packed import pack, packed_size, unpack
from spoofgym.navigation.position_domain import project_onto_position
from spoofgym.navigation.tight import kalman as tight_filter
from spoofgym.navigation.tight.model import TightModel
from spoofgym.navigation.tight.shared_gains import TightNavigator, at_epochs, predict_auxiliary, predict_run
from spoofgym.navigation.tight.states import INERTIAL, POSITION
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams

GRAIN = 16
"""Runs below which a slice is not worth a thread."""


class TightOwnNavigator(TightNavigator):
    """N runs of the true error, each with a covariance of its own, and with a history to go back in.

    The history is a ring of the states after each resolved epoch, 14 kB each with eight satellites. A backtrack
    restores the state after the ranges before those taken back and carries it to the present epoch by the stored
    transitions and noise.

    Attributes:
        covariance: the filter's P of each run, (N, n, n).
        history: epochs that can be taken back.
    """

    shared_gains = False

    def __init__(
        self, model: TightModel, num_runs: int, slices: RunSlices, demands: Demands = NO_DEMANDS
    ) -> None:
        """As for `TightNavigator`."""
        super().__init__(model, num_runs, slices, demands)
        m, n = model.dimension, model.dynamics.num_states
        slots = demands.history + 1 if demands.history else 0
        self.covariance = np.zeros((num_runs, n, n))
        self.history = demands.history
        self._gain = np.zeros((num_runs, m, n))
        self._response = np.zeros((num_runs, m, 3))
        self._deviation = np.zeros((num_runs, m))
        self._past_state = np.zeros((num_runs, slots, n))
        self._past_covariance = np.zeros((num_runs, slots, packed_size(n)))
        self._ones = np.ones(num_runs)
        self._every_satellite = np.ones((num_runs, model.dynamics.num_slots), dtype=bool)

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0, with the filter's warm covariance."""
        super().reset(runs, initial, streams)
        self.covariance[runs] = self.model.prior_covariance

    def propagate(self, runs: Runs | None = None) -> None:
        """Carry runs (all by default) to their next epoch."""
        self._slices.call(self._propagate_slice, self._all if runs is None else runs, GRAIN)

    def _propagate_slice(self, runs: Runs) -> None:
        nothing = np.zeros(len(self.index), dtype=np.int64)
        self._carry(runs, nothing, self.auxiliary, self.true_bias)

    def _carry(self, runs: Runs, depth: Runs, auxiliary: Floats, true_bias: Floats) -> None:
        """Predict: from the present state to the next epoch, or, with a depth, over the epochs taken back."""
        dynamics = self.model.dynamics
        _carry(
            runs,
            depth,
            self.index,
            self.state,
            true_bias,
            self.covariance,
            auxiliary,
            dynamics.transition_columns,
            dynamics.transition,
            dynamics.process_noise,
            dynamics.noise_columns,
            dynamics.decay,
            dynamics.variance,
            dynamics.noise_sigma,
            dynamics.clock_noise,
            dynamics.clock_factor,
            dynamics.interval,
            dynamics.started,
            dynamics.satellite_sigma,
            self.normals,
            self._past_state,
            self._past_covariance,
        )

    def innovate(self, deviation: Floats, runs: Runs | None = None) -> Innovation:
        """Form the innovation of runs (all by default)."""
        runs = self._all if runs is None else runs
        self._deviation[runs] = deviation
        return self._innovate(runs, self._ones[: len(runs)], self._every_satellite[: len(runs)])

    def _innovate(self, runs: Runs, noise_scale: Floats, satellites: Flags) -> Innovation:
        """The innovation of the present ranges of some satellites (k, S), with R times ``noise_scale`` (k,)."""
        m, dynamics = self.model.dimension, self.model.dynamics
        residual, whitened, nis = np.empty((len(runs), m)), np.empty((len(runs), m)), np.empty(len(runs))
        covariance, response = np.empty((len(runs), m, m)), np.empty((len(runs), m, 3))
        self._slices.call(
            lambda part: _innovate_own(
                part,
                runs,
                self.index,
                self.state,
                self.covariance,
                dynamics.columns,
                dynamics.values,
                dynamics.noise_variance,
                noise_scale,
                satellites,
                self._deviation,
                covariance,
                self._gain,
                response,
                residual,
                whitened,
                nis,
            ),
            self._all[: len(runs)],
            GRAIN,
        )
        self._whitened[runs], self._response[runs] = whitened, response
        present = np.tile(at_epochs(dynamics.present, self.index[runs]) & satellites, (1, 2))
        return Innovation(residual, covariance, whitened, nis, response, present)

    def resolve(self, decision: Decision, runs: Runs | None = None) -> None:
        """Take ranges back, then apply the present ones, or reset to them, where the decision says so; else coast.

        Raises:
            ValueError: a backtrack without a history.
        """
        runs = self._all if runs is None else runs
        with self._keep_auxiliary(runs):
            fresh, used = self._take_back(decision, runs), decision.use
            scale = self._ones[: len(runs)] if decision.noise_scale is None else decision.noise_scale
            satellites = self._every_satellite[: len(runs)] if decision.satellites is None else decision.satellites
            fresh = fresh | (scale != 1.0) | ~satellites.all(axis=1)
            again = np.flatnonzero(fresh & used)
            if len(again):
                self._innovate(runs[again], scale[again], satellites[again])
            if decision.reset is not None:
                jumps = used & (decision.reset > 0.0)
                self._reset_to_ranges(runs[jumps], decision.reset[jumps])
                used = used & ~jumps
            self._slices.call(
                lambda part: _correct_own(part, self.state, self.covariance, self._gain, self._whitened),
                runs[used],
                GRAIN,
            )

    def _take_back(self, decision: Decision, runs: Runs) -> Flags:
        """Backtrack where it is decided; whether the innovation must be formed anew, (k,)."""
        self.backtracked[runs] = 0
        if decision.backtrack is None or not decision.backtrack.any():
            return np.zeros(len(runs), dtype=bool)
        if not self.history:
            raise ValueError("a backtrack is decided, but the navigator keeps no history: demand one when it is built")
        depth = np.minimum(np.minimum(decision.backtrack, self.history), self.index[runs])
        self.backtracked[runs] = depth
        # Only the filter is computed again: the true biases of these epochs are history and must not change.
        truth = self.true_bias.copy()
        self._slices.call(
            lambda part: self._carry(part, self.backtracked, self.auxiliary[:, :0], truth), runs[depth > 0], 1
        )
        return depth > 0

    def _reset_to_ranges(self, runs: Runs, variance: Floats) -> None:
        """The position jumps to where the ranges ask for it; its correlations are forgotten."""
        if not len(runs):
            return
        residual, axes, nis = np.empty((len(runs), 3)), np.empty((len(runs), 3)), np.empty(len(runs))
        covariance = np.empty((len(runs), 3, 3))
        project_onto_position(self._response[runs], self._whitened[runs], residual, covariance, axes, nis)
        self.state[runs, POSITION] -= residual
        for axis in range(POSITION.start, POSITION.stop):
            self.covariance[runs, axis, :] = 0.0
            self.covariance[runs, :, axis] = 0.0
            self.covariance[runs, axis, axis] = variance

    @property
    def inertial_covariance(self) -> Floats:
        """The filter's covariance of the fifteen inertial states, (N, 15, 15)."""
        return self.covariance[:, INERTIAL, INERTIAL].copy()

    @property
    def position_covariance(self) -> Floats:
        """The filter's covariance of the position, (N, 3, 3), m²."""
        return self.covariance[:, POSITION, POSITION].copy()

    @property
    def position_gain(self) -> Floats:
        """U' of the position for the ranges of the present epoch, (N, m, 3), m."""
        return self._gain[:, :, POSITION].copy()

    def recomputed_error(self, epochs: int) -> Floats:
        """Errors after each of the last epochs as backtracking has rewritten them, (N, epochs, 3), m ENU, oldest first.

        As `OwnCovarianceNavigator.recomputed_error`.

        Raises:
            ValueError: more epochs than the history holds.
        """
        if not 0 <= epochs <= self.history:
            raise ValueError(f"epochs must be from 0 to the history of {self.history}, got {epochs}")
        order = self.index[:, None] - epochs + np.arange(epochs)
        slots = self._past_state.shape[1]
        track = self._past_state[self._all[:, None], (order + 1) % max(slots, 1)][:, :, POSITION]
        return np.where(order[:, :, None] >= 0, track, 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _carry(
    runs: Runs,
    depth: Runs,
    index: Runs,
    state: Floats,
    true_bias: Floats,
    covariance: Floats,
    auxiliary: Floats,
    transition_columns: Floats,
    transition: Floats,
    process_noise: Floats,
    noise_columns: Floats,
    decay: Floats,
    variance: Floats,
    sigma: Floats,
    clock_noise: Floats,
    clock_factor: Floats,
    interval: float,
    started: Flags,
    satellite_sigma: Floats,
    normals: Floats,
    past_state: Floats,
    past_covariance: Floats,
) -> None:
    """Keep the resolved state, index <- index + 1, x <- Φ x + w, P <- Φ P Φ' + Q.

    With a depth of d epochs the state after epoch k - d - 1 is restored first and carried to epoch k.
    """
    n = state.shape[1]
    noise, work, nothing = np.empty(n), np.empty(NUM_NAVIGATION), np.zeros(NUM_STATES)
    product = np.empty((NUM_NAVIGATION, n))
    slots = past_state.shape[1]
    for run in runs:
        last = index[run] if depth[run] else index[run] + 1
        first = last - depth[run]
        if depth[run]:
            state[run] = past_state[run, first % slots]
            unpack(past_covariance[run, first % slots], covariance[run])
        for k in range(first, last + 1):
            if slots > 0 and (k > first or depth[run] == 0):
                past_state[run, k % slots] = state[run]
                pack(covariance[run], past_covariance[run, k % slots])
            predict_run(
                k,
                state[run],
                true_bias[run],
                transition_columns,
                noise_columns,
                decay,
                sigma,
                clock_factor,
                interval,
                started,
                satellite_sigma,
                normals[run, k],
                noise,
                work,
            )
            tight_filter.predict_covariance(
                transition[k], process_noise[k], decay, variance, clock_noise, interval, covariance[run], product
            )
            tight_filter.start_satellites(started[k], satellite_sigma, covariance[run])
        index[run] = last
        if auxiliary.shape[1] > 0:
            predict_auxiliary(transition_columns[last], decay, nothing, auxiliary[run], work)


@njit(cache=True, nogil=True, error_model="numpy")
def _innovate_own(
    places: Runs,
    runs: Runs,
    index: Runs,
    state: Floats,
    covariance: Floats,
    columns: Runs,
    values: Floats,
    noise_variance: Floats,
    noise_scale: Floats,
    satellites: Flags,
    deviation: Floats,
    innovation: Floats,
    gain: Floats,
    response: Floats,
    residual: Floats,
    whitened: Floats,
    nis: Floats,
) -> None:
    """Innovation with each run's own S, and its whitened gain; outputs but the gain stand at the places of the runs."""
    m = columns.shape[0]
    cross, factor = np.empty((m, state.shape[1])), np.empty((m, m))
    taken, variance = np.empty((m, columns.shape[1])), np.empty(m)
    for place in places:
        run = runs[place]
        k = index[run]
        tight_filter.observe(columns, values[k], state[run], deviation[run], residual[place])
        tight_filter.leave_out(
            satellites[place], values[k], noise_variance[k], noise_scale[place], residual[place], taken, variance
        )
        nis[place] = tight_filter.form_innovation(
            residual[place],
            covariance[run],
            columns,
            taken,
            variance,
            innovation[place],
            gain[run],
            response[place],
            whitened[place],
            cross,
            factor,
        )


@njit(cache=True, nogil=True, error_model="numpy")
def _correct_own(runs: Runs, state: Floats, covariance: Floats, gain: Floats, whitened: Floats) -> None:
    """x <- x - U w, P <- P - U U'."""
    for run in runs:
        tight_filter.correct_error(gain[run], whitened[run], state[run])
        tight_filter.update_covariance(gain[run], covariance[run])
