"""The attack that moves the position furthest for a budget of noncentrality: a closed form.

The innovations themselves are the control (the map from offsets to innovations is invertible for position fixes), and
the final horizontal error is e_M = G u with the 2 x 3M matrix G of `response.error_response`. So |e_M| under |u|² <=
budget is largest along the first right singular vector of G, and equals σ_max √budget.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.mean_maps import check_position_fix, offsets_of
from spoofgym.optimum.play import Outcome, expected_play
from spoofgym.optimum.response import azimuth_of, check_epochs, error_response, half_circle_sign
from spoofgym.optimum.survival import check_threshold, log_survival


@dataclass(frozen=True)
class ClosedForm:
    """The furthest attack for a budget.

    Attributes:
        budget: Σ |u_k|² of epochs 1..M.
        gain: error per root of budget, m.
        azimuth: direction of the final error, degrees clockwise from north, in [0, 180).
        whitened: mean whitened innovations, (M, 3).
        offsets: (M, 3), m ENU.
    """

    budget: float
    gain: float
    azimuth: float
    whitened: Floats
    offsets: Floats

    @property
    def final_error(self) -> float:
        """Horizontal error after epoch M, m."""
        return self.gain * math.sqrt(self.budget)


def noncentrality_optimum(model: LinearModel, num_epochs: int, budget: float) -> ClosedForm:
    """The attack over the first epochs that maximises the horizontal error after them, for Σ |u_k|² <= budget.

    Args:
        model: the filter along the scenario.
        num_epochs: M.
        budget: noncentrality of the sum of the statistics over the M epochs.

    Raises:
        ValueError: m is not 3, more epochs than the model has, or a budget that is negative or not finite.
    """
    check_position_fix(model, "a closed form")
    check_epochs(model, num_epochs)
    budget = validation.non_negative("noncentrality_optimum", "budget", budget)
    gain, direction, profile = _furthest(error_response(model, num_epochs))
    whitened = math.sqrt(budget) * profile
    return ClosedForm(budget, gain, azimuth_of(direction), whitened, offsets_of(model, whitened))


def best_budget(model: LinearModel, threshold: float) -> tuple[ClosedForm, Outcome]:
    """The closed form over all epochs, at the budget that maximises error times survival: the baseline `closed-form`.

    The log-score is concave in the root of the budget (see `survival`), so a bracketed search of one variable finds it.
    From max_k |u_k| = √threshold + 1 on it falls: there the slope of the log-survival of that epoch alone exceeds that
    of log √budget.

    Returns:
        the attack, and its expected play.

    Raises:
        ValueError: m is not 3, or a threshold that is not positive.
    """
    check_position_fix(model, "a closed form")
    threshold = check_threshold(threshold)
    num_epochs = model.num_epochs
    _, _, profile = _furthest(error_response(model, num_epochs))
    magnitude = np.linalg.norm(profile, axis=1)

    def loss(root: float) -> float:
        return -math.log(root) - float(np.sum(log_survival(root * magnitude, 3, threshold)))

    limit = (math.sqrt(threshold) + 1.0) / float(magnitude.max())
    root = minimize_scalar(loss, bounds=(0.0, limit), method="bounded", options={"xatol": 1e-9 * limit}).x
    attack = noncentrality_optimum(model, num_epochs, float(root) ** 2)
    return attack, expected_play(model, attack.offsets, threshold)


def _furthest(response: Floats) -> tuple[float, Floats, Floats]:
    """Largest singular value of G (2, M, 3), the direction of the error (2,) and the innovations (M, 3) that attain it.

    The sign, which is free, turns the error to the half circle from north over east.
    """
    left, values, right = np.linalg.svd(response.reshape(2, -1), full_matrices=False)
    sign = half_circle_sign(left[:, 0])
    return float(values[0]), sign * left[:, 0], sign * right[0].reshape(response.shape[1:])
