"""Runs of the true error under an aided filter, carried step by step from one fix to the next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.aids.kernels import Told, correct_unaided, forget, form, observe, tell
from spoofgym.navigation.error_model import NUM_INERTIAL, NUM_NAVIGATION
from spoofgym.navigation.history import Ring, keep
from spoofgym.navigation.loose.aided.model import AidGains, Measurements, Steps


class AidedErrors(NamedTuple):
    """The arrays of N runs that are carried, and the noise of their episodes.

    Attributes:
        epoch: where each run stands, (N,).
        state: the true error, (N, n).
        true_bias: (N, 6).
        normals: of the process noise, (N, S, 9).
        bias_steps: changes of the biases at each epoch, (N, K+1, 6); (N, 0, 6) where they are constant.
        walk_normals: of the walk of the aids' states, (N, S, a).
        aid_normals: of the measurements of the aids, (N, B, R).
    """

    epoch: Runs
    state: Floats
    true_bias: Floats
    normals: Floats
    bias_steps: Floats
    walk_normals: Floats
    aid_normals: Floats


@njit(cache=True, nogil=True, error_model="numpy")
def step_noise(run: int, step: int, epoch: int, steps: Steps, errors: AidedErrors, noise: Floats) -> None:
    """Write what acts on a run's states in a step, (n,); the biases take theirs in the last step of an epoch."""
    columns, normals = steps.noise_columns[step], errors.normals[run, step]
    for i in range(NUM_INERTIAL):
        noise[i] = 0.0
    for j in range(NUM_NAVIGATION):
        factor = normals[j]
        for i in range(NUM_NAVIGATION):
            noise[i] += columns[j, i] * factor
    for a in range(len(steps.walk)):
        noise[NUM_INERTIAL + a] = steps.walk[a] * errors.walk_normals[run, step, a]
    if errors.bias_steps.shape[1] > 0 and (step + 1) % steps.per_epoch == 0:
        for a in range(6):
            moved = errors.bias_steps[run, epoch, a]
            noise[NUM_NAVIGATION + a] = moved
            errors.true_bias[run, a] += moved


@njit(cache=True, nogil=True, error_model="numpy")
def read(
    run: int, number: int, measurements: Measurements, errors: AidedErrors, residual: Floats
) -> None:
    """Write the residual of a measurement, (r,): H x - noise."""
    aid = measurements.aid[number]
    for a in range(len(residual)):
        residual[a] = -measurements.sigma[aid, a] * errors.aid_normals[run, number, a]
    observe(measurements.observation[number, : len(residual)], errors.state[run], residual)


@njit(cache=True, nogil=True, error_model="numpy")
def carry_with_shared_gains(
    runs: Runs,
    steps: Steps,
    measurements: Measurements,
    gains: AidGains,
    errors: AidedErrors,
    told: Told,
    auxiliary: Floats,
) -> None:
    """Carry runs over one epoch, every measurement of an aid used, with the gains of the model.

    ``auxiliary`` is the solution without GNSS minus the filter's, (N, n), or (N, 0) where there is none.
    """
    n = errors.state.shape[1]
    noise, nothing, work = np.zeros(n), np.zeros(n), np.empty(NUM_NAVIGATION)
    most = measurements.observation.shape[1]
    residuals, whiteneds, spare = np.empty(most), np.empty(most), np.empty(most)
    for run in runs:
        errors.epoch[run] += 1
        k = errors.epoch[run]
        forget(run, told)
        for step in range(k * steps.per_epoch, (k + 1) * steps.per_epoch):
            step_noise(run, step, k, steps, errors, noise)
            kalman.predict_error(steps.transition_columns[step], noise, errors.state[run], work)
            if auxiliary.shape[1] > 0:
                kalman.predict_error(steps.transition_columns[step], nothing, auxiliary[run], work)
            for number in range(measurements.first[step], measurements.first[step + 1]):
                aid = measurements.aid[number]
                rows = measurements.rows[aid]
                residual, whitened = residuals[:rows], whiteneds[:rows]
                factor, gain = gains.factor[number, :rows, :rows], gains.gain[number, :rows]
                read(run, number, measurements, errors, residual)
                kalman.whiten(factor, residual, whitened)
                kalman.correct_error(gain, whitened, errors.state[run])
                tell(run, aid, measurements.first_row[aid], whitened, True, told)
                if auxiliary.shape[1] > 0:
                    observation = measurements.observation[number, :rows]
                    correct_unaided(observation, factor, gain, spare[:rows], whitened, auxiliary[run])


@njit(cache=True, nogil=True, error_model="numpy")
def carry_with_own_gains(
    runs: Runs,
    epochs: Runs,
    steps: Steps,
    measurements: Measurements,
    errors: AidedErrors,
    told: Told,
    ring: Ring,
    auxiliary: Floats,
) -> None:
    """Carry runs over so many epochs each, each measurement of an aid through its gate, with gains of their own.

    What a run was is kept before each epoch. ``auxiliary`` is as in `carry_with_shared_gains`.
    """
    n, most = errors.state.shape[1], measurements.observation.shape[1]
    noise, nothing, work, product = np.zeros(n), np.zeros(n), np.empty(NUM_NAVIGATION), np.empty((NUM_NAVIGATION, n))
    residuals, whiteneds, spare = np.empty(most), np.empty(most), np.empty(most)
    factors, gains, crosses = np.empty((most, most)), np.empty((most, n)), np.empty((most, n))
    remembers = ring.past_covariance.shape[1] > 0
    for run in runs:
        state, covariance = errors.state[run], ring.covariance[run]
        for _ in range(epochs[run]):
            errors.epoch[run] += 1
            k = errors.epoch[run]
            if remembers:
                keep(run, k, ring)
            forget(run, told)
            for step in range(k * steps.per_epoch, (k + 1) * steps.per_epoch):
                step_noise(run, step, k, steps, errors, noise)
                kalman.predict_error(steps.transition_columns[step], noise, state, work)
                kalman.predict_covariance(steps.transition[step], steps.process_noise[step], covariance, product)
                if auxiliary.shape[1] > 0:
                    kalman.predict_error(steps.transition_columns[step], nothing, auxiliary[run], work)
                for number in range(measurements.first[step], measurements.first[step + 1]):
                    aid = measurements.aid[number]
                    rows = measurements.rows[aid]
                    residual, whitened, gain = residuals[:rows], whiteneds[:rows], gains[:rows]
                    factor, observation = factors[:rows, :rows], measurements.observation[number, :rows]
                    read(run, number, measurements, errors, residual)
                    form(covariance, observation, measurements.sigma[aid, :rows] ** 2, crosses[:rows], factor, gain)
                    used = kalman.whiten(factor, residual, whitened) <= measurements.limit[aid]
                    tell(run, aid, measurements.first_row[aid], whitened, used, told)
                    if used:
                        kalman.correct_error(gain, whitened, state)
                        kalman.update_covariance(gain, covariance)
                        if auxiliary.shape[1] > 0:
                            correct_unaided(observation, factor, gain, spare[:rows], whitened, auxiliary[run])
