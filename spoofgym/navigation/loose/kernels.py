"""The kernels of the strapdown fidelity: loops over runs, whose equations stand in the modules they call."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.geodesy import enu_difference, enu_displacement
from spoofgym.kernels import njit
from spoofgym.mechanization import load_matrix, mechanize, product, rotation, transpose
from spoofgym.navigation import kalman
from spoofgym.navigation.error_model import NUM_NAVIGATION, NUM_STATES, navigation_dynamics, transition_matrix
from spoofgym.sensors.imu import gauss_markov_step, white_sample

# rows of the state kept when a fix is taken
POSITION, VELOCITY, FORCE, ATTITUDE = 0, 1, 2, 3

NUM_SAMPLE_NOISES = 6
NUM_EPOCH_NOISES = 9


@njit(cache=True, nogil=True)
def propagate(
    runs: Runs,
    index: Runs,
    attitude: Floats,
    velocity: Floats,
    position: Floats,
    bias: Floats,
    true_bias: Floats,
    instability: Floats,
    covariance: Floats,
    fix: Floats,
    normals: Floats,
    angular_rate: Floats,
    specific_force: Floats,
    step: Floats,
    bounds: Runs,
    places: Runs,
    latency_samples: int,
    filter_density: Floats,
    process_scale: Floats,
    true_noise: Floats,
    instability_sigma: Floats,
    instability_decay: float,
    auxiliary: Floats,
) -> None:
    """Carry runs over one epoch, part by part: mechanization, covariance, and the state kept when the fix is taken.

    Shapes as in `StrapdownNavigator` and `StrapdownModel`; normals (N, B, W) hold the noise of B epochs
    in a ring, W = 6 samples + 9 of the epoch, or 0 where the samples have errors of their own. The unaided solution
    minus the filter, auxiliary (N, 15), is carried by the same Φ, or is none, (N, 0).
    """
    mean_force, residual_bias, mean = np.empty(3), np.empty(6), np.empty(NUM_NAVIGATION)
    transition, product = np.empty((NUM_NAVIGATION, NUM_STATES)), np.empty((NUM_NAVIGATION, NUM_STATES))
    half_noise = np.zeros((NUM_STATES, NUM_STATES))
    noisy = normals.shape[2] > 0
    last = normals.shape[2] - NUM_EPOCH_NOISES
    for run in runs:
        index[run] += 1
        noise = normals[run, index[run] % normals.shape[1]]
        for a in range(6):
            residual_bias[a] = true_bias[run, a] - bias[run, a]
        begin, end = places[index[run]], places[index[run] + 1]
        start, interval = bounds[begin], 0.0
        taken = bounds[end] - latency_samples
        for part in range(begin, end):
            length = mechanize_part(
                bounds[part],
                bounds[part + 1],
                taken,
                residual_bias,
                noise[NUM_SAMPLE_NOISES * (bounds[part] - start) :],
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
            for i in range(NUM_STATES):
                half_noise[i, i] = 0.5 * length * filter_density[i] * process_scale[run]
                covariance[run, i, i] += half_noise[i, i]
            kalman.predict_covariance(transition, half_noise, covariance[run], product)
            if auxiliary.shape[1] > 0:
                kalman.predict_mean(transition, auxiliary[run], mean)
            interval += length
        if noisy:
            disturb_position(position[run], true_noise, np.sqrt(interval), noise[last:])
            _drift_bias(true_bias[run], instability[run], instability_sigma, instability_decay, noise[last:])
        if latency_samples == 0:
            _keep_fix(attitude[run], velocity[run], position[run], fix[run])
        for a in range(3):
            fix[run, FORCE, a] = mean_force[a]


@njit(cache=True, nogil=True)
def mechanize_part(
    start: int,
    stop: int,
    taken: int,
    residual_bias: Floats,
    noise: Floats,
    angular_rate: Floats,
    specific_force: Floats,
    step: Floats,
    true_noise: Floats,
    attitude: Floats,
    velocity: Floats,
    position: Floats,
    fix: Floats,
    mean_force: Floats,
    transition: Floats,
) -> float:
    """Mechanize the inertial samples of a part of an epoch of one run, and form the transition of its error over it.

    Args:
        start: first sample.
        stop: the sample after the last.
        taken: sample before which the fix is taken; it need not be one of these.
        residual_bias: what is left of the biases, (6,).
        noise: normals, six per sample first; (0,) where the samples have errors of their own.
        angular_rate: of the true motion, (samples, 3).
        specific_force: likewise.
        step: of each sample, s.
        true_noise: standard deviation density of what acts on the samples, (9,).
        attitude: (3, 3), in place.
        velocity: (3,), in place.
        position: (3,), in place.
        fix: the state kept when the fix is taken, (6, 3), in place.
        mean_force: mean specific force in ENU, (3,), overwritten.
        transition: first nine rows of Φ, (9, 15), overwritten.

    Returns:
        The length of the part, s.
    """
    rate, force = np.empty(3), np.empty(3)
    middle_attitude, middle_velocity, middle_position = np.empty((3, 3)), np.empty(3), np.empty(3)
    dynamics, work = np.empty((NUM_NAVIGATION, NUM_NAVIGATION)), np.empty((2, NUM_NAVIGATION, NUM_NAVIGATION))
    noisy = noise.shape[0] > 0
    middle = start + (stop - start) // 2
    mean_force[:] = 0.0
    interval = 0.0
    for i in range(start, stop):
        if i == middle:
            middle_attitude[:, :] = attitude
            middle_velocity[:] = velocity
            middle_position[:] = position
        if i == taken:
            _keep_fix(attitude, velocity, position, fix)
        for a in range(3):
            rate[a] = angular_rate[i, a] + residual_bias[a]
            force[a] = specific_force[i, a] + residual_bias[3 + a]
        if noisy:
            for a in range(3):
                rate[a] += white_sample(true_noise[a], step[i], noise[NUM_SAMPLE_NOISES * (i - start) + a])
                force[a] += white_sample(true_noise[3 + a], step[i], noise[NUM_SAMPLE_NOISES * (i - start) + 3 + a])
        mechanize(attitude, velocity, position, rate, force, step[i], mean_force)
        interval += step[i]
    for a in range(3):
        mean_force[a] /= interval
    navigation_dynamics(middle_velocity, middle_position, mean_force, dynamics)
    transition_matrix(dynamics, middle_attitude, interval, transition, work)
    return interval


@njit(cache=True, nogil=True)
def _keep_fix(attitude: Floats, velocity: Floats, position: Floats, fix: Floats) -> None:
    for a in range(3):
        fix[POSITION, a] = position[a]
        fix[VELOCITY, a] = velocity[a]
        for b in range(3):
            fix[ATTITUDE + a, b] = attitude[a, b]


@njit(cache=True, nogil=True)
def disturb_position(position: Floats, true_noise: Floats, root: float, normals: Floats) -> None:
    """The random walk of the navigation computation over an epoch."""
    latitude, longitude, height = enu_displacement(
        position[0],
        position[1],
        position[2],
        root * true_noise[6] * normals[0],
        root * true_noise[7] * normals[1],
        root * true_noise[8] * normals[2],
    )
    position[0], position[1], position[2] = latitude, longitude, height


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
    covariance: Floats,
    fix_position: Floats,
    fix_velocity: Floats,
    lever_arm: Floats,
    latency: float,
    measurement_covariance: Floats,
    noise_row: Runs,
    noise_scale: Floats,
    deviation: Floats,
    innovation: Floats,
    gain: Floats,
    residual: Floats,
    whitened: Floats,
    nis: Floats,
) -> None:
    """Innovation of runs with their own S, and the whitened gain; a run's R is a row of the measurement covariances.

    Outputs, except the gain, stand at the places of the runs.
    """
    m = residual.shape[1]
    observation, arm = np.zeros((m, NUM_NAVIGATION)), np.empty(3)
    cross, factor = np.empty((m, NUM_STATES)), np.empty((m, m))
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
        noise = measurement_covariance[noise_row[run]]
        kalman.innovation_covariance(covariance[run], observation, noise, cross, innovation[place])
        kalman.scale_noise(noise_scale[place], noise, innovation[place])
        kalman.cholesky(innovation[place], factor)
        kalman.whitened_gain(cross, factor, gain[run])
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
def resolve(
    runs: Runs,
    attitude: Floats,
    velocity: Floats,
    position: Floats,
    bias: Floats,
    covariance: Floats,
    gain: Floats,
    whitened: Floats,
) -> None:
    """Add the correction -U w, minus the estimated error; P <- P - U U'."""
    correction = np.empty(NUM_STATES)
    for run in runs:
        correction[:] = 0.0
        kalman.correct_error(gain[run], whitened[run], correction)
        feed_back(correction, attitude[run], velocity[run], position[run], bias[run])
        kalman.update_covariance(gain[run], covariance[run])


