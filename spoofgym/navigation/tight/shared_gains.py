"""The tightly coupled filter in the linear fidelity: N error states on ranges, every run using every range."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.batch import NO_DEMANDS
from spoofgym.navigation.error_model import NUM_NAVIGATION, NUM_STATES
from spoofgym.navigation.interface import Decision, Demands, Innovation
from spoofgym.navigation.tight import kalman as tight_filter
from spoofgym.navigation.tight.model import TightModel
from spoofgym.navigation.tight.states import BIAS, CLOCK, INERTIAL, NUM_COMMON, PER_SATELLITE, POSITION, VELOCITY
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams

Kind = TypeVar("Kind", np.float64, np.bool_)

GRAIN = 512
"""Runs below which a slice is not worth a thread."""


class TightNavigator:
    """N runs of the true error under a tightly coupled filter with shared, precomputed gains.

    Attributes:
        model: the game.
        state: the true error of all states, (N, n).
        index: the epoch where each run stands, (N,); -1 before the first.
        diverged: whether the filter has diverged, (N,); a linear one never does.
        normals: standard normals of the episode, (N, K+1, n): process noise, or the true values of a new satellite's
            states; overwrite them to inject a noise path.
        true_bias: gyro and accelerometer biases, (N, 6), rad/s and m/s².
        backtracked: epochs that the last `resolve` took back, (N,).
        auxiliary: the fifteen states of the unaided inertial solution minus those of the filter, (N, 15), or (N, 0) if
            not demanded.
    """

    shared_gains = True

    def __init__(
        self, model: TightModel, num_runs: int, slices: RunSlices, demands: Demands = NO_DEMANDS
    ) -> None:
        """Allocate ``num_runs`` runs; `reset` starts them.

        Args:
            model: of the game.
            num_runs: N.
            slices: the threads to use.
            demands: of the players.
        """
        n = model.dynamics.num_states
        self.model = model
        self.state = np.zeros((num_runs, n))
        self.index = np.full(num_runs, -1)
        self.diverged = np.zeros(num_runs, dtype=bool)  # a linear filter never does
        self.normals = np.zeros((num_runs, model.num_epochs + 1, n))
        self.true_bias = np.zeros((num_runs, 6))
        self.backtracked = np.zeros(num_runs, dtype=np.int64)
        self.auxiliary = np.zeros((num_runs, NUM_STATES if demands.auxiliary else 0))
        self._whitened = np.zeros((num_runs, model.dimension))
        self._slices = slices
        self._all = np.arange(num_runs)

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0.

        Args:
            runs: which, (k,).
            initial: the true error, then the biases that the filter has estimated, (k, n + 6).
            streams: the random streams of all runs.
        """
        n = self.state.shape[1]
        self.index[runs] = -1
        self.state[runs] = initial[:, :n]
        self.true_bias[runs] = initial[:, n:] + initial[:, BIAS]
        self.backtracked[runs] = 0
        self.auxiliary[runs] = 0.0
        for run in runs.tolist():
            streams(run, "imu").standard_normal(out=self.normals[run])

    def restart_auxiliary(self, runs: Runs) -> None:
        """Let the unaided inertial solution of runs, where there is one, begin anew from the filter's."""
        self.auxiliary[runs] = 0.0

    def propagate(self, runs: Runs | None = None) -> None:
        """Carry runs (all by default) to their next epoch."""
        runs = self._all if runs is None else runs
        self._slices.call(self._propagate_slice, runs, GRAIN)

    def _propagate_slice(self, runs: Runs) -> None:
        dynamics = self.model.dynamics
        _propagate(
            runs,
            self.index,
            self.state,
            self.true_bias,
            self.auxiliary,
            dynamics.transition_columns,
            dynamics.noise_columns,
            dynamics.decay,
            dynamics.noise_sigma,
            dynamics.clock_factor,
            dynamics.interval,
            dynamics.started,
            dynamics.satellite_sigma,
            self.normals,
        )

    def innovate(self, deviation: Floats, runs: Runs | None = None) -> Innovation:
        """Form the innovation of runs (all by default).

        Args:
            deviation: what lies between the measured ranges and the true ones, (k, m), m and m/s.
            runs: which, (k,).
        """
        runs = self._all if runs is None else runs
        model, rows = self.model, self.index[runs]
        residual, whitened, nis = np.empty_like(deviation), np.empty_like(deviation), np.empty(len(runs))
        self._slices.call(
            lambda part: _innovate(
                part,
                runs,
                self.index,
                self.state,
                model.dynamics.columns,
                model.dynamics.values,
                model.innovation_factor,
                deviation,
                residual,
                whitened,
                nis,
            ),
            self._all[: len(runs)],
            GRAIN,
        )
        self._whitened[runs] = whitened
        return Innovation(
            residual,
            at_epochs(model.innovation_covariance, rows),
            whitened,
            nis,
            at_epochs(model.position_response, rows),
            np.tile(at_epochs(model.dynamics.present, rows), (1, 2)),
        )

    def resolve(self, decision: Decision, runs: Runs | None = None) -> None:
        """Apply the ranges of runs (all by default).

        Raises:
            ValueError: ranges are left out, which shared gains cannot follow.
        """
        others = (decision.backtrack, decision.reset, decision.noise_scale, decision.satellites)
        if not decision.use.all() or any(part is not None for part in others):
            raise ValueError("a range is left out, but the gains are shared: the navigator needs a covariance per run")
        runs = self._all if runs is None else runs
        with self._keep_auxiliary(runs):
            self._slices.call(
                lambda part: _correct(part, self.index, self.state, self.model.whitened_gain, self._whitened),
                runs,
                GRAIN,
            )

    @contextmanager
    def _keep_auxiliary(self, runs: Runs) -> Iterator[None]:
        """Let the filter's state change without moving the unaided solution."""
        before = self.state[runs, INERTIAL] if self.auxiliary.shape[1] else None
        yield
        if before is not None:
            self.auxiliary[runs] += before - self.state[runs, INERTIAL]

    @property
    def auxiliary_offset(self) -> Floats:
        """Position of the unaided inertial solution minus that of the filter, (N, 3), m ENU.

        Raises:
            RuntimeError: nobody demanded an unaided solution.
        """
        if not self.auxiliary.shape[1]:
            raise RuntimeError("this navigator has no unaided inertial solution: demand it when it is built")
        return self.auxiliary[:, POSITION].copy()

    @property
    def error(self) -> Floats:
        """Estimate minus truth, (N, 3), m ENU."""
        return self.state[:, POSITION].copy()

    @property
    def velocity_error(self) -> Floats:
        """Estimate minus truth, (N, 3), m/s ENU."""
        return self.state[:, VELOCITY].copy()

    @property
    def clock_error(self) -> Floats:
        """Estimate minus truth of the receiver's clock, (N,), m."""
        return self.state[:, CLOCK].copy()

    @property
    def estimated_bias(self) -> Floats:
        """Gyro and accelerometer biases that the filter has estimated, (N, 6), rad/s and m/s²."""
        return self.true_bias - self.state[:, BIAS]

    @property
    def inertial_covariance(self) -> Floats:
        """The filter's covariance of the inertial states before the ranges of the present epoch, (N, 15, 15)."""
        return at_epochs(self.model.covariance, self.index)[:, INERTIAL, INERTIAL]

    @property
    def position_covariance(self) -> Floats:
        """The filter's covariance of the position before the ranges of the present epoch, (N, 3, 3), m²."""
        return np.array(at_epochs(self.model.covariance, self.index)[:, POSITION, POSITION])

    @property
    def position_gain(self) -> Floats:
        """U' of the position for the ranges of the present epoch, (N, m, 3), m."""
        return at_epochs(self.model.whitened_gain, self.index)[:, :, POSITION]


