"""What a bank of hypotheses expects of every solution that a defender can choose, and what it makes of the spoofer."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation.error_model import NUM_INERTIAL
from spoofgym.responses.hypotheses import CLEAN, RATE, Bank, BankModel
from spoofgym.responses.solutions import MOMENTS, NO_LIMIT, SEEN, Solutions, loss_at, position, weigh_positions

USED = 0
"""Place of the solution that uses the present fix; behind it stand those that leave it out, a depth each."""


class Appraisal(NamedTuple):
    """Of N runs; C solutions: with the present fix, then without the fixes of so many epochs, a depth each.

    Attributes:
        error: expected horizontal error of each solution, now and ahead, (N, C, 2), m.
        place: unaided solution minus each, horizontal position now and ahead, (N, C, 4), m.
        pulled: probability of a pull, (N,).
        disturbed: probability of multipath, (N,).
        pull: expected pull of the fix, east and north, (N, 2), m.
        rate: its expected rate, (N, 2), m/s.
        spread: 1 sigma of the position by all hypotheses together, (N,), m.
    """

    error: Floats
    place: Floats
    pulled: Floats
    disturbed: Floats
    pull: Floats
    rate: Floats
    spread: Floats


def blank_appraisal(num_runs: int, depths: int) -> Appraisal:
    """One of ``num_runs`` runs that can go back to so many ``depths``."""
    return Appraisal(
        np.zeros((num_runs, depths + 1, MOMENTS)),
        np.zeros((num_runs, depths + 1, SEEN)),
        np.zeros(num_runs),
        np.zeros(num_runs),
        np.zeros((num_runs, 2)),
        np.zeros((num_runs, 2)),
        np.zeros(num_runs),
    )


class Sight(NamedTuple):
    """Through what the bank is looked at.

    Attributes:
        epoch: of all runs, (N,).
        available: whether there is a fix, (N,).
        rows: of `look_ahead`, (K+1, 4, 15).
        depths: epochs to take back, (D,).
    """

    epoch: Runs
    available: Flags
    rows: Floats
    depths: Runs


@njit(cache=True, nogil=True, error_model="numpy")
def appraise(
    runs: Runs, sight: Sight, model: BankModel, bank: Bank, solutions: Solutions, appraisal: Appraisal
) -> None:
    """Appraise the solutions of runs.

    Where there is no fix, the solution that uses it is the filter's. A depth beyond what the run can take back is its
    deepest.

    Args:
        runs: which, (n,).
        sight: of all runs.
        model: of the hypotheses.
        bank: the hypotheses.
        solutions: those that can be chosen.
        appraisal: filled.
    """
    hypotheses = bank.log_weight.shape[1]
    weight, means, variances = np.empty(hypotheses), np.empty((hypotheses, SEEN)), np.empty((hypotheses, MOMENTS))
    used = np.empty(NUM_INERTIAL)
    for run in runs:
        looked = sight.rows[sight.epoch[run]]
        weigh_positions(looked, run, bank, weight, means, variances)
        for j in range(NUM_INERTIAL):
            used[j] = solutions.filter[run, j]
            if sight.available[run]:
                used[j] += solutions.correction[run, j]
        place, error = appraisal.place[run], appraisal.error[run]
        position(looked, used, place[USED])
        deepest = min(solutions.reach[run], solutions.past.shape[1] - 1)
        for d in range(len(sight.depths)):
            position(looked, solutions.past[run, min(sight.depths[d], deepest)], place[d + 1])
        for c in range(len(place)):
            for moment in range(MOMENTS):
                error[c, moment] = loss_at(moment, weight, means, variances, place[c], NO_LIMIT)
        _suppose(run, sight.epoch[run], weight, model, bank, appraisal)
        appraisal.spread[run] = _spread(weight, means, variances)


@njit(cache=True, nogil=True, error_model="numpy")
def _suppose(run: int, epoch: int, weight: Floats, model: BankModel, bank: Bank, appraisal: Appraisal) -> None:
    """Fill what the hypotheses of a run say of the spoofer and of multipath."""
    pulled, disturbed = 0.0, 0.0
    appraisal.pull[run], appraisal.rate[run] = 0.0, 0.0
    for h in range(len(weight)):
        if weight[h] == 0.0:
            continue
        disturbed += weight[h] * bank.disturbed[run, h]
        if bank.kind[run, h] == CLEAN:
            continue
        pulled += weight[h]
        observation, mean = model.observation[epoch, bank.kind[run, h] + 1], bank.mean[run, h]
        for axis in range(2):
            for j in range(NUM_INERTIAL, RATE):
                # the fix is subtracted in a residual, so the pull enters it with a minus
                appraisal.pull[run, axis] -= weight[h] * observation[axis, j] * mean[j]
            appraisal.rate[run, axis] += weight[h] * mean[RATE + axis]
    appraisal.pulled[run], appraisal.disturbed[run] = min(pulled, 1.0), min(disturbed, 1.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _spread(weight: Floats, means: Floats, variances: Floats) -> float:
    """1 sigma of the horizontal position now, by all hypotheses together, m."""
    east, north, square = 0.0, 0.0, 0.0
    for h in range(len(weight)):
        if weight[h] > 0.0:
            east += weight[h] * means[h, 0]
            north += weight[h] * means[h, 1]
            square += weight[h] * (means[h, 0] ** 2 + means[h, 1] ** 2 + variances[h, 0])
    return float(np.sqrt(max(square - east * east - north * north, 0.0)))
