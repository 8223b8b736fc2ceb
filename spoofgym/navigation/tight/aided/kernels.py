"""How readings of an aid correct filters on ranges, run by run."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.aids.kernels import Told, form, observe, tell
from spoofgym.navigation.divergence import Solution, solution_of
from spoofgym.navigation.loose.kernels import feed_back
from spoofgym.navigation.tight.states import NUM_INERTIAL


class Reading(NamedTuple):
    """What one aid makes of runs (k,) that it measures.

    Attributes:
        aid: which.
        first_row: of it among the rows of all.
        sigma: of its noise, (r,).
        limit: normalised innovation squared above which a reading is left out.
        residual: what the states of the filter do not tell of it, (k, r).
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


class Unaided(NamedTuple):
    """The solution without GNSS minus the filter's: inertial states (N, 15), and those of the aids, (N, a)."""

    inertial: Floats
    aids: Floats


@njit(cache=True, nogil=True, error_model="numpy")
def use_reading(
    runs: Runs,
    reading: Reading,
    state: Floats,
    all_covariance: Floats,
    told: Told,
    unaided: Unaided,
    corrections: Floats,
) -> None:
    """Let P of runs (k,) take a reading that passes the gate; what it adds to the states, (k, n), is overwritten.

    Args:
        runs: which.
        reading: of the aid.
        state: of all runs, (N, n): errors that enter the residual by H.
        all_covariance: P, (N, n, n), in place.
        told: what the aids have told, in place.
        unaided: in place; (N, 0) where it is not wanted.
        corrections: result; zero where the gate leaves the reading out.
    """
    rows, n = reading.observation.shape[1], state.shape[1]
    cross, factor, gain = np.empty((rows, n)), np.empty((rows, rows)), np.empty((rows, n))
    residual, whitened, apart = np.empty(rows), np.empty(rows), np.empty(rows)
    variance, first = reading.sigma**2, n - unaided.aids.shape[1]
    for place in range(len(runs)):
        run, observation = runs[place], reading.observation[place]
        for a in range(rows):
            residual[a] = reading.residual[place, a] - reading.sigma[a] * reading.normals[place, a]
            apart[a] = 0.0
        observe(observation, state[run], residual)
        form(all_covariance[run], observation, variance, cross, factor, gain)
        used = kalman.whiten(factor, residual, whitened) <= reading.limit
        tell(run, reading.aid, reading.first_row, whitened, used, told)
        corrections[place, :] = 0.0
        if used:
            kalman.correct_error(gain, whitened, corrections[place])
            kalman.update_covariance(gain, all_covariance[run])
            if unaided.inertial.shape[1] > 0:
                observe(observation[:, :NUM_INERTIAL], unaided.inertial[run], apart)
                observe(observation[:, first:], unaided.aids[run], apart)
                kalman.whiten(factor, apart, whitened)
                for a in range(rows):
                    for i in range(NUM_INERTIAL):
                        unaided.inertial[run, i] -= gain[a, i] * whitened[a]
                    for i in range(unaided.aids.shape[1]):
                        unaided.aids[run, i] -= gain[a, first + i] * whitened[a]


@njit(cache=True, nogil=True)
def feed_back_all(runs: Runs, corrections: Floats, solution: Solution, state: Floats) -> None:
    """Correct inertial solutions and the other states (N, n) of runs (k,) by corrections (k, n)."""
    for place in range(len(runs)):
        run = runs[place]
        feed_back(corrections[place], solution_of(run, solution))
        for i in range(NUM_INERTIAL, state.shape[1]):
            state[run, i] += corrections[place, i]


@njit(cache=True, nogil=True, error_model="numpy")
def correct_means(runs: Runs, index: Runs, aided: Floats, prior: Floats) -> None:
    """e <- A e of mean errors (N, n) at the epoch after the present one; A (K+1, n, n), index (N,)."""
    n, work = prior.shape[1], np.empty(prior.shape[1])
    for run in runs:
        k = index[run] + 1
        if k < len(aided):
            for i in range(n):
                work[i] = 0.0
                for j in range(n):
                    work[i] += aided[k, i, j] * prior[run, j]
            for i in range(n):
                prior[run, i] = work[i]
