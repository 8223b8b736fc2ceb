"""The kernels of the tightly coupled filter in the strapdown fidelity: loops over runs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.geodesy import ecef
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.batch import Weights
from spoofgym.navigation.divergence import Solution, solution_of
from spoofgym.navigation.error_model import NUM_NAVIGATION
from spoofgym.navigation.history import Ring, keep
from spoofgym.navigation.loose.innovation import FilterRuns
from spoofgym.navigation.loose.kernels import (
    NUM_EPOCH_NOISES,
    NUM_SAMPLE_NOISES,
    StrapdownSteps,
    disturb_position,
    feed_back,
    mechanize_part,
)
from spoofgym.navigation.tight import kalman as tight_filter
from spoofgym.navigation.tight.kalman import FilterSteps, RangeInnovations, Ranges
from spoofgym.navigation.tight.states import CLOCK, NUM_INERTIAL
from spoofgym.navigation.tight.truth import (
    ErrorRuns,
    ErrorSteps,
    decay_biases,
    draw_process_noise,
    drift_biases,
    start_satellites,
)


class Vehicles(NamedTuple):
    """The arrays of `TightStrapdownNavigator` that its kernels carry.

    Attributes:
        errors: epoch, true biases, and the error of the states beside the inertial ones, whose normals are those of the
            ranges.
        solution: inertial, of all runs.
        fix: room for the state that `mechanize_part` keeps for a fix of position, (N, 6, 3); not read.
        normals: noise of the samples of B epochs in a ring, (N, B, W), W = 6 samples + 9 of the epoch; W = 0 where the
            samples have errors of their own.
    """

    errors: ErrorRuns
    solution: Solution
    fix: Floats
    normals: Floats


class Sky(NamedTuple):
    """What predicted ranges are compared with.

    Attributes:
        satellites: their positions, (K+1, S, 3), ECEF at the time of reception, m.
        distance: from the true position, (K+1, S), m.
        true_velocity: ENU, (K+1, 3), m/s.
    """

    satellites: Floats
    distance: Floats
    true_velocity: Floats


class CarryWork(NamedTuple):
    """Memory to carry one run of n states over an epoch.

    Attributes:
        mean_force: (3,).
        residual_bias: (6,).
        navigation: (9,).
        transition: first nine rows of Φ over a part of the epoch, (9, 15).
        product: (9, n).
        half_noise: half of Q of the navigation states over the part, (9, 9), diagonal.
        noise: of all states, (n,).
    """

    mean_force: Floats
    residual_bias: Floats
    navigation: Floats
    transition: Floats
    product: Floats
    half_noise: Floats
    noise: Floats


class Held(NamedTuple):
    """Φ and Q that leave the states beside those of the navigation as they are; ``columns`` (15, 9) carry nothing."""

    decay: Floats
    variance: Floats
    clock_noise: Floats
    columns: Floats


@njit(cache=True, nogil=True, inline="always")
def _carry_work(n: int) -> CarryWork:
    return CarryWork(
        np.empty(3),
        np.empty(6),
        np.empty(NUM_NAVIGATION),
        np.empty((NUM_NAVIGATION, NUM_INERTIAL)),
        np.empty((NUM_NAVIGATION, n)),
        np.zeros((NUM_NAVIGATION, NUM_NAVIGATION)),
        np.empty(n),
    )


@njit(cache=True, nogil=True)
def carry(
    runs: Runs,
    epochs: Runs,
    motion: StrapdownSteps,
    steps: FilterSteps,
    error_steps: ErrorSteps,
    vehicles: Vehicles,
    ring: Ring,
    auxiliary: Floats,
) -> None:
    """Carry runs over so many epochs each: mechanization, the other states, covariance.

    The states are kept before every epoch. The unaided solution minus the filter's, auxiliary (N, 15), is carried by
    the same Φ, or is none, (N, 0).
    """
    # named tuples are taken apart here: in the loop that would cost more than the equations
    errors, inertial, fix, normals = vehicles
    epoch, true_bias, true_noise, decay = errors.epoch, errors.true_bias, motion.samples.true_noise, steps.decay
    all_covariance, remembers = ring.covariance, ring.past_covariance.shape[1] > 0
    n = errors.state.shape[1]
    work = _carry_work(n)
    residual_bias = work.residual_bias
    held = Held(np.ones(n), np.zeros(n), np.zeros((2, 2)), np.zeros((NUM_INERTIAL, NUM_NAVIGATION)))
    noisy = normals.shape[2] > 0
    last = normals.shape[2] - NUM_EPOCH_NOISES
    for run in runs:
        solution, covariance = solution_of(run, inertial), all_covariance[run]
        for _ in range(epochs[run]):
            epoch[run] += 1
            k = epoch[run]
            if remembers:
                keep(run, k, ring)
            drawn = normals[run, k % normals.shape[1]]
            for a in range(6):
                residual_bias[a] = true_bias[run, a] - solution.bias[a]
            vehicle = (solution, fix[run], drawn)
            interval = _mechanize(k, motion, steps, held, vehicle, covariance, auxiliary[run], work)
            if noisy:
                disturb_position(solution.position, true_noise, np.sqrt(interval), drawn[last:])
            _carry_others(run, k, steps, error_steps, vehicles, covariance, held, work)
            if auxiliary.shape[1] > 0:
                decay_biases(decay, auxiliary[run])


@njit(cache=True, nogil=True, inline="always")
def _mechanize(
    k: int,
    motion: StrapdownSteps,
    steps: FilterSteps,
    held: Held,
    vehicle: tuple[Solution, Floats, Floats],
    covariance: Floats,
    auxiliary: Floats,
    work: CarryWork,
) -> float:
    """Mechanize the samples that lead to epoch k part by part, and carry P; the noise half before, half after Φ.

    The other states are held until the last part.

    Args:
        k: the epoch.
        motion: the samples.
        steps: of the filter.
        held: Φ and Q of the other states before the last part.
        vehicle: solution of the run, its fix (6, 3), both in place, and the normals of its samples.
        covariance: P, (n, n), in place.
        auxiliary: (15,) or (0,), in place.
        work: overwritten; holds what is left of the biases.

    Returns:
        The time from the epoch before, s.
    """
    solution, fix, drawn = vehicle
    samples, bounds, density = motion.samples, motion.bounds, motion.filter_density
    mean_force, residual_bias, navigation, transition, product, half_noise, _ = work
    begin, end = motion.places[k], motion.places[k + 1]
    # a variable, because numba compiles `mechanize_part` again for a constant
    start, nowhere, interval = bounds[begin], bounds[0] - 1, 0.0
    for part in range(begin, end):
        first = bounds[part]
        length = mechanize_part(
            (first, bounds[part + 1], nowhere),
            residual_bias,
            drawn[NUM_SAMPLE_NOISES * (first - start) :],
            samples,
            solution,
            fix,
            mean_force,
            transition,
        )
        for i in range(NUM_NAVIGATION):
            half_noise[i, i] = 0.5 * length * density[i]
            covariance[i, i] += half_noise[i, i]
        if part == end - 1:
            tight_filter.predict_covariance(
                transition,
                half_noise,
                steps.decay,
                steps.variance,
                steps.clock_noise,
                steps.intervals[k],
                covariance,
                product,
            )
        else:
            tight_filter.predict_covariance(
                transition, half_noise, held.decay, held.variance, held.clock_noise, 0.0, covariance, product
            )
        if auxiliary.shape[0] > 0:
            kalman.predict_mean(transition, auxiliary, navigation)
        interval += length
    return interval


@njit(cache=True, nogil=True, inline="always")
def _carry_others(
    run: int,
    k: int,
    steps: FilterSteps,
    error_steps: ErrorSteps,
    vehicles: Vehicles,
    covariance: Floats,
    held: Held,
    work: CarryWork,
) -> None:
    """Carry the biases and the states beside the inertial ones to epoch k; new satellites forget the old ones."""
    errors, bias = vehicles.errors, vehicles.solution.bias[run]
    state, normals, noise = errors.state[run], errors.normals[run, k], work.noise
    draw_process_noise(k, error_steps, normals, noise)
    drift_biases(steps.decay, noise, errors.true_bias[run])
    for a in range(6):
        bias[a] *= steps.decay[NUM_NAVIGATION + a]
    noise[:NUM_INERTIAL] = 0.0
    tight_filter.predict_error(held.columns, steps.decay, steps.intervals[k], noise, state, work.navigation)
    start_satellites(steps.started[k], steps.satellite_sigma, normals, state)
    covariance[CLOCK, CLOCK] += steps.clock_jump[k]
    tight_filter.start_satellites(steps.started[k], steps.satellite_sigma, covariance)


@njit(cache=True, nogil=True)
def innovate(
    places: Runs,
    runs: Runs,
    sky: Sky,
    ranges: Ranges,
    weights: Weights,
    vehicles: Vehicles,
    filters: FilterRuns,
    formed: RangeInnovations,
) -> None:
    """Innovation of runs, predicted minus measured; outputs, except the gain, stand at the places of the runs."""
    epoch, state, inertial = vehicles.errors.epoch, vehicles.errors.state, vehicles.solution
    columns, values, residuals = ranges.columns, ranges.values, formed.residual
    covariance, gain, deviation, _ = filters
    work = tight_filter.workspace(ranges, state.shape[1])
    for place in places:
        run = runs[place]
        k, residual = epoch[run], residuals[place]
        tight_filter.observe(columns, values[k], state[run], deviation[run], residual)
        _add_geometry(k, sky, ranges, solution_of(run, inertial), residual)
        tight_filter.form_innovation(place, k, ranges, weights, covariance[run], gain[run], formed, work)


@njit(cache=True, nogil=True, inline="always")
def _add_geometry(k: int, sky: Sky, ranges: Ranges, solution: Solution, residual: Floats) -> None:
    """Add what errors of the inertial solution make of the predicted ranges, (m,): distances, or range rates."""
    slots, position = sky.satellites.shape[1], solution.position
    x, y, z = ecef(position[0], position[1], position[2])
    for a in range(residual.shape[0]):
        s = a % slots
        if ranges.values[k, a, 3] == 0.0:
            continue
        if ranges.columns[a, 0] == tight_filter.FIRST_POSITION:
            dx, dy, dz = sky.satellites[k, s, 0] - x, sky.satellites[k, s, 1] - y, sky.satellites[k, s, 2] - z
            residual[a] += np.sqrt(dx * dx + dy * dy + dz * dz) - sky.distance[k, s]
        else:
            for c in range(3):
                residual[a] += ranges.values[k, a, c] * (solution.velocity[c] - sky.true_velocity[k, c])


@njit(cache=True, nogil=True)
def correct(runs: Runs, solution: Solution, state: Floats, filters: FilterRuns) -> None:
    """Add the correction -U w, minus the estimated error; P <- P - U U'."""
    covariance, gain, _, whitened = filters
    correction = np.empty(state.shape[1])
    for run in runs:
        correction[:] = 0.0
        tight_filter.correct_error(gain[run], whitened[run], correction)
        feed_back(correction, solution_of(run, solution))
        for i in range(NUM_INERTIAL, state.shape[1]):
            state[run, i] += correction[i]
        tight_filter.update_covariance(gain[run], covariance[run])