def at_epochs(table: NDArray[Kind], rows: Runs) -> NDArray[Kind]:
    """The rows of a table by epoch, (len(rows), ...); a view where all are the same."""
    if len(rows) and (rows == rows[0]).all():
        return np.broadcast_to(table[rows[0]], (len(rows), *table.shape[1:]))
    return table[rows]


@njit(cache=True, nogil=True, error_model="numpy")
def draw_process_noise(
    noise_columns: Floats, sigma: Floats, clock_factor: Floats, normals: Floats, noise: Floats
) -> None:
    """The noise w that acts on a run's error up to an epoch, (n,), from the epoch's normals (n,)."""
    for i in range(NUM_NAVIGATION):
        noise[i] = 0.0
    for j in range(NUM_NAVIGATION):
        factor = normals[j]
        for i in range(NUM_NAVIGATION):
            noise[i] += noise_columns[j, i] * factor
    for i in range(NUM_NAVIGATION, noise.shape[0]):
        noise[i] = sigma[i] * normals[i]
    for i in range(2):
        noise[CLOCK + i] = clock_factor[i, 0] * normals[CLOCK] + clock_factor[i, 1] * normals[CLOCK + 1]


@njit(cache=True, nogil=True, error_model="numpy")
def start_satellites(started: Flags, sigma: Floats, normals: Floats, state: Floats) -> None:
    """A new satellite's states are not known yet: their error is minus their true value, drawn from the prior."""
    for s in range(started.shape[0]):
        if started[s]:
            for a in range(PER_SATELLITE):
                place = NUM_COMMON + PER_SATELLITE * s + a
                state[place] = sigma[a] * normals[place]


