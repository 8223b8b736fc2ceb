"""A bank of hypotheses about the spoofer: since when the fixes have been pulled, how, and whether it is over.

Each hypothesis is a Kalman filter over 21 states: the fifteen errors of the unaided inertial solution, and offset, rate
and acceleration, in east and north, of the pull that the spoofer adds to the fixes. Without spoofing the pull is
exactly zero. Its rate walks randomly, so that ramps, jumps, curves and returns are all within the model. A hidden pull
is another one: a mixture of the two attacks that move the position most per unit of noncentrality. In every epoch

- a hypothesis without a pull may begin one, of each of several kinds, with a small probability;
- a hypothesis with a pull may end it: the pull becomes zero, and what was inferred of the errors stays;
- or the pull may turn to a rate that is unknown again;
- multipath may begin or end, which adds noise to the fixes;
- every hypothesis is weighted by the likelihood of the fix, and the heaviest are kept.

This is multiple-hypothesis tracking (Reid 1979; Blackman 2004) of a spoofer instead of a target. The unaided solution
never depends on what the defender decides, so the bank is the same for every decision.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.error_model import NUM_INERTIAL
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.mean_maps import quiet_offsets

OFFSET = NUM_INERTIAL
"""First state of the pull's offset, east; then north."""
RATE = NUM_INERTIAL + 2
"""First state of the pull's rate, east; then north."""
ACCELERATION = NUM_INERTIAL + 4
"""First state of the pull's acceleration, east; then north."""
NUM_STATES = NUM_INERTIAL + 6
CLEAN = -1
"""Kind of a hypothesis without a pull."""
LOG_2PI = float(np.log(2.0 * np.pi))


class PullKinds(NamedTuple):
    """How a spoofer is expected to pull; leading axis: kinds of pulls.

    Attributes:
        offset: 1 sigma of the offset at the onset, per axis, (T,), m.
        rate: 1 sigma of the rate at the onset, per axis, (T,), m/s.
        acceleration: 1 sigma of the acceleration at the onset, per axis, (T,), m/s².
        walk: 1 sigma by which the rate changes in a second, per axis, (T,), m/s.
        begin: logarithm of the probability that a pull of this kind begins in an epoch, (T,).
        hidden: probability that a pull of the last kind has begun with the game.
        none: logarithm of the probability that no pull begins.
        end: logarithm of the probability that a pull ends in an epoch, (T,).
        turn: logarithm of the probability that it turns to a rate that is unknown again, (T,).
        last: logarithm of the probability that it goes on, (T,).
        disturbance: logarithms of the probabilities that multipath begins in an epoch, and that it ends, (2,).
        undisturbed: logarithms of the probabilities that it does not begin, and that it does not end, (2,).
    """

    offset: Floats
    rate: Floats
    acceleration: Floats
    walk: Floats
    begin: Floats
    hidden: float
    none: float
    end: Floats
    turn: Floats
    last: Floats
    disturbance: Floats
    undisturbed: Floats


class BankModel(NamedTuple):
    """The filter that every hypothesis runs; leading axis: epochs 0..K.

    Attributes:
        transition: Φ of the inertial errors, (K+1, 15, 15).
        process_noise: Q by kind of hypothesis, clean first, (K+1, T+1, 21, 21).
        observation: H on all states by kind of hypothesis, clean first, (K+1, T+1, m, 21).
        noise: R without and with multipath, (2, m, m).
        interval: between epochs, s.
    """

    transition: Floats
    process_noise: Floats
    observation: Floats
    noise: Floats
    interval: float


class Bank(NamedTuple):
    """The hypotheses of N runs, M each.

    Attributes:
        mean: of the states, (N, M, 21).
        covariance: of the states, (N, M, 21, 21).
        log_weight: logarithm of the posterior probability, (N, M); -inf where a place is empty.
        kind: of the pull, (N, M); -1 = there is none.
        disturbed: 1 where multipath disturbs the fixes, else 0, (N, M).
    """

    mean: Floats
    covariance: Floats
    log_weight: Floats
    kind: Runs
    disturbed: Runs


def bank_model(model: LinearModel, kinds: PullKinds, multipath: float) -> BankModel:
    """The filter of the hypotheses on a game.

    The states of a hidden pull, the last kind, are the amplitudes of the two attacks of `quiet_offsets`, which stand
    in the place of its offset.

    Args:
        model: the linear model of the game.
        kinds: of the pulls.
        multipath: 1 sigma that it adds to each axis of the position, m.

    Raises:
        ValueError: pulls may be hidden, and the fixes are not a position alone.
    """
    epochs, m, branches = len(model.time), model.dimension, len(kinds.walk) + 1
    interval = float(model.time[1] - model.time[0])
    process_noise = np.zeros((epochs, branches, NUM_STATES, NUM_STATES))
    process_noise[:, :, :NUM_INERTIAL, :NUM_INERTIAL] = model.process_noise[:, None]
    for kind, walk in enumerate(kinds.walk, start=1):
        for axis in (0, 1):
            offset, rate = OFFSET + axis, RATE + axis
            process_noise[:, kind, rate, rate] = walk**2 * interval
            process_noise[:, kind, offset, offset] = walk**2 * interval**3 / 3.0
            process_noise[:, kind, [offset, rate], [rate, offset]] = walk**2 * interval**2 / 2.0
    observation = np.zeros((epochs, branches, m, NUM_STATES))
    observation[:, :, :, : model.observation.shape[2]] = model.observation[:, None]
    observation[:, :-1, [0, 1], [OFFSET, OFFSET + 1]] = -1.0
    if m > 3:  # the receiver gives its velocity, too: that of a consistent spoofer
        observation[:, :-1, [3, 4], [RATE, RATE + 1]] = -1.0
    if kinds.hidden > 0.0:
        observation[:, -1, :2, OFFSET:RATE] = -quiet_offsets(model, 2)
    transition = np.ascontiguousarray(model.transition)
    calm = model.measurement_covariance
    noise = np.stack([calm, calm + multipath**2 * np.diag(np.arange(m) < 3)])
    return BankModel(transition, process_noise, observation, noise, interval)


