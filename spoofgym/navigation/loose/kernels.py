"""The kernels of the strapdown fidelity: loops over runs, whose equations stand in the modules they call."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.geodesy import enu_difference, enu_displacement
from spoofgym.kernels import njit
from spoofgym.mechanization import load_matrix, mechanize, product, rotation, transpose
from spoofgym.navigation import kalman
from spoofgym.navigation.batch import InnovationArrays
from spoofgym.navigation.divergence import Solution, solution_of
from spoofgym.navigation.error_model import NUM_INERTIAL, NUM_NAVIGATION, navigation_dynamics, transition_matrix
from spoofgym.navigation.history import Ring, keep
from spoofgym.navigation.loose.innovation import FilterNoise, FilterRuns, FixNoise, form_innovation
from spoofgym.sensors.imu import gauss_markov_step, white_sample

# rows of the state kept when a fix is taken
POSITION, VELOCITY, FORCE, ATTITUDE = 0, 1, 2, 3

NUM_SAMPLE_NOISES = 6
NUM_EPOCH_NOISES = 9


class Samples(NamedTuple):
    """Inertial samples of a game.

    Attributes:
        angular_rate: of the true motion or measured, body R, F, U, (samples, 3), rad/s.
        specific_force: of the same, (samples, 3), m/s².
        step: duration of each, (samples,), s.
        true_noise: standard deviation density of what acts on rate, force and position of each run, (9,).
    """

    angular_rate: Floats
    specific_force: Floats
    step: Floats
    true_noise: Floats


class StrapdownSteps(NamedTuple):
    """The arrays of a `StrapdownModel` that kernels carry runs with.

    Attributes:
        samples: of the game.
        bounds: samples bounds[p]..bounds[p+1] are part p, (P+1,).
        places: parts places[k]..places[k+1] lead to epoch k, (K+2,).
        latency_samples: inertial samples between the fix and its epoch.
        filter_density: the filter's process noise, (15,), unit²/s.
        instability_sigma: of the biases, (6,).
        instability_decay: over an epoch.
    """

    samples: Samples
    bounds: Runs
    places: Runs
    latency_samples: int
    filter_density: Floats
    instability_sigma: Floats
    instability_decay: float


class FixReference(NamedTuple):
    """What fixes are compared with: place and velocity (K+1, 3) of the antenna, lever arm (3,), m, and latency, s."""

    position: Floats
    velocity: Floats
    lever_arm: Floats
    latency: float


class StrapdownRuns(NamedTuple):
    """The arrays of `StrapdownNavigator` that its kernels carry.

    Attributes:
        epoch: where each run stands, (N,).
        solution: of all runs.
        true_bias: (N, 6).
        instability: the part of it that drifts, (N, 6).
        fix: the state kept when the fix is taken, (N, 6, 3).
        normals: noise of B epochs in a ring, (N, B, W), W = 6 samples + 9 of the epoch; W = 0 where the samples have
            errors of their own.
    """

    epoch: Runs
    solution: Solution
    true_bias: Floats
    instability: Floats
    fix: Floats
    normals: Floats


@njit(cache=True, nogil=True)
def carry(
    runs: Runs,
    epochs: Runs,
    steps: StrapdownSteps,
    process_scale: Floats,
    vehicles: StrapdownRuns,
    ring: Ring,
    auxiliary: Floats,
) -> None:
    """Carry runs over so many epochs each, part by part: mechanization, covariance, and the state kept at the fix.

    Each state is stored in the history before its epoch begins. ``auxiliary`` is the unaided solution minus the
    filter's, which the transition Φ of the filter carries, too; its shape is (N, 15), or (N, 0) if disabled.
    """
    # named tuples are taken apart here: in the loop that would cost more than the equations
    samples, bounds, places, latency_samples, density, instability_sigma, instability_decay = steps
    index, inertial, true_bias, instability, fix, normals = vehicles
    covariance, remembers = ring.covariance, ring.past_covariance.shape[1] > 0
    n = covariance.shape[1]
    mean_force, residual_bias, mean = np.empty(3), np.empty(6), np.empty(NUM_NAVIGATION)
    transition, product = np.empty((NUM_NAVIGATION, NUM_INERTIAL)), np.empty((NUM_NAVIGATION, n))
    half_noise = np.zeros((n, n))
    noisy = normals.shape[2] > 0
    last = normals.shape[2] - NUM_EPOCH_NOISES
    for run in runs:
        solution = solution_of(run, inertial)
        for _ in range(epochs[run]):
            index[run] += 1
            k = index[run]
            if remembers:
                keep(run, k, ring)
            drawn = normals[run, k % normals.shape[1]]
            for a in range(6):
                residual_bias[a] = true_bias[run, a] - solution.bias[a]
            begin, end = places[k], places[k + 1]
            start, interval = bounds[begin], 0.0
            taken = bounds[end] - latency_samples
            for part in range(begin, end):
                length = mechanize_part(
                    (bounds[part], bounds[part + 1], taken),
                    residual_bias,
                    drawn[NUM_SAMPLE_NOISES * (bounds[part] - start) :],
                    samples,
                    solution,
                    fix[run],
                    mean_force,
                    transition,
                )
                for i in range(n):
                    half_noise[i, i] = 0.5 * length * density[i] * process_scale[run]
                    covariance[run, i, i] += half_noise[i, i]
                kalman.predict_covariance(transition, half_noise, covariance[run], product)
                if auxiliary.shape[1] > 0:
                    kalman.predict_mean(transition, auxiliary[run], mean)
                interval += length
            if noisy:
                disturb_position(solution.position, samples.true_noise, np.sqrt(interval), drawn[last:])
                _drift_bias(true_bias[run], instability[run], instability_sigma, instability_decay, drawn[last:])
            if latency_samples == 0:
                _keep_fix(solution, fix[run])
            for a in range(3):
                fix[run, FORCE, a] = mean_force[a]


@njit(cache=True, nogil=True)
def mechanize_part(
    part: tuple[int, int, int],
    residual_bias: Floats,
    noise: Floats,
    samples: Samples,
    solution: Solution,
    fix: Floats,
    mean_force: Floats,
    transition: Floats,
) -> float:
    """Mechanize the inertial samples of a part of an epoch of one run, and form the transition of its error over it.

    Args:
        part: its first sample, the sample after its last, and the sample before which the fix is taken, which need not
            be one of these.
        residual_bias: what is left of the biases, (6,).
        noise: normals, six per sample first; (0,) where the samples have errors of their own.
        samples: of the game.
        solution: of the run, in place.
        fix: the state kept when the fix is taken, (6, 3), in place.
        mean_force: mean specific force in ENU, (3,), overwritten.
        transition: first nine rows of Φ, (9, 15), overwritten.

    Returns:
        The length of the part, s.
    """
    start, stop, taken = part
    attitude, velocity, position, _ = solution
    angular_rate, specific_force, step, true_noise = samples
    rate, force = np.empty(3), np.empty(3)
    middle_attitude, middle_velocity, middle_position = np.empty((3, 3)), np.empty(3), np.empty(3)
    dynamics, work = np.empty((NUM_NAVIGATION, NUM_NAVIGATION)), np.empty((2, NUM_NAVIGATION, NUM_NAVIGATION))
    noisy = noise.shape[0] > 0
    middle = start + (stop - start) // 2
    mean_force[:] = 0.0
    interval = 0.0
    for i in range(start, stop):
        if i == middle:
            # element by element: a kernel that assigns an array to a part of another takes seconds more to compile
            for a in range(3):
                middle_velocity[a], middle_position[a] = velocity[a], position[a]
                for b in range(3):
                    middle_attitude[a, b] = attitude[a, b]
        if i == taken:
            _keep_fix(solution, fix)
        for a in range(3):
            rate[a] = angular_rate[i, a] + residual_bias[a]
            force[a] = specific_force[i, a] + residual_bias[3 + a]
        if noisy:
            for a in range(3):
                drawn = NUM_SAMPLE_NOISES * (i - start) + a
                rate[a] += white_sample(true_noise[a], step[i], noise[drawn])
                force[a] += white_sample(true_noise[3 + a], step[i], noise[drawn + 3])
        mechanize(attitude, velocity, position, rate, force, step[i], mean_force)
        interval += step[i]
    for a in range(3):
        mean_force[a] /= interval
    navigation_dynamics(middle_velocity, middle_position, mean_force, dynamics)
    transition_matrix(dynamics, middle_attitude, interval, transition, work)
    return interval


@njit(cache=True, nogil=True)
def _keep_fix(solution: Solution, fix: Floats) -> None:
    for a in range(3):
        fix[POSITION, a] = solution.position[a]
        fix[VELOCITY, a] = solution.velocity[a]
        for b in range(3):
            fix[ATTITUDE + a, b] = solution.attitude[a, b]


@njit(cache=True, nogil=True)
def disturb_position(position: Floats, true_noise: Floats, root: float, normals: Floats) -> None:
    """The random walk of the navigation computation over an epoch."""
    east, north, up = root * true_noise[6], root * true_noise[7], root * true_noise[8]
    _move(position, east * normals[0], north * normals[1], up * normals[2])


@njit(cache=True, nogil=True)
def _drift_bias(true_bias: Floats, instability: Floats, sigma: Floats, decay: float, normals: Floats) -> None:
    """One epoch of the Gauss-Markov bias instability; the bias is held within an epoch."""
    for a in range(6):
        following = gauss_markov_step(instability[a], sigma[a], decay, normals[3 + a])
        true_bias[a] += following - instability[a]
        instability[a] = following


@njit(cache=True, nogil=True)
def innovate(
    places: Runs,
    runs: Runs,
    index: Runs,
    fix: Floats,
    reference: FixReference,
    noise: FixNoise,
    filters: FilterRuns,
    formed: InnovationArrays,
) -> None:
    """Innovation of runs with their own S, and the whitened gain; fix as in `StrapdownRuns`.

    Outputs, except the gain, stand at the places of the runs.
    """
    fix_position, fix_velocity, lever_arm, latency = reference
    variance, row, scale = noise
    covariance, gain, deviation, _ = filters
    residual, innovation, whitened, nis = formed
    m = residual.shape[1]
    observation, arm = np.zeros((m, NUM_NAVIGATION)), np.empty(3)
    cross, factor = np.empty((m, covariance.shape[1])), np.empty((m, m))
    for place in places:
        run = runs[place]
        k = index[run]
        for a in range(3):
            arm[a] = 0.0
            for b in range(3):
                arm[a] += fix[run, ATTITUDE + a, b] * lever_arm[b]
        _observation(arm, fix[run, FORCE], latency, observation)
        difference = enu_difference(
            fix[run, POSITION, 0],
            fix[run, POSITION, 1],
            fix[run, POSITION, 2],
            fix_position[k, 0],
            fix_position[k, 1],
            fix_position[k, 2],
        )
        for a in range(3):
            residual[place, a] = difference[a] + arm[a] - deviation[run, a]
        for a in range(3, m):
            residual[place, a] = fix[run, VELOCITY, a - 3] - fix_velocity[k, a - 3] - deviation[run, a]
        form_innovation(
            covariance[run], observation, variance[row[run]], scale[place], innovation[place], gain[run], cross, factor
        )
        nis[place] = kalman.whiten(factor, residual[place], whitened[place])


@njit(cache=True, nogil=True)
def _observation(arm: Floats, force: Floats, latency: float, observation: Floats) -> None:
    """H on the nine navigation states: z = δp + (C l) x φ - τ δv, and with velocity z_v = δv - τ f x φ."""
    _put_cross(observation, 0, arm, 1.0)
    for a in range(3):
        observation[a, 3 + a] = -latency
        observation[a, 6 + a] = 1.0
    if observation.shape[0] == 6:
        _put_cross(observation, 3, force, -latency)
        for a in range(3):
            observation[3 + a, 3 + a] = 1.0


@njit(cache=True, nogil=True)
def _put_cross(observation: Floats, row: int, vector: Floats, factor: float) -> None:
    """Write factor [v x] into the attitude columns."""
    x, y, z = factor * vector[0], factor * vector[1], factor * vector[2]
    observation[row, 1], observation[row, 2] = -z, y
    observation[row + 1, 0], observation[row + 1, 2] = z, -x
    observation[row + 2, 0], observation[row + 2, 1] = -y, x


@njit(cache=True, nogil=True)
def correct(runs: Runs, solution: Solution, gain: Floats, whitened: Floats, covariance: Floats) -> None:
    """Add the correction -U w, minus the estimated error; P <- P - U U'."""
    correction = np.empty(gain.shape[2])
    for run in runs:
        correction[:] = 0.0
        kalman.correct_error(gain[run], whitened[run], correction)
        feed_back(correction, solution_of(run, solution))
        kalman.update_covariance(gain[run], covariance[run])