@njit(cache=True, nogil=True, error_model="numpy")
def predict_run(
    k: int,
    state: Floats,
    true_bias: Floats,
    transition_columns: Floats,
    noise_columns: Floats,
    decay: Floats,
    sigma: Floats,
    clock_factor: Floats,
    interval: float,
    started: Flags,
    satellite_sigma: Floats,
    normals: Floats,
    noise: Floats,
    work: Floats,
) -> None:
    """Carry the true error of one run, (n,), and its biases, (6,), to epoch k."""
    draw_process_noise(noise_columns[k], sigma, clock_factor, normals, noise)
    tight_filter.predict_error(transition_columns[k], decay, interval, noise, state, work)
    for a in range(6):
        true_bias[a] = decay[NUM_NAVIGATION + a] * true_bias[a] + noise[NUM_NAVIGATION + a]
    start_satellites(started[k], satellite_sigma, normals, state)


@njit(cache=True, nogil=True, error_model="numpy")
def _propagate(
    runs: Runs,
    index: Runs,
    state: Floats,
    true_bias: Floats,
    auxiliary: Floats,
    transition_columns: Floats,
    noise_columns: Floats,
    decay: Floats,
    sigma: Floats,
    clock_factor: Floats,
    interval: float,
    started: Flags,
    satellite_sigma: Floats,
    normals: Floats,
) -> None:
    noise, work, nothing = np.empty(state.shape[1]), np.empty(NUM_NAVIGATION), np.zeros(NUM_STATES)
    for run in runs:
        index[run] += 1
        k = index[run]
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
        if auxiliary.shape[1] > 0:
            predict_auxiliary(transition_columns[k], decay, nothing, auxiliary[run], work)


@njit(cache=True, nogil=True, error_model="numpy")
def predict_auxiliary(columns: Floats, decay: Floats, nothing: Floats, auxiliary: Floats, work: Floats) -> None:
    """d <- Φ d of the fifteen inertial states; columns (15, 9), decay (n,), auxiliary d (15,) in place."""
    kalman.predict_error(columns, nothing, auxiliary, work)
    for i in range(NUM_NAVIGATION, NUM_STATES):
        auxiliary[i] *= decay[i]


@njit(cache=True, nogil=True, error_model="numpy")
def _innovate(
    places: Runs,
    runs: Runs,
    index: Runs,
    state: Floats,
    columns: Runs,
    values: Floats,
    factor: Floats,
    deviation: Floats,
    residual: Floats,
    whitened: Floats,
    nis: Floats,
) -> None:
    """Innovation with shared S; outputs stand at the places of the runs."""
    for place in places:
        run = runs[place]
        k = index[run]
        tight_filter.observe(columns, values[k], state[run], deviation[place], residual[place])
        nis[place] = kalman.whiten(factor[k], residual[place], whitened[place])


@njit(cache=True, nogil=True, error_model="numpy")
def _correct(runs: Runs, index: Runs, state: Floats, gain: Floats, whitened: Floats) -> None:
    """x <- x - U w."""
    for run in runs:
        tight_filter.correct_error(gain[index[run]], whitened[run], state[run])
