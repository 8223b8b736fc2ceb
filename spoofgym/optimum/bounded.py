"""The optimum of the spoofer's game under the environment's own limits: its exact value against the snapshot test.

The offset starts at zero and moves by at most drag_off_rate · interval per epoch and axis. With v_k = s_k - s_{k-1} as
unknowns the final error e and the innovations u_k are linear, and

    log-score(v) = log |e(v)| + Σ_k log P(χ²_m(|u_k(v)|²) <= threshold)

is maximised by a truncated Newton method with bounds (Nash 1984; scipy's TNC) with its exact gradient. It agrees with
L-BFGS-B, converges further, and calls no BLAS, whose threads slow L-BFGS-B tenfold on a busy machine. For a fixed
direction of the error the log-score is concave (log of a linear function plus log-concave factors, see `survival`) on a
convex set, so it has one maximum; only the direction can hide others, and therefore the search starts from several.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import OptimizeResult, minimize

from spoofgym.arrays import Floats
from spoofgym.kernels import njit
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.optimum.closed_form import best_budget
from spoofgym.optimum.play import Outcome, expected_play
from spoofgym.optimum.ramp import axis_limits, best_ramp
from spoofgym.optimum.response import azimuth_of, half_circle_sign, increment_maps
from spoofgym.optimum.survival import check_threshold, log_survival_and_slope

START_AZIMUTHS = (0.0, 45.0, 90.0, 135.0)
GRADIENT_TOLERANCE = 1e-6
"""Largest projected gradient of the log-score at a solution, per metre of increment."""


@dataclass(frozen=True)
class BoundedOptimum:
    """The best attack within the limits.

    Attributes:
        score: error times survival, m: the optimum of the game.
        azimuth: direction of the final error, degrees clockwise from north, in [0, 180).
        actions: increments over their limit, (K, 3) in [-1, 1]; the increments themselves, m, on an axis without limit.
        outcome: expected play of the attack.
        projected_gradient: what is left of the gradient, 1/m.
    """

    score: float
    azimuth: float
    actions: Floats
    outcome: Outcome
    projected_gradient: float


class LogScore:
    """The log-score as a function of the increments, and its gradient.

    Attributes:
        innovations: map from the increments to the whitened innovations, (K * m, K * 3).
        error: map from the increments to the final horizontal error, (2, K * 3).
    """

    def __init__(self, model: LinearModel, threshold: float) -> None:
        """Build the maps once.

        Args:
            model: the filter along the scenario.
            threshold: of the snapshot test.
        """
        self.innovations, self.error = increment_maps(model)
        self._columns = np.ascontiguousarray(self.innovations.T)
        self._dimension = model.dimension
        self._threshold = threshold

    def loss(self, increments: Floats) -> tuple[float, Floats]:
        """Minus the log-score, and its gradient.

        Args:
            increments: v, (K * 3,), m ENU.

        Returns:
            the loss (infinite where the error is zero) and its gradient (K * 3,), 1/m.
        """
        error = self.error @ increments
        square = float(error @ error)
        if square == 0.0:
            return np.inf, np.zeros_like(increments)
        whitened = combine(increments, self._columns).reshape(-1, self._dimension)
        value, slope = log_survival_and_slope(np.linalg.norm(whitened, axis=1), self._dimension, self._threshold)
        gradient = error @ self.error / square
        gradient += combine((2.0 * slope[:, None] * whitened).reshape(-1), self.innovations)
        return -0.5 * float(np.log(square)) - float(value.sum()), -gradient


@njit(cache=True, nogil=True)
def combine(weights: Floats, rows: Floats) -> Floats:
    """Sum of weighted rows in index order: the bits do not depend on BLAS, nor the time on its threads.

    Args:
        weights: (n,).
        rows: (n, q).
    """
    total = np.zeros(rows.shape[1])
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            total[j] += weights[i] * rows[i, j]
    return total


def bounded_optimum(model: LinearModel, threshold: float, drag_off_rate: Floats | float | None) -> BoundedOptimum:
    """The best attack whose offset moves by at most ``drag_off_rate`` times the time between epochs, per axis.

    Args:
        model: the filter along the scenario; its times give the intervals.
        threshold: of the snapshot test.
        drag_off_rate: (3,) ENU or one for all axes, m/s; None = no limit.

    Raises:
        ValueError: a threshold or a drag-off rate that is not positive.
        RuntimeError: the best solution is no maximum.
    """
    threshold = check_threshold(threshold)
    rates = axis_limits(drag_off_rate)
    limits = (np.diff(model.time)[:, None] * rates).reshape(-1)
    log_score = LogScore(model, threshold)
    solutions = [_climb(log_score, start, limits) for start in _starts(model, threshold, rates)]
    best = min(solutions, key=lambda solution: solution.fun)
    projected = _projected_gradient(best, limits)
    if not np.isfinite(best.fun) or projected > GRADIENT_TOLERANCE:
        raise RuntimeError(
            f"bounded_optimum did not converge: projected gradient {projected:.2g} per metre after "
            f"{best.nit} iterations ({best.message})"
        )
    increments = half_circle_sign(log_score.error @ best.x) * best.x.reshape(-1, 3)
    outcome = expected_play(model, np.cumsum(increments, axis=0), threshold)
    unit = np.where(np.isfinite(limits), limits, 1.0).reshape(-1, 3)
    return BoundedOptimum(float(outcome.score), azimuth_of(outcome.final_error), increments / unit, outcome, projected)


def _starts(model: LinearModel, threshold: float, limits: Floats) -> list[Floats]:
    """Increments to climb from: the best ramp, ramps in four directions, and the closed form cut to the limits.

    Args:
        model: the filter along the scenario.
        threshold: of the snapshot test.
        limits: largest rate per axis, (3,), m/s.

    Returns:
        (K * 3,) each, m ENU, within the limits.
    """
    ramps = [best_ramp(model, threshold, limits, azimuth) for azimuth in (None, *START_AZIMUTHS)]
    offsets = [ramp.outcome.offsets for ramp in ramps]
    if model.dimension == 3:
        offsets.append(best_budget(model, threshold)[0].offsets)
    step = np.diff(model.time)[:, None] * limits
    return [np.clip(np.diff(offset, axis=0, prepend=np.zeros((1, 3))), -step, step).reshape(-1) for offset in offsets]


def _climb(log_score: LogScore, start: Floats, limits: Floats) -> OptimizeResult:
    """Maximise the log-score from one start within ±limits."""
    return minimize(
        log_score.loss,
        start,
        jac=True,
        method="TNC",
        bounds=np.stack((-limits, limits), axis=1),
        options={"maxfun": 40000, "ftol": 0.0, "xtol": 0.0, "gtol": 0.1 * GRADIENT_TOLERANCE},
    )


def _projected_gradient(solution: OptimizeResult, limits: Floats) -> float:
    """Largest component of the gradient that does not push against a limit, 1/m."""
    step = np.clip(solution.x - solution.jac, -limits, limits) - solution.x
    return float(np.abs(step).max())
