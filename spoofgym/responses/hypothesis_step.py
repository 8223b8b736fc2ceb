"""One epoch of a bank of hypotheses: carry each, branch, weight by the fix, keep the heaviest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.responses.hypotheses import (
    CLEAN,
    LOG_2PI,
    NUM_STATES,
    Bank,
    BankModel,
    PullKinds,
    begin_pull,
    end_pull,
    predict,
    turn_pull,
)

STAY = -2
"""A branch on which a hypothesis goes on as it is; else a branch is the kind of the pull from now on."""
TURN = -3
"""A branch on which the pull of a hypothesis turns."""
TOGGLE = -4
"""A branch on which multipath begins or ends."""


class Branches(NamedTuple):
    """Ways on from the hypotheses of one run.

    Attributes:
        parent: index of the hypothesis, (B,).
        way: `STAY`, `TURN`, `TOGGLE`, `CLEAN` where a pull ends, or the kind of the pull that begins, (B,).
        log_weight: (B,).
    """

    parent: Runs
    way: Runs
    log_weight: Floats


class Scratch(NamedTuple):
    """Work arrays of one run.

    Attributes:
        mean, covariance, kind, disturbed: of the new hypotheses, (M, 21), (M, 21, 21), (M,), (M,).
        trial_mean, trial: of one branch, (21,), (21, 21).
        work: (9, 21).
        cross, innovation, factor, gain: (m, 21), (m, m), (m, m), (m, 21).
        residual, whitened: (m,).
    """

    mean: Floats
    covariance: Floats
    kind: Runs
    disturbed: Runs
    trial_mean: Floats
    trial: Floats
    work: Floats
    cross: Floats
    innovation: Floats
    factor: Floats
    gain: Floats
    residual: Floats
    whitened: Floats


@njit(cache=True, nogil=True, error_model="numpy")
def _scratch(hypotheses: int, m: int) -> Scratch:
    return Scratch(
        np.empty((hypotheses, NUM_STATES)),
        np.empty((hypotheses, NUM_STATES, NUM_STATES)),
        np.empty(hypotheses, dtype=np.int64),
        np.empty(hypotheses, dtype=np.int64),
        np.empty(NUM_STATES),
        np.empty((NUM_STATES, NUM_STATES)),
        np.empty((9, NUM_STATES)),
        np.empty((m, NUM_STATES)),
        np.empty((m, m)),
        np.empty((m, m)),
        np.empty((m, NUM_STATES)),
        np.empty(m),
        np.empty(m),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _copy(mean: Floats, covariance: Floats, to_mean: Floats, to_covariance: Floats) -> None:
    for i in range(NUM_STATES):
        to_mean[i] = mean[i]
        for j in range(NUM_STATES):
            to_covariance[i, j] = covariance[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def _weigh(epoch: int, kind: int, disturbed: int, fix: Floats, model: BankModel, scratch: Scratch) -> float:
    """Logarithm of the likelihood of a fix under the scratch's trial; leaves its innovation in the scratch.

    Args:
        epoch: of the fix.
        kind: of the pull.
        disturbed: 1 = by multipath.
        fix: the unaided solution minus the fix, (m,), m (and m/s).
        model: the filter.
        scratch: holds the trial; work arrays.
    """
    observation, m = model.observation[epoch, kind + 1], len(fix)
    kalman.innovation_covariance(
        scratch.trial, observation, model.noise[disturbed], scratch.cross, scratch.innovation
    )
    kalman.cholesky(scratch.innovation, scratch.factor)
    log_root = 0.0
    for a in range(m):
        predicted = 0.0
        for j in range(NUM_STATES):
            predicted += observation[a, j] * scratch.trial_mean[j]
        # `correct_error` subtracts, so the residual is what the hypothesis expects minus the fix
        scratch.residual[a] = predicted - fix[a]
        log_root += np.log(scratch.factor[a, a])
    nis = kalman.whiten(scratch.factor, scratch.residual, scratch.whitened)
    return -0.5 * nis - log_root - 0.5 * m * LOG_2PI


@njit(cache=True, nogil=True, error_model="numpy")
def _branch(
    parent: int, way: int, bank: Bank, run: int, kinds: PullKinds, scratch: Scratch
) -> tuple[int, int]:
    """The state of a branch before the fix, in the trial; the kind of its pull, and whether it is disturbed."""
    _copy(bank.mean[run, parent], bank.covariance[run, parent], scratch.trial_mean, scratch.trial)
    if way >= 0:
        begin_pull(way, kinds, scratch.trial)
    elif way == CLEAN:
        end_pull(scratch.trial_mean, scratch.trial)
    elif way == TURN:
        turn_pull(kinds, scratch.trial)
    disturbed = bank.disturbed[run, parent]
    return way if way >= CLEAN else bank.kind[run, parent], 1 - disturbed if way == TOGGLE else disturbed


@njit(cache=True, nogil=True, error_model="numpy")
def _add(branches: Branches, count: int, parent: int, way: int, log_weight: float) -> int:
    branches.parent[count], branches.way[count], branches.log_weight[count] = parent, way, log_weight
    return count + 1


@njit(cache=True, nogil=True, error_model="numpy")
def _branch_all(log_weight: Floats, kind: Runs, disturbed: Runs, kinds: PullKinds, branches: Branches) -> int:
    """Every way on, with its prior weight; how many there are."""
    count = 0
    for h in range(len(log_weight)):
        if log_weight[h] == -np.inf:
            continue
        count = _add(branches, count, h, TOGGLE, log_weight[h] + kinds.disturbance[disturbed[h]])
        calm = log_weight[h] + kinds.undisturbed[disturbed[h]]
        if kind[h] == CLEAN:
            count = _add(branches, count, h, STAY, calm + kinds.none)
            for way in range(len(kinds.begin)):
                if kinds.begin[way] == -np.inf:
                    continue
                count = _add(branches, count, h, way, calm + kinds.begin[way])
        else:
            pull = kind[h]
            count = _add(branches, count, h, STAY, calm + kinds.last[pull])
            if kinds.end[pull] > -np.inf:
                count = _add(branches, count, h, CLEAN, calm + kinds.end[pull])
                count = _add(branches, count, h, TURN, calm + kinds.turn[pull])
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _normalise(log_weight: Floats, count: int) -> None:
    """Let the probabilities sum to one."""
    largest = -np.inf
    for h in range(count):
        largest = max(largest, log_weight[h])
    total = 0.0
    for h in range(count):
        total += np.exp(log_weight[h] - largest)
    shift = largest + np.log(total)
    for h in range(len(log_weight)):
        log_weight[h] = log_weight[h] - shift if h < count else -np.inf


@njit(cache=True, nogil=True, error_model="numpy")
def advance(
    runs: Runs, index: Runs, fixes: Floats, available: Flags, model: BankModel, kinds: PullKinds, bank: Bank
) -> None:
    """Carry the hypotheses of runs to their present epoch and let them see its fix.

    Args:
        runs: which, (n,).
        index: their epochs, of all runs, (N,).
        fixes: the unaided solution minus the fix, (N, m), m (and m/s).
        available: whether there is a fix, (N,).
        model: the filter.
        kinds: of the pulls.
        bank: of all runs, in place.
    """
    hypotheses = bank.log_weight.shape[1]
    scratch = _scratch(hypotheses, fixes.shape[1])
    room = hypotheses * (len(kinds.begin) + 4)
    branches = Branches(np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int64), np.empty(room))
    for run in runs:
        epoch, mean, covariance = index[run], bank.mean[run], bank.covariance[run]
        log_weight, kind = bank.log_weight[run], bank.kind[run]
        for h in range(hypotheses):
            if log_weight[h] > -np.inf:
                predict(kind[h], epoch, model, mean[h], covariance[h], scratch.work)
        if not available[run]:
            continue
        count = _branch_all(log_weight, kind, bank.disturbed[run], kinds, branches)
        for b in range(count):
            now, disturbed = _branch(branches.parent[b], branches.way[b], bank, run, kinds, scratch)
            branches.log_weight[b] += _weigh(epoch, now, disturbed, fixes[run], model, scratch)
        order = np.argsort(-branches.log_weight[:count])
        kept = min(count, hypotheses)
        for place in range(kept):
            b = order[place]
            now, disturbed = _branch(branches.parent[b], branches.way[b], bank, run, kinds, scratch)
            _weigh(epoch, now, disturbed, fixes[run], model, scratch)
            kalman.whitened_gain(scratch.cross, scratch.factor, scratch.gain)
            kalman.correct_error(scratch.gain, scratch.whitened, scratch.trial_mean)
            kalman.update_covariance(scratch.gain, scratch.trial)
            _copy(scratch.trial_mean, scratch.trial, scratch.mean[place], scratch.covariance[place])
            scratch.kind[place], scratch.disturbed[place] = now, disturbed
            log_weight[place] = branches.log_weight[b]
        for place in range(kept):
            _copy(scratch.mean[place], scratch.covariance[place], mean[place], covariance[place])
            kind[place], bank.disturbed[run, place] = scratch.kind[place], scratch.disturbed[place]
        _normalise(log_weight, kept)
