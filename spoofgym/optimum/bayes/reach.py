"""The solutions of the vehicle's own filter that a defender reaches who uses fixes, leaves them out or takes them back.

All are told by what lies between them and the unaided inertial solution. Decisions do not touch that one and both meet
the same inertial noise, so the filter's own equations carry the difference.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.loose.innovation import form_innovation
from spoofgym.optimum.bayes.follow import POSITION
from spoofgym.optimum.bayes.median import Rice, expected_distance


class Victim(NamedTuple):
    """What the vehicle's filter believes; leading axis: epochs 0..K.

    Attributes:
        transition: Φ, (K+1, 15, 15).
        process_noise: Q, (K+1, 15, 15).
        observation: H, (K+1, 3, 9).
        fix_noise: R, (3, 3).
    """

    transition: Floats
    process_noise: Floats
    observation: Floats
    fix_noise: Floats


class Solutions(NamedTuple):
    """Some solutions.

    Attributes:
        moved: filter minus unaided solution, (C, 15).
        covariance: what the filter believes, (C, 15, 15).
    """

    moved: Floats
    covariance: Floats


class View(NamedTuple):
    """The posterior of the unaided solution's horizontal error, now and a while later.

    Attributes:
        parts: mixture of what the estimate misses, (2, M, 4), as in `Room`.
        estimate: the error that the filter finds that takes every fix for true, (2, 2), m.
        rows: from an error now to the horizontal one later, (2, n).
    """

    parts: Floats
    estimate: Floats
    rows: Floats


@njit(cache=True, nogil=True, error_model="numpy")
def coast(epoch: int, victim: Victim, solutions: Solutions, count: int) -> None:
    """Carry the first solutions to an epoch."""
    work, product = np.empty(9), np.empty((9, solutions.moved.shape[1]))
    for i in range(count):
        kalman.predict_mean(victim.transition[epoch], solutions.moved[i], work)
        kalman.predict_covariance(
            victim.transition[epoch], victim.process_noise[epoch], solutions.covariance[i], product
        )


@njit(cache=True, nogil=True, error_model="numpy")
def use(epoch: int, residual: Floats, victim: Victim, solutions: Solutions, source: int, target: int) -> None:
    """Let a solution use the fix, in another place.

    Args:
        epoch: of the fix.
        residual: innovation of the unaided solution, (3,), m.
        victim: what the filter believes.
        solutions: in place.
        source: the solution.
        target: its place afterwards.
    """
    n, m = solutions.moved.shape[1], len(residual)
    moved, covariance, observed = solutions.moved[target], solutions.covariance[target], victim.observation[epoch]
    moved[:], covariance[:] = solutions.moved[source], solutions.covariance[source]
    own, whitened, innovation = residual.copy(), np.empty(m), np.empty((m, m))
    gain, cross, factor = np.empty((m, n)), np.empty((m, n)), np.empty((m, m))
    for a in range(m):
        for j in range(observed.shape[1]):
            own[a] += observed[a, j] * moved[j]
    form_innovation(covariance, observed, victim.fix_noise, 1.0, innovation, gain, cross, factor)
    kalman.whiten(factor, own, whitened)
    kalman.correct_error(gain, whitened, moved)
    kalman.update_covariance(gain, covariance)


@njit(cache=True, nogil=True, error_model="numpy")
def error_now(view: View, moved: Floats, tables: Rice) -> float:
    """Expected horizontal error of a solution, m."""
    x, y = -moved[POSITION] - view.estimate[0, 0], -moved[POSITION + 1] - view.estimate[0, 1]
    return expected_distance(view.parts[0], x, y, tables)


@njit(cache=True, nogil=True, error_model="numpy")
def error_later(view: View, moved: Floats, tables: Rice) -> float:
    """Expected horizontal error that it has a while later, if it uses no fix until then, m."""
    x, y = -view.estimate[1, 0], -view.estimate[1, 1]
    for j in range(len(moved)):
        x -= view.rows[0, j] * moved[j]
        y -= view.rows[1, j] * moved[j]
    return expected_distance(view.parts[1], x, y, tables)


@njit(cache=True, nogil=True, error_model="numpy")
def choose(view: View, solutions: Solutions, count: int, tables: Rice) -> int:
    """The one whose expected error, mean of now and later, is least; of equal ones the first."""
    best, least = 0, np.inf
    for i in range(count):
        error = error_now(view, solutions.moved[i], tables) + error_later(view, solutions.moved[i], tables)
        if error < least - 1e-9:
            best, least = i, error
    return best


@njit(cache=True, nogil=True, error_model="numpy")
def split(
    epoch: int, residual: Floats, available: bool, victim: Victim, solutions: Solutions, costs: Floats, count: int
) -> int:
    """Every solution without the fix, and each with it behind them; how many there are then.

    Args:
        epoch: of the fix.
        residual: innovation of the unaided solution, (3,), m.
        available: whether there is a fix.
        victim: what the filter believes.
        solutions: in place.
        costs: what each has cost so far, (C,), in place.
        count: how many there are.
    """
    if not available:
        return count
    for i in range(count):
        use(epoch, residual, victim, solutions, i, count + i)
        costs[count + i] = costs[i]
    return 2 * count


@njit(cache=True, nogil=True, error_model="numpy")
def charge(view: View, solutions: Solutions, costs: Floats, count: int, tables: Rice) -> None:
    """Add what each solution costs now, m."""
    for i in range(count):
        costs[i] += error_now(view, solutions.moved[i], tables)