@njit(cache=True, nogil=True)
def feed_back(correction: Floats, solution: Solution) -> None:
    """Correct the inertial solution of one run, in place, by minus its estimated error, (15,) at least."""
    rotate(solution.attitude, -correction[0], -correction[1], -correction[2])
    for a in range(3):
        solution.velocity[a] += correction[3 + a]
    _move(solution.position, correction[6], correction[7], correction[8])
    for a in range(6):
        solution.bias[a] -= correction[9 + a]


@njit(cache=True, nogil=True)
def _move(position: Floats, east: float, north: float, up: float) -> None:
    """Displace a position (3,), in place, by metres."""
    latitude, longitude, height = enu_displacement(position[0], position[1], position[2], east, north, up)
    position[0], position[1], position[2] = latitude, longitude, height


@njit(cache=True, nogil=True)
def reset(
    runs: Runs, variance: Floats, noise: FilterNoise, solution: Solution, all_covariance: Floats, residual: Floats
) -> None:
    """Move position, and velocity where the fix has one, by the residual (n, m); their correlations are forgotten."""
    for place in range(len(runs)):
        run = runs[place]
        covariance = all_covariance[run]
        for a in range(residual.shape[1] - 3):
            solution.velocity[run, a] -= residual[place, 3 + a]
            kalman.forget_correlations(3 + a, noise.covariance[noise.row[run], 3 + a, 3 + a], covariance)
        _move(solution.position[run], -residual[place, 0], -residual[place, 1], -residual[place, 2])
        for a in range(3):
            kalman.forget_correlations(6 + a, variance[place], covariance)


@njit(cache=True, nogil=True)
def rotate(attitude: Floats, x: float, y: float, z: float) -> None:
    """C <- Exp([θ x]) C by a rotation vector θ of any length, rad; C (3, 3) in place.

    The turn is exact (Rodrigues). One step of C <- C (3 I - C'C) / 2 takes away the rounding of all turns before it.
    """
    turned = product(rotation(x, y, z), load_matrix(attitude))
    square = product(transpose(turned), turned)
    turned = product(
        turned,
        (
            1.5 - 0.5 * square[0],
            -0.5 * square[1],
            -0.5 * square[2],
            -0.5 * square[3],
            1.5 - 0.5 * square[4],
            -0.5 * square[5],
            -0.5 * square[6],
            -0.5 * square[7],
            1.5 - 0.5 * square[8],
        ),
    )
    for i in range(3):
        for j in range(3):
            attitude[i, j] = turned[3 * i + j]