def empty_bank(num_runs: int, hypotheses: int) -> Bank:
    """A bank without hypotheses."""
    return Bank(
        np.zeros((num_runs, hypotheses, NUM_STATES)),
        np.zeros((num_runs, hypotheses, NUM_STATES, NUM_STATES)),
        np.full((num_runs, hypotheses), -np.inf),
        np.full((num_runs, hypotheses), CLEAN),
        np.zeros((num_runs, hypotheses), dtype=np.int64),
    )


def start(bank: Bank, runs: Runs, prior_covariance: Floats, kinds: PullKinds) -> None:
    """Let runs begin anew: the unaided solution is the filter's, and either nobody pulls, or a hidden pull begins.

    Args:
        bank: of all runs, in place.
        runs: which, (n,).
        prior_covariance: the filter's P before epoch 0, (15, 15).
        kinds: of the pulls, of which the last is the hidden one.
    """
    hidden = len(kinds.walk) - 1
    bank.mean[runs] = 0.0
    bank.covariance[runs] = 0.0
    bank.covariance[runs, :2, :NUM_INERTIAL, :NUM_INERTIAL] = prior_covariance
    for first, sigmas in ((OFFSET, kinds.offset), (RATE, kinds.rate), (ACCELERATION, kinds.acceleration)):
        for state in (first, first + 1):
            bank.covariance[runs, 1, state, state] = sigmas[hidden] ** 2
    bank.log_weight[runs] = -np.inf
    bank.log_weight[runs, 0] = np.log1p(-kinds.hidden)
    if kinds.hidden > 0.0:
        bank.log_weight[runs, 1] = np.log(kinds.hidden)
    bank.kind[runs] = CLEAN
    bank.kind[runs, 1] = hidden
    bank.disturbed[runs] = 0


@njit(cache=True, nogil=True, error_model="numpy")
def predict(kind: int, epoch: int, model: BankModel, mean: Floats, covariance: Floats, work: Floats) -> None:
    """Carry a hypothesis to an epoch: x <- F x, P <- F P F' + Q; work (9, 21)."""
    transition = model.transition[epoch]
    kalman.predict_mean(transition, mean, work[0])
    if kind != CLEAN:
        _move_pull(model.interval, mean, covariance)
    kalman.predict_covariance(transition, model.process_noise[epoch, kind + 1], covariance, work)


@njit(cache=True, nogil=True, error_model="numpy")
def _move_pull(t: float, mean: Floats, covariance: Floats) -> None:
    """The offset grows by its rate and acceleration over t seconds, the rate by the acceleration."""
    half = 0.5 * t * t
    for o in range(OFFSET, OFFSET + 2):
        r, a = o + 2, o + 4
        mean[o] += t * mean[r] + half * mean[a]
        mean[r] += t * mean[a]
        for j in range(NUM_STATES):
            covariance[o, j] += t * covariance[r, j] + half * covariance[a, j]
            covariance[r, j] += t * covariance[a, j]
        for j in range(NUM_STATES):
            covariance[j, o] += t * covariance[j, r] + half * covariance[j, a]
            covariance[j, r] += t * covariance[j, a]


@njit(cache=True, nogil=True, error_model="numpy")
def begin_pull(kind: int, kinds: PullKinds, covariance: Floats) -> None:
    """Give a hypothesis without a pull one whose offset and rate are unknown."""
    for axis in range(2):
        covariance[OFFSET + axis, OFFSET + axis] = kinds.offset[kind] ** 2
        covariance[RATE + axis, RATE + axis] = kinds.rate[kind] ** 2
        covariance[ACCELERATION + axis, ACCELERATION + axis] = kinds.acceleration[kind] ** 2


@njit(cache=True, nogil=True, error_model="numpy")
def turn_pull(kinds: PullKinds, covariance: Floats) -> None:
    """Let the rate of a pull be changed by as much as the widest kind begins with."""
    widest = kinds.rate.max()
    for axis in range(2):
        covariance[RATE + axis, RATE + axis] += widest**2


@njit(cache=True, nogil=True, error_model="numpy")
def end_pull(mean: Floats, covariance: Floats) -> None:
    """Let the pull of a hypothesis be zero, whatever it was."""
    for i in range(OFFSET, NUM_STATES):
        mean[i] = 0.0
        for j in range(NUM_STATES):
            covariance[i, j] = 0.0
            covariance[j, i] = 0.0
