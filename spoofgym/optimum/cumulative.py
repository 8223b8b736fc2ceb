"""The worst case against the cumulative test: Σ nis over the last n epochs against a threshold T, in closed form.

Under an attack the sum is noncentral chi-square with n m degrees of freedom and noncentrality Σ |u_k|². So an attack
that the test misses with probability P_MD has the noncentrality λ² at which F(T; n m, λ²) = P_MD, and of all these the
one of `noncentrality_optimum` moves the position furthest, by λ σ_max: the worst-case fault of integrity monitoring
(Joerger and Pervan 2013). It is the worst case of this one test: one that keeps the signs of the innovations may see
it at once.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from spoofgym import validation
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.optimum.closed_form import ClosedForm, noncentrality_optimum
from spoofgym.optimum.response import check_epochs
from spoofgym.optimum.survival import log_survival

MOST_DEGREES = 1_000_000


def missed_magnitude(threshold: float, degrees: int, missed: float = 0.5) -> float:
    """λ, the magnitude of a bias of all innovations in a window that a chi-square test misses with probability P_MD.

    Solves F(T; n m, λ²) = P_MD.

    Args:
        threshold: T.
        degrees: n m, of freedom.
        missed: P_MD.

    Raises:
        ValueError: a value out of range, or a threshold so low that the test alarms more often without any bias.
    """
    threshold = validation.above("cumulative test", "threshold", threshold, largest=MOST_DEGREES)
    degrees = validation.whole("cumulative test", "degrees", degrees, 1, MOST_DEGREES)
    missed = validation.probability("cumulative test", "missed", missed)

    def excess(magnitude: float) -> float:
        return float(log_survival(np.array(magnitude), degrees, threshold)) - math.log(missed)

    if excess(0.0) <= 0.0:
        raise ValueError(
            f"cumulative test: without any bias threshold {validation.written(threshold)} with {degrees} degrees of "
            f"freedom is passed with probability {missed * math.exp(excess(0.0)):.3g}, not more than "
            f"{validation.written(missed)}"
        )
    far = math.sqrt(threshold) + 1.0
    while excess(far) > 0.0:
        far *= 2.0
    return float(brentq(excess, 0.0, far, xtol=1e-12))


def cumulative_optimum(
    model: LinearModel, num_epochs: int, threshold: float, missed: float = 0.5
) -> tuple[ClosedForm, float]:
    """The furthest attack over the first n epochs that the sum of their statistics misses with probability P_MD.

    Args:
        model: the filter along the scenario.
        num_epochs: n, of the window and of the attack.
        threshold: of the sum, T.
        missed: P_MD, of the window that holds the whole attack.

    Returns:
        the attack, and λ; its final error is λ times its gain σ_max.

    Raises:
        ValueError: m is not 3, more epochs than the model has, or a value out of range.
    """
    check_epochs(model, num_epochs)
    magnitude = missed_magnitude(threshold, num_epochs * model.dimension, missed)
    return noncentrality_optimum(model, num_epochs, magnitude**2), magnitude
