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
from spoofgym.navigation.batch import NO_DEMANDS, Weights
from spoofgym.navigation.divergence import Solution, blank, solution_of
from spoofgym.navigation.error_model import NUM_NAVIGATION, NUM_STATES
from spoofgym.navigation.history import History, Ring, keep
from spoofgym.navigation.interface import Demands, Innovation
from spoofgym.navigation.loose import kernels as closed_loop
from spoofgym.navigation.loose.inertial import InertialBatch
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.navigation.position_domain import project_onto_position
from spoofgym.navigation.tight import kalman as tight_filter
from spoofgym.navigation.tight.model import TightModel
from spoofgym.navigation.tight.shared_gains import at_epochs, draw_process_noise, start_satellites
from spoofgym.navigation.tight.states import BIAS, CLOCK, INERTIAL, POSITION
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams

GRAIN = 16


class TightStrapdownNavigator(InertialBatch):
    """N closed-loop tightly coupled filters on one game.

    Attributes:
        tight: Φ, Q, H and R of the states beside the inertial ones.
        state: error of the states beside the inertial ones, (N, n); the first fifteen are zero.
        range_normals: standard normals of their noise in the episode, (N, K+1, n).
    """

    shared_gains = False
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
        n, m = tight.dynamics.num_states, tight.dimension
        super().__init__(
            model, tight.prior_covariance, m, num_runs, slices, demands, tight.dynamics.num_slots
        )
        self.tight = tight
        self.satellites = satellites
        antenna = geodetic_to_ecef(model.true_position)
        self._distance = np.sqrt(np.square(satellites - antenna[:, None]).sum(axis=2))
        self.state = np.zeros((num_runs, n))
        self.range_normals = np.zeros((num_runs, tight.num_epochs + 1, n))
        self._response = np.zeros((num_runs, m, 3))
        # the true bias goes back, too: the stored noise then carries it forward to the same bits
        self.past = History(
            demands.history,
            self.covariance,
            **self._inertial._asdict(),
            true_bias=self.true_bias,
            state=self.state,
        )

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0; ``initial`` is that of `TightNavigator.reset`."""
        super().reset(runs, initial, streams)
        n, error = self.state.shape[1], initial[:, INERTIAL]
        self.state[runs] = initial[:, :n]
        self.state[runs, INERTIAL] = 0.0
        self.bias[runs] = initial[:, n:]
        self.true_bias[runs] = initial[:, n:] + initial[:, BIAS]
        for run in runs.tolist():
            streams(run, "imu").standard_normal(out=self.range_normals[run])
        self._start(runs, error, streams)
        self._settle(runs)

    def _settle(self, runs: Runs) -> None:
        super()._settle(runs)
        if self.diverged.any():  # what a diverged filter believes of clock and atmosphere may not be finite
            self.state[self.diverged] = 0.0

    def _carry(self, runs: Runs, epochs: Runs, auxiliary: Floats) -> None:
        self._draw(runs)
        model, dynamics = self.model, self.tight.dynamics
        _carry(
            runs,
            epochs,
            self.index,
            self._inertial,
            self.true_bias,
            self.state,
            self.past.ring,
            self._fix,
            self._normals,
            self.range_normals,
            model.steps,
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

    def _innovate(self, runs: Runs, weights: Weights) -> Innovation:
        noise_scale, satellites = weights
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

    def _correct(self, runs: Runs) -> None:
        """Apply the present ranges."""
        self._slices.call(
            lambda part: _correct(
                part,
                self._inertial,
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
def _carry(
    runs: Runs,
    epochs: Runs,
    index: Runs,
    inertial: Solution,
    true_bias: Floats,
    state: Floats,
    ring: Ring,
    fix: Floats,
    normals: Floats,
    range_normals: Floats,
    steps: closed_loop.StrapdownSteps,
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
    """Carry runs over so many epochs each: mechanization, the other states, covariance.

    The noise acts half before, half after Φ. The mechanization goes part by part; the other states are held until the
    end of the epoch.
    """
    n = state.shape[1]
    mean_force, residual_bias, mean, work = np.empty(3), np.empty(6), np.empty(NUM_NAVIGATION), np.empty(NUM_NAVIGATION)
    transition, product = np.empty((NUM_NAVIGATION, NUM_STATES)), np.empty((NUM_NAVIGATION, n))
    half_noise, nothing = np.zeros((NUM_NAVIGATION, NUM_NAVIGATION)), np.zeros((NUM_STATES, NUM_NAVIGATION))
    no_noise = np.zeros((2, 2))
    noise, held, still = np.empty(n), np.ones(n), np.zeros(n)
    noisy = normals.shape[2] > 0
    last = normals.shape[2] - closed_loop.NUM_EPOCH_NOISES
    bounds, places = steps.bounds, steps.places
    for run in runs:
        solution, covariance = solution_of(run, inertial), ring.covariance[run]
        for _ in range(epochs[run]):
            keep(run, index[run] + 1, ring)
            index[run] += 1
            k = index[run]
            sampled = normals[run, k % normals.shape[1]]
            for a in range(6):
                residual_bias[a] = true_bias[run, a] - solution.bias[a]
            begin, end = places[k], places[k + 1]
            start, interval = bounds[begin], 0.0
            for part in range(begin, end):
                length = closed_loop.mechanize_part(
                    (bounds[part], bounds[part + 1], -1),
                    residual_bias,
                    sampled[closed_loop.NUM_SAMPLE_NOISES * (bounds[part] - start) :],
                    steps.samples,
                    solution,
                    fix[run],
                    mean_force,
                    transition,
                )
                for i in range(NUM_NAVIGATION):
                    half_noise[i, i] = 0.5 * length * steps.filter_density[i]
                    covariance[i, i] += half_noise[i, i]
                if part == end - 1:
                    tight_filter.predict_covariance(
                        transition, half_noise, decay, variance, clock_noise, intervals[k], covariance, product
                    )
                else:
                    tight_filter.predict_covariance(
                        transition, half_noise, held, still, no_noise, 0.0, covariance, product
                    )
                if auxiliary.shape[1] > 0:
                    kalman.predict_mean(transition, auxiliary[run], mean)
                interval += length
            if noisy:
                root = np.sqrt(interval)
                closed_loop.disturb_position(solution.position, steps.samples.true_noise, root, sampled[last:])
            draw_process_noise(noise_columns[k], sigma, clock_factor, range_normals[run, k], noise)
            for a in range(6):
                place = NUM_NAVIGATION + a
                true_bias[run, a] = decay[place] * true_bias[run, a] + noise[place]
                solution.bias[a] *= decay[place]
            noise[:NUM_STATES] = 0.0
            tight_filter.predict_error(nothing, decay, intervals[k], noise, state[run], work)
            start_satellites(started[k], satellite_sigma, range_normals[run, k], state[run])
            covariance[CLOCK, CLOCK] += clock_jump[k]
            tight_filter.start_satellites(started[k], satellite_sigma, covariance)
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
    inertial: Solution,
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
        closed_loop.feed_back(correction, solution_of(run, inertial))
        for i in range(NUM_STATES, state.shape[1]):
            state[run, i] += correction[i]
        tight_filter.update_covariance(gain[run], covariance[run])
