"""The linear maps of the mean recursion of `play`, between offsets, innovations and the final horizontal error."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.navigation.error_model import NUM_STATES
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.optimum.play import HORIZONTAL


def check_epochs(model: LinearModel, num_epochs: object) -> None:
    """Refuse a number of epochs that the model does not have.

    Raises:
        ValueError: fewer than one epoch, or more than the model's K.
    """
    available = model.num_epochs
    if isinstance(num_epochs, bool) or not isinstance(num_epochs, int | np.integer) or not 1 <= num_epochs <= available:
        raise ValueError(
            f"num_epochs must lie in 1..{available} (the epochs of the model), got {validation.shown(num_epochs)}"
        )


def error_response(model: LinearModel, num_epochs: int) -> Floats:
    """How the innovation of each epoch moves the final horizontal error: e_M = Σ_k G_k u_k.

    G_k = -(horizontal rows of Φ_M ... Φ_{k+1}) U_k, by the recursion of the rows backward from epoch M.

    Args:
        model: the filter along the scenario.
        num_epochs: M, the epoch whose error counts.

    Returns:
        G_k of epochs 1..M, (2, M, m), m per unit of whitened innovation.
    """
    rows = np.zeros((2, NUM_STATES))
    rows[:, HORIZONTAL] = np.eye(2)
    response = np.empty((2, num_epochs, model.dimension))
    for k in range(num_epochs, 0, -1):
        response[:, k - 1] = -rows @ model.whitened_gain[k].T
        rows = rows @ model.transition[k]
    return response


def increment_maps(model: LinearModel) -> tuple[Floats, Floats]:
    """How the increments v_k = s_k - s_{k-1} of the offset (s_0 = 0) move the innovations and the final error.

    Every column of the identity goes through the recursion of `play` at once.

    Returns:
        maps from the increments (K * 3,), m ENU, to the whitened innovations, (K * m, K * 3), and to the final
        horizontal error, m, (2, K * 3).
    """
    num_epochs, dimension = model.num_epochs, model.dimension
    error = np.zeros((NUM_STATES, num_epochs * 3))
    offset = np.zeros((3, num_epochs * 3))
    whitened = np.empty((num_epochs, dimension, num_epochs * 3))
    for k in range(1, num_epochs + 1):
        increment = np.zeros((3, num_epochs * 3))
        increment[:, 3 * (k - 1) : 3 * k] = np.eye(3)
        offset += increment
        deviation = offset if dimension == 3 else np.vstack((offset, increment / (model.time[k] - model.time[k - 1])))
        error = model.transition[k] @ error
        residual = model.observation[k] @ error[:9] - deviation
        factor = model.innovation_factor[k]
        for a in range(dimension):  # forward substitution: a LAPACK call for 3 rows costs more than it computes
            whitened[k - 1, a] = (residual[a] - factor[a, :a] @ whitened[k - 1, :a]) / factor[a, a]
        error -= model.whitened_gain[k].T @ whitened[k - 1]
    return whitened.reshape(num_epochs * dimension, num_epochs * 3), error[HORIZONTAL]


def azimuth_of(horizontal: Floats) -> float:
    """Direction of a horizontal vector (east, north), degrees clockwise from north, in [0, 360)."""
    return float(np.degrees(np.arctan2(horizontal[0], horizontal[1])) % 360.0)


def horizontal_unit(azimuth: Floats) -> Floats:
    """Unit vectors (east, north) of azimuths (...,) in degrees clockwise from north, (..., 2)."""
    radians = np.radians(azimuth)
    return np.stack((np.sin(radians), np.cos(radians)), axis=-1)


def half_circle_sign(horizontal: Floats) -> float:
    """The sign, +1 or -1, that turns (east, north) to an azimuth in [0, 180).

    An attack and its mirror image are worth the same.
    """
    return 1.0 if azimuth_of(horizontal) < 180.0 else -1.0
