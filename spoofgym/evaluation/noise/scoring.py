"""Maximum likelihood by scoring, within bounds: Newton's steps with Fisher's information in place of the curvature.

    ∂_i (-log L) = Σ_k ½ tr(S⁻¹ ∂_i S) - ½ ν' S⁻¹ ∂_i S S⁻¹ ν + ∂_i ν' S⁻¹ ν
    J_ij = Σ_k ½ tr(S⁻¹ ∂_i S S⁻¹ ∂_j S) + ∂_i ν' S⁻¹ ∂_j ν

(Gupta and Mehra 1974), with innovations ν and their covariances S. Their derivatives are differences of whole runs of
the filter. A step minimises the quadratic model within the bounds and a box, which grows where the model was right and
shrinks where it was not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from spoofgym.arrays import Flags, Floats
from spoofgym.evaluation.noise.innovations import Innovations

STEP = 1e-4
"""Of a parameter, in a difference."""
TOLERANCE = 1e-3
"""Of the log-likelihood: the search ends where no step promises more."""
STEPS = 100
BOXES = (1.0, 2.0)
"""Half the width of the box at first, and at most."""
SMALLEST = 1e-6
"""Half the width of a box from which the search gives up."""
RIDGE = 1e-9
"""Share of the mean information that is added to each, so that directions of no information do no harm."""

Run = Callable[[Floats], Innovations | None]
"""Innovations by parameters; None = the filter diverges."""


@dataclass(frozen=True, eq=False)
class Scored:
    """Where the search has ended.

    Attributes:
        at: parameters, (p,).
        here: innovations there.
        information: Fisher's, (p, p).
        converged: whether no step promises more.
    """

    at: Floats
    here: Innovations
    information: Floats
    converged: bool


def minus_log_likelihood(found: Innovations | None) -> float:
    """Of innovations, but for a constant; infinite where there are none."""
    if found is None:
        return np.inf
    value = 0.5 * float(np.sum(np.linalg.slogdet(found.covariance)[1] + found.nis))
    return value if np.isfinite(value) else np.inf


def scoring(run: Run, start: Floats, low: Floats, high: Floats) -> Scored:
    """The parameters of the largest likelihood near a start.

    Args:
        run: of the filter, which does not diverge at the start.
        start: parameters, (p,).
        low: least of each, (p,).
        high: greatest of each, (p,).
    """
    at, here, box = start, run(start), BOXES[0]
    assert here is not None
    slope, information = slope_and_information(run, at, here)
    for _ in range(STEPS):
        step = _bounded_step(slope, information, np.maximum(low - at, -box), np.minimum(high - at, box))
        promised = -float(slope @ step + 0.5 * step @ information @ step)
        if promised < TOLERANCE or box < SMALLEST:
            return Scored(at, here, information, promised < TOLERANCE)
        there = run(at + step)
        gained = minus_log_likelihood(here) - minus_log_likelihood(there)
        if there is None or gained < 0.1 * promised:
            box = 0.3 * float(np.max(np.abs(step)))
            continue
        box = min(2.0 * box, BOXES[1]) if gained > 0.7 * promised else box
        at, here = at + step, there
        slope, information = slope_and_information(run, at, here)
    return Scored(at, here, information, False)


def slope_and_information(run: Run, at: Floats, here: Innovations) -> tuple[Floats, Floats]:
    """Of minus the log-likelihood at parameters (p,), with the innovations there: (p,) and (p, p)."""
    inverse = np.linalg.inv(here.covariance)
    weighted = np.einsum("kab,kb->ka", inverse, here.residual)
    residuals, spreads = [], []
    for moved in at + STEP * np.eye(len(at)):
        there = run(moved)
        found = here if there is None else there
        residuals.append((found.residual - here.residual) / STEP)
        spreads.append(inverse @ ((found.covariance - here.covariance) / STEP))
    residual, spread = np.stack(residuals), np.stack(spreads)
    slope = 0.5 * np.einsum("ikaa->i", spread) + np.einsum("ika,ka->i", residual, weighted)
    slope -= 0.5 * np.einsum("ka,ikab,kb->i", here.residual, spread, weighted)
    information = np.einsum("ika,kab,jkb->ij", residual, inverse, residual, optimize=True)
    information += 0.5 * np.einsum("ikab,jkba->ij", spread, spread, optimize=True)
    return slope, 0.5 * (information + information.T)


def _bounded_step(slope: Floats, information: Floats, low: Floats, high: Floats) -> Floats:
    """The step d in a box that minimises g'd + ½ d'J d, as linear least squares of J's factor."""
    size = len(slope)
    ridge = RIDGE * max(float(np.trace(information)) / size, 1.0)
    factor = np.linalg.cholesky(information + ridge * np.eye(size))
    found = lsq_linear(factor.T, -np.linalg.solve(factor, slope), (low, np.maximum(high, low + 1e-12)))
    return np.asarray(found.x)


def standard_errors(information: Floats, free: Flags) -> Floats:
    """Of parameters, (p,), by the information of those that are free; NaN where one is not."""
    error = np.full(len(free), np.nan)
    kept = information[np.ix_(free, free)]
    try:
        error[free] = np.sqrt(np.diag(np.linalg.inv(kept)))
    except np.linalg.LinAlgError:  # a direction in which the likelihood does not change at all
        error[free] = np.inf
    return error
