"""The strapdown fidelity of an aided filter: loops over runs, for one part of an epoch at a time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.aids.kernels import Told, correct_unaided, forget, form, observe, tell
from spoofgym.navigation.divergence import Solution, solution_of
from spoofgym.navigation.error_model import NUM_INERTIAL, NUM_NAVIGATION
from spoofgym.navigation.history import Ring, keep
from spoofgym.navigation.loose.innovation import FilterRuns
from spoofgym.navigation.loose.kernels import (
    ATTITUDE,
    NUM_EPOCH_NOISES,
    NUM_SAMPLE_NOISES,
    POSITION,
    VELOCITY,
    StrapdownRuns,
    StrapdownSteps,
    disturb_position,
    feed_back,
    mechanize_part,
)
from spoofgym.sensors.imu import gauss_markov_step


class AidStates(NamedTuple):
    """The states of the aids of N runs.

    Attributes:
        error: estimate minus truth, in a log the estimate, (N, a).
        walk: of the truth, per root second, (a,).
        normals: of it in each part, (N, P, a); (N, 0, a) in a log.
    """

    error: Floats
    walk: Floats
    normals: Floats


class Reading(NamedTuple):
    """What one aid makes of runs (k,) that it measures.

    Attributes:
        aid: which.
        first_row: of it among the rows of all.
        sigma: of its noise, (r,).
        limit: normalised innovation squared above which a reading is left out.
        residual: without its own states and noise, (k, r).
        observation: H, (k, r, n).
        normals: of the noise, (k, r).
    """

    aid: int
    first_row: int
    sigma: Floats
    limit: float
    residual: Floats
    observation: Floats
    normals: Floats


@njit(cache=True, nogil=True)
def begin_epoch(runs: Runs, index: Runs, ring: Ring, told: Told) -> None:
    """Keep what runs are, and let their next epoch begin."""
    for run in runs:
        index[run] += 1
        if ring.past_covariance.shape[1] > 0:
            keep(run, index[run], ring)
        forget(run, told)


@njit(cache=True, nogil=True)
def carry_part(
    runs: Runs,
    parts: Runs,
    steps: StrapdownSteps,
    density: Floats,
    vehicles: StrapdownRuns,
    aid_states: AidStates,
    covariance: Floats,
    auxiliary: Floats,
) -> None:
    """Mechanize one part (n,) of the present epoch of each run, and carry covariance and auxiliary solution over it.

    ``density`` is the filter's process noise with that of the aids' states, (n,), unit²/s. The walk of the position and
    the change of the biases come with the last part of an epoch.
    """
    samples, bounds, places, latency_samples, _, instability_sigma, instability_decay = steps
    index, inertial, true_bias, instability, fix, normals = vehicles
    n = covariance.shape[1]
    mean_force, residual_bias, mean = np.empty(3), np.empty(6), np.empty(NUM_NAVIGATION)
    transition, product = np.empty((NUM_NAVIGATION, NUM_INERTIAL)), np.empty((NUM_NAVIGATION, n))
    half_noise = np.zeros((n, n))
    noisy, last = normals.shape[2] > 0, normals.shape[2] - NUM_EPOCH_NOISES
    for number in range(len(runs)):
        run, part = runs[number], parts[number]
        k = index[run]
        solution = solution_of(run, inertial)
        drawn = normals[run, k % normals.shape[1]]
        for a in range(6):
            residual_bias[a] = true_bias[run, a] - solution.bias[a]
        start, end = bounds[places[k]], bounds[places[k + 1]]
        length = mechanize_part(
            (bounds[part], bounds[part + 1], end - latency_samples),
            residual_bias,
            drawn[NUM_SAMPLE_NOISES * (bounds[part] - start) :],
            samples,
            solution,
            fix[run],
            mean_force,
            transition,
        )
        for i in range(n):
            half_noise[i, i] = 0.5 * length * density[i]
            covariance[run, i, i] += half_noise[i, i]
        kalman.predict_covariance(transition, half_noise, covariance[run], product)
        if auxiliary.shape[1] > 0:
            kalman.predict_mean(transition, auxiliary[run], mean)
        if aid_states.normals.shape[1] > 0:
            for a in range(len(aid_states.walk)):
                aid_states.error[run, a] += np.sqrt(length) * aid_states.walk[a] * aid_states.normals[run, part, a]
        if noisy and part + 1 == places[k + 1]:
            interval = 0.0
            for i in range(start, end):
                interval += samples.step[i]
            disturb_position(solution.position, samples.true_noise, np.sqrt(interval), drawn[last:])
            for a in range(6):
                following = gauss_markov_step(
                    instability[run, a], instability_sigma[a], instability_decay, drawn[last + 3 + a]
                )
                true_bias[run, a] += following - instability[run, a]
                instability[run, a] = following


@njit(cache=True, nogil=True)
def take_fix(runs: Runs, solution: Solution, fix: Floats) -> None:
    """Keep the state that the fix of each run is compared with, after the aids have corrected it."""
    for run in runs:
        for a in range(3):
            fix[run, POSITION, a] = solution.position[run, a]
            fix[run, VELOCITY, a] = solution.velocity[run, a]
            for b in range(3):
                fix[run, ATTITUDE + a, b] = solution.attitude[run, a, b]


@njit(cache=True, nogil=True, error_model="numpy")
def use_reading(
    runs: Runs,
    reading: Reading,
    solution: Solution,
    error: Floats,
    all_covariance: Floats,
    told: Told,
    auxiliary: Floats,
) -> None:
    """Correct runs (k,) by what an aid reads, where it passes the gate.

    Args:
        runs: which.
        reading: of the aid.
        solution: of all runs, in place.
        error: of the aids' states, (N, a), in place.
        all_covariance: P, (N, n, n), in place.
        told: what the aids have told, in place.
        auxiliary: the solution without GNSS minus the filter's, (N, n) or (N, 0), in place.
    """
    rows, n = reading.observation.shape[1], all_covariance.shape[1]
    cross, factor, gain = np.empty((rows, n)), np.empty((rows, rows)), np.empty((rows, n))
    residual, whitened, spare = np.empty(rows), np.empty(rows), np.empty(rows)
    variance, correction = reading.sigma**2, np.empty(n)
    for place in range(len(runs)):
        run, observation = runs[place], reading.observation[place]
        for a in range(rows):
            residual[a] = reading.residual[place, a] - reading.sigma[a] * reading.normals[place, a]
        observe(observation[:, NUM_INERTIAL:], error[run], residual)
        form(all_covariance[run], observation, variance, cross, factor, gain)
        used = kalman.whiten(factor, residual, whitened) <= reading.limit
        tell(run, reading.aid, reading.first_row, whitened, used, told)
        if used:
            correction[:] = 0.0
            kalman.correct_error(gain, whitened, correction)
            feed_back(correction, solution_of(run, solution))
            for a in range(error.shape[1]):
                error[run, a] += correction[NUM_INERTIAL + a]
            kalman.update_covariance(gain, all_covariance[run])
            if auxiliary.shape[1] > 0:
                correct_unaided(observation, factor, gain, spare, whitened, auxiliary[run])


@njit(cache=True, nogil=True)
def correct_states(runs: Runs, error: Floats, filters: FilterRuns) -> None:
    """Correct the aids' states (N, a) of runs by their fix: minus the part of U w that is theirs."""
    for run in runs:
        for row in range(filters.gain.shape[1]):
            for a in range(error.shape[1]):
                error[run, a] -= filters.gain[run, row, NUM_INERTIAL + a] * filters.whitened[run, row]
