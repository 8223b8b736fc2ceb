"""The true error of a run under a tightly coupled filter, one epoch at a time: x <- Φ x + w, and the true biases."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.error_model import NUM_NAVIGATION
from spoofgym.navigation.tight import kalman as tight_filter
from spoofgym.navigation.tight.states import CLOCK, NUM_COMMON, PER_SATELLITE


class ErrorSteps(NamedTuple):
    """Φ and a square root of Q as they truly act; leading axis: epochs. What each is, `TightDynamics` says."""

    transition_columns: Floats
    noise_columns: Floats
    decay: Floats
    noise_sigma: Floats
    clock_factor: Floats
    intervals: Floats
    started: Flags
    satellite_sigma: Floats


class ErrorRuns(NamedTuple):
    """The arrays of N runs that kernels carry.

    Attributes:
        epoch: where each run stands, (N,).
        state: the true error of all states, (N, n).
        true_bias: gyro and accelerometer biases, (N, 6), rad/s and m/s².
        normals: standard normals of the episode, (N, K+1, n).
    """

    epoch: Runs
    state: Floats
    true_bias: Floats
    normals: Floats


class ErrorWork(NamedTuple):
    """Memory to carry one run: noise (n,), the states of the navigation (9,), and zeros (15,)."""

    noise: Floats
    navigation: Floats
    nothing: Floats


@njit(cache=True, nogil=True, error_model="numpy")
def error_work(steps: ErrorSteps) -> ErrorWork:
    """Memory to carry runs."""
    return ErrorWork(
        np.empty(steps.decay.shape[0]), np.empty(NUM_NAVIGATION), np.zeros(steps.transition_columns.shape[1])
    )


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def draw_process_noise(k: int, steps: ErrorSteps, normals: Floats, noise: Floats) -> None:
    """The noise w that acts on a run's error up to epoch k, (n,), overwritten, from the epoch's normals (n,)."""
    columns, sigma, clock = steps.noise_columns[k], steps.noise_sigma, steps.clock_factor
    for i in range(NUM_NAVIGATION):
        noise[i] = 0.0
    for j in range(NUM_NAVIGATION):
        factor = normals[j]
        for i in range(NUM_NAVIGATION):
            noise[i] += columns[j, i] * factor
    for i in range(NUM_NAVIGATION, noise.shape[0]):
        noise[i] = sigma[i] * normals[i]
    for i in range(2):
        noise[CLOCK + i] = clock[i, 0] * normals[CLOCK] + clock[i, 1] * normals[CLOCK + 1]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def start_satellites(started: Flags, sigma: Floats, normals: Floats, state: Floats) -> None:
    """A new satellite's states are not known yet: their error is minus their true value, drawn from the prior.

    Args:
        started: whether each slot holds a new satellite, (S,).
        sigma: prior of the five states of a satellite, (5,).
        normals: of the epoch, (n,).
        state: the true error, (n,), in place.
    """
    for s in range(started.shape[0]):
        if started[s]:
            for a in range(PER_SATELLITE):
                place = NUM_COMMON + PER_SATELLITE * s + a
                state[place] = sigma[a] * normals[place]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def drift_biases(decay: Floats, noise: Floats, true_bias: Floats) -> None:
    """Carry the true biases (6,), in place, over an epoch; decay (n,) and noise w (n,)."""
    for a in range(true_bias.shape[0]):
        true_bias[a] = decay[NUM_NAVIGATION + a] * true_bias[a] + noise[NUM_NAVIGATION + a]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def carry_error(run: int, steps: ErrorSteps, errors: ErrorRuns, auxiliary: Floats, work: ErrorWork) -> int:
    """Carry one run to its next epoch; returns the epoch.

    Args:
        run: which.
        steps: of all epochs.
        errors: of all runs; the run's are carried in place.
        auxiliary: the unaided solution minus the filter's, (N, 15), in place; (N, 0) if it stays.
        work: overwritten.
    """
    errors.epoch[run] += 1
    k = errors.epoch[run]
    state, normals, noise = errors.state[run], errors.normals[run, k], work.noise
    draw_process_noise(k, steps, normals, noise)
    tight_filter.predict_error(
        steps.transition_columns[k], steps.decay, steps.intervals[k], noise, state, work.navigation
    )
    drift_biases(steps.decay, noise, errors.true_bias[run])
    start_satellites(steps.started[k], steps.satellite_sigma, normals, state)
    if auxiliary.shape[1] > 0:
        kalman.predict_error(steps.transition_columns[k], work.nothing, auxiliary[run], work.navigation)
        decay_biases(steps.decay, auxiliary[run])
    return k


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def decay_biases(decay: Floats, auxiliary: Floats) -> None:
    """Let the biases of the unaided solution minus the filter's, (15,), in place, decay over an epoch; decay (n,)."""
    for i in range(NUM_NAVIGATION, auxiliary.shape[0]):
        auxiliary[i] *= decay[i]
