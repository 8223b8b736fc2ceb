"""The tightly coupled filter in the strapdown fidelity: mechanization at the IMU rate, ranges to the satellites.

The inertial solution is the nonlinear one of `loose`, and the predicted ranges are distances from its position. What is
linear by itself (clock, atmosphere, multipath, ambiguities) is carried as its error, as in the linear fidelity.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.geodesy import displace, ecef, geodetic_to_ecef
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.divergence import blank
from spoofgym.navigation.error_model import NUM_NAVIGATION, NUM_STATES
from spoofgym.navigation.interface import Decision, Demands, Innovation
from spoofgym.navigation.loose import kernels as closed_loop
from spoofgym.navigation.loose.shared_gains import NO_DEMANDS
from spoofgym.navigation.loose.strapdown import StrapdownNavigator
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.navigation.position_domain import project_onto_position
from spoofgym.navigation.tight import kalman as tight_filter
from spoofgym.navigation.tight.model import TightModel
from spoofgym.navigation.tight.shared_gains import at_epochs, draw_process_noise, start_satellites
from spoofgym.navigation.tight.states import BIAS, CLOCK, INERTIAL, POSITION
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams

GRAIN = 16


class TightStrapdownNavigator(StrapdownNavigator):
    """N closed-loop tightly coupled filters on one game.

    Attributes:
        tight: Φ, Q, H and R of the states beside the inertial ones.
        state: error of the states beside the inertial ones, (N, n); the first fifteen are zero.
        range_normals: standard normals of their noise in the episode, (N, K+1, n).
        covariance: P, (N, n, n).
    """

    shared_gains = False

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
        super().__init__(model, num_runs, slices, demands)
        n, m, slots = tight.dynamics.num_states, tight.dimension, self._past[0].shape[1]
        self.tight = tight
        self.satellites = satellites
        antenna = geodetic_to_ecef(model.true_position)
        self._distance = np.sqrt(np.square(satellites - antenna[:, None]).sum(axis=2))
        self.state = np.zeros((num_runs, n))
        self.range_normals = np.zeros((num_runs, tight.num_epochs + 1, n))
        self.covariance = np.zeros((num_runs, n, n))
        self._prior_covariance = tight.prior_covariance
        self._gain = np.zeros((num_runs, m, n))
        self._whitened = np.zeros((num_runs, m))
        self._deviation = np.zeros((num_runs, m))
        self._response = np.zeros((num_runs, m, 3))
        self._every_satellite = np.ones((num_runs, tight.dynamics.num_slots), dtype=bool)
        # the true bias goes back, too: the stored noise then carries it forward to the same bits
        self._resolved = (
            self.attitude,
            self.velocity,
            self.position,
            self.bias,
            self.true_bias,
            self.state,
            self.covariance,
        )
        self._past = tuple(np.zeros((num_runs, slots, *part.shape[1:])) for part in self._resolved)

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0; ``initial`` is that of `TightNavigator.reset`."""
        n, model = self.state.shape[1], self.model
        error = initial[:, INERTIAL]
        self.index[runs] = -1
        self.backtracked[runs] = 0
        self.auxiliary[runs] = 0.0
        self.covariance[runs] = self.tight.prior_covariance
        self.position[runs] = displace(np.broadcast_to(model.position, (len(runs), 3)), error[:, 6:9])
        self.velocity[runs] = model.velocity + error[:, 3:6]
        self.state[runs] = initial[:, :n]
        self.state[runs, INERTIAL] = 0.0
        self.bias[runs] = initial[:, n:]
        self.true_bias[runs] = initial[:, n:] + initial[:, BIAS]
        for run, x in zip(runs.tolist(), error, strict=True):
            self.attitude[run] = model.attitude
            closed_loop.rotate(self.attitude[run], -x[0], -x[1], -x[2])
            streams(run, "imu").standard_normal(out=self.range_normals[run])
            self._generators[run] = streams.spawn(run, "imu")
        self.diverged[runs] = False
        self._hold(runs)

    def _hold(self, runs: Runs) -> None:
        super()._hold(runs)
        if self.diverged.any():  # what a diverged filter believes of clock and atmosphere may not be finite
            self.state[self.diverged] = 0.0

    def _mechanize(self, runs: Runs, auxiliary: Floats) -> None:
        model, dynamics = self.model, self.tight.dynamics
        _propagate(
            runs,
            self.index,
            self.attitude,
            self.velocity,
            self.position,
            self.bias,
            self.true_bias,
            self.state,
            self.covariance,
            self._fix,
            self._normals,
            self.range_normals,
            model.angular_rate,
            model.specific_force,
            model.step,
            *model.parts,
            model.filter_density,
            model.true_noise,
            dynamics.noise_columns,
            dynamics.decay,
            dynamics.variance,
            dynamics.noise_sigma,
            dynamics.clock_noise,
            dynamics.clock_factor,
            dynamics.intervals,
            dynamics.clock_jump,
            dynamics.started,
            dynamics.satellite_sigma,
            auxiliary,
        )

    def innovate(self, deviation: Floats, runs: Runs | None = None) -> Innovation:
        """Form the innovation of runs (all by default).

        Args:
            deviation: what lies between the measured ranges and the true ones, (k, m), m and m/s.
            runs: which, (k,).
        """
        runs = self._all if runs is None else runs
        self._deviation[runs] = deviation
        return self._innovate_satellites(runs, self._ones[: len(runs)], self._every_satellite[: len(runs)])

    def _innovate_satellites(self, runs: Runs, noise_scale: Floats, satellites: Flags) -> Innovation:
        m, dynamics = self.tight.dimension, self.tight.dynamics
        residual, whitened, nis = np.empty((len(runs), m)), np.empty((len(runs), m)), np.empty(len(runs))
        covariance, response = np.empty((len(runs), m, m)), np.empty((len(runs), m, 3))
        self._slices.call(
            lambda part: _innovate(
                part,
                runs,
                self.index,
                self.position,
                self.velocity,
                self.model.true_velocity,
                self.satellites,
                self._distance,
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
        lost = self._lost(runs, nis)
        if len(lost):
            blank(lost, residual, covariance, whitened, nis)
            response[lost] = 0.0
        self._whitened[runs], self._response[runs] = whitened, response
        present = np.tile(at_epochs(dynamics.present, self.index[runs]) & satellites, (1, 2))
        return Innovation(residual, covariance, whitened, nis, response, present)

    def resolve(self, decision: Decision, runs: Runs | None = None) -> None:
        """Take ranges back, then apply the present ones, or reset to them, where the decision says so; else coast.

        Raises:
            ValueError: a backtrack without a history.
        """
        runs = self._all if runs is None else runs
        before = self._solution(runs) if self.auxiliary.shape[1] else None
        fresh, used = self._take_back(decision, runs), decision.use
        scale = self._ones[: len(runs)] if decision.noise_scale is None else decision.noise_scale
        satellites = self._every_satellite[: len(runs)] if decision.satellites is None else decision.satellites
        again = np.flatnonzero((fresh | (scale != 1.0) | ~satellites.all(axis=1)) & used)
        if len(again):
            self._innovate_satellites(runs[again], scale[again], satellites[again])
        if decision.reset is not None:
            jumps = used & (decision.reset > 0.0)
            self._reset_to_fix(runs[jumps], decision.reset[jumps])
            used = used & ~jumps
        self._correct(runs[used])
        self._hold(runs)
        if before is not None:
            self._move_auxiliary(runs, before)

    def _correct(self, runs: Runs) -> None:
        """Apply the present ranges."""
        self._slices.call(
            lambda part: _correct(
                part,
                self.attitude,
                self.velocity,
                self.position,
                self.bias,
                self.state,
                self.covariance,
                self._gain,
                self._whitened,
            ),
            runs,
            GRAIN,
        )

    def _reset_to_fix(self, runs: Runs, variance: Floats) -> None:
        """The position jumps to where the ranges ask for it; its correlations are forgotten."""
        if not len(runs):
            return
        residual, axes, nis = np.empty((len(runs), 3)), np.empty((len(runs), 3)), np.empty(len(runs))
        covariance = np.empty((len(runs), 3, 3))
        project_onto_position(self._response[runs], self._whitened[runs], residual, covariance, axes, nis)
        self.position[runs] = displace(self.position[runs], -residual)
        for axis in range(POSITION.start, POSITION.stop):
            self.covariance[runs, axis, :] = 0.0
            self.covariance[runs, :, axis] = 0.0
            self.covariance[runs, axis, axis] = variance

    @property
    def clock_error(self) -> Floats:
        """Estimate minus truth of the receiver's clock, (N,), m."""
        return self.state[:, CLOCK].copy()

    @property
    def inertial_covariance(self) -> Floats:
        """The filter's covariance of the fifteen inertial states, (N, 15, 15)."""
        return self.covariance[:, INERTIAL, INERTIAL].copy()

    @property
    def position_gain(self) -> Floats:
        """U' of the position for the ranges of the present epoch, (N, m, 3), m."""
        return self._gain[:, :, POSITION].copy()


@njit(cache=True, nogil=True)
def _propagate(
    runs: Runs,
    index: Runs,
    attitude: Floats,
    velocity: Floats,
    position: Floats,
    bias: Floats,
    true_bias: Floats,
    state: Floats,
    covariance: Floats,
    fix: Floats,
    normals: Floats,
    range_normals: Floats,
    angular_rate: Floats,
    specific_force: Floats,
    step: Floats,
    bounds: Runs,
    places: Runs,
    filter_density: Floats,
    true_noise: Floats,
    noise_columns: Floats,
    decay: Floats,
    variance: Floats,
    sigma: Floats,
    clock_noise: Floats,
    clock_factor: Floats,
    intervals: Floats,
    clock_jump: Floats,
    started: Flags,
    satellite_sigma: Floats,
    auxiliary: Floats,
) -> None:
    """Carry runs over one epoch: mechanization, the other states, covariance; the noise half before, half after Φ.

    The mechanization goes part by part; the other states are held until the end of the epoch.
    """
    n = state.shape[1]
    mean_force, residual_bias, mean, work = np.empty(3), np.empty(6), np.empty(NUM_NAVIGATION), np.empty(NUM_NAVIGATION)
    transition, product = np.empty((NUM_NAVIGATION, NUM_STATES)), np.empty((NUM_NAVIGATION, n))
    half_noise, nothing = np.zeros((NUM_NAVIGATION, NUM_NAVIGATION)), np.zeros((NUM_STATES, NUM_NAVIGATION))
    no_noise = np.zeros((2, 2))
    noise, held, still = np.empty(n), np.ones(n), np.zeros(n)
    noisy = normals.shape[2] > 0
    last = normals.shape[2] - closed_loop.NUM_EPOCH_NOISES
    for run in runs:
        index[run] += 1
        k = index[run]
        sampled = normals[run, k % normals.shape[1]]
        for a in range(6):
            residual_bias[a] = true_bias[run, a] - bias[run, a]
        begin, end = places[k], places[k + 1]
        start, interval = bounds[begin], 0.0
        for part in range(begin, end):
            length = closed_loop.mechanize_part(
                bounds[part],
                bounds[part + 1],
                -1,
                residual_bias,
                sampled[closed_loop.NUM_SAMPLE_NOISES * (bounds[part] - start) :],
                angular_rate,
                specific_force,
                step,
                true_noise,
                attitude[run],
                velocity[run],
                position[run],
                fix[run],
                mean_force,
                transition,
            )
            for i in range(NUM_NAVIGATION):
                half_noise[i, i] = 0.5 * length * filter_density[i]
                covariance[run, i, i] += half_noise[i, i]
            if part == end - 1:
                tight_filter.predict_covariance(
                    transition, half_noise, decay, variance, clock_noise, intervals[k], covariance[run], product
                )
            else:
                tight_filter.predict_covariance(
                    transition, half_noise, held, still, no_noise, 0.0, covariance[run], product
                )
            if auxiliary.shape[1] > 0:
                kalman.predict_mean(transition, auxiliary[run], mean)
            interval += length
        if noisy:
            closed_loop.disturb_position(position[run], true_noise, np.sqrt(interval), sampled[last:])
        draw_process_noise(noise_columns[k], sigma, clock_factor, range_normals[run, k], noise)
        for a in range(6):
            place = NUM_NAVIGATION + a
            true_bias[run, a] = decay[place] * true_bias[run, a] + noise[place]
            bias[run, a] *= decay[place]
        noise[:NUM_STATES] = 0.0
        tight_filter.predict_error(nothing, decay, intervals[k], noise, state[run], work)
        start_satellites(started[k], satellite_sigma, range_normals[run, k], state[run])
        covariance[run, CLOCK, CLOCK] += clock_jump[k]
        tight_filter.start_satellites(started[k], satellite_sigma, covariance[run])
        if auxiliary.shape[1] > 0:
            for i in range(NUM_NAVIGATION, NUM_STATES):
                auxiliary[run, i] *= decay[i]


@njit(cache=True, nogil=True)
def _innovate(
    places: Runs,
    runs: Runs,
    index: Runs,
    position: Floats,
    velocity: Floats,
    true_velocity: Floats,
    satellites: Floats,
    distance: Floats,
    state: Floats,
    covariance: Floats,
    columns: Runs,
    values: Floats,
    noise_variance: Floats,
    noise_scale: Floats,
    used: Flags,
    deviation: Floats,
    innovation: Floats,
    gain: Floats,
    response: Floats,
    residual: Floats,
    whitened: Floats,
    nis: Floats,
) -> None:
    """Innovation of runs, predicted minus measured; outputs, except the gain, stand at the places of the runs."""
    m, slots = columns.shape[0], satellites.shape[1]
    cross, factor = np.empty((m, state.shape[1])), np.empty((m, m))
    taken, variance = np.empty((m, columns.shape[1])), np.empty(m)
    for place in places:
        run = runs[place]
        k = index[run]
        x, y, z = ecef(position[run, 0], position[run, 1], position[run, 2])
        tight_filter.observe(columns, values[k], state[run], deviation[run], residual[place])
        for a in range(m):
            s = a % slots
            if values[k, a, 3] == 0.0:
                continue
            if columns[a, 0] == tight_filter.POSITION:
                dx, dy, dz = satellites[k, s, 0] - x, satellites[k, s, 1] - y, satellites[k, s, 2] - z
                residual[place, a] += np.sqrt(dx * dx + dy * dy + dz * dz) - distance[k, s]
            else:
                for c in range(3):
                    residual[place, a] += values[k, a, c] * (velocity[run, c] - true_velocity[k, c])
        tight_filter.leave_out(
            used[place], values[k], noise_variance[k], noise_scale[place], residual[place], taken, variance
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


@njit(cache=True, nogil=True)
def _correct(
    runs: Runs,
    attitude: Floats,
    velocity: Floats,
    position: Floats,
    bias: Floats,
    state: Floats,
    covariance: Floats,
    gain: Floats,
    whitened: Floats,
) -> None:
    """Add the correction -U w, minus the estimated error; P <- P - U U'."""
    correction = np.empty(state.shape[1])
    for run in runs:
        correction[:] = 0.0
        tight_filter.correct_error(gain[run], whitened[run], correction)
        closed_loop.feed_back(correction, attitude[run], velocity[run], position[run], bias[run])
        for i in range(NUM_STATES, state.shape[1]):
            state[run, i] += correction[i]
        tight_filter.update_covariance(gain[run], covariance[run])