@njit(cache=True, nogil=True)
def feed_back(correction: Floats, attitude: Floats, velocity: Floats, position: Floats, bias: Floats) -> None:
    """Correct the inertial solution of one run by minus its estimated error, (15,) at least; the others in place."""
    rotate(attitude, -correction[0], -correction[1], -correction[2])
    for a in range(3):
        velocity[a] += correction[3 + a]
    latitude, longitude, height = enu_displacement(
        position[0], position[1], position[2], correction[6], correction[7], correction[8]
    )
    position[0], position[1], position[2] = latitude, longitude, height
    for a in range(6):
        bias[a] -= correction[9 + a]


@njit(cache=True, nogil=True)
def reset(
    runs: Runs,
    variance: Floats,
    noise_row: Runs,
    velocity: Floats,
    position: Floats,
    covariance: Floats,
    measurement_covariance: Floats,
    residual: Floats,
) -> None:
    """Move position, and velocity where the fix has one, by the residual (n, m); their correlations are forgotten."""
    for place in range(len(runs)):
        run = runs[place]
        for a in range(residual.shape[1] - 3):
            velocity[run, a] -= residual[place, 3 + a]
            kalman.forget_correlations(3 + a, measurement_covariance[noise_row[run], 3 + a, 3 + a], covariance[run])
        latitude, longitude, height = enu_displacement(
            position[run, 0],
            position[run, 1],
            position[run, 2],
            -residual[place, 0],
            -residual[place, 1],
            -residual[place, 2],
        )
        position[run, 0], position[run, 1], position[run, 2] = latitude, longitude, height
        for a in range(3):
            kalman.forget_correlations(6 + a, variance[place], covariance[run])


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
