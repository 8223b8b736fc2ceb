"""The linear maps between increments of the offset, mean innovations and the final horizontal error."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.mean_maps import expected_columns, final_response
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

    G_k = -(horizontal rows of Φ_M ... Φ_{k+1}) U_k.

    Args:
        model: the filter along the scenario.
        num_epochs: M, the epoch whose error counts.

    Returns:
        G_k of epochs 1..M, (2, M, m), m per unit of whitened innovation.
    """
    rows = np.zeros((2, model.num_states))
    rows[:, HORIZONTAL] = np.eye(2)
    return final_response(model, rows, num_epochs)


def increment_maps(model: LinearModel) -> tuple[Floats, Floats]:
    """How the increments v_k = s_k - s_{k-1} of the offset (s_0 = 0) move the innovations and the final error.

    Every column of the identity goes through the mean recursion at once.

    Returns:
        maps from the increments (K * 3,), m ENU, to the whitened innovations, (K * m, K * 3), and to the final
        horizontal error, m, (2, K * 3).
    """
    num_columns = model.num_epochs * 3
    whitened, error = expected_columns(model, _unit_increments(model), num_columns)
    return whitened.reshape(model.num_epochs * model.dimension, num_columns), error[HORIZONTAL]


def _unit_increments(model: LinearModel) -> Iterator[Floats]:
    """What each unit increment has added to the fix at epochs 1..K, (m, K * 3) each."""
    num_columns = model.num_epochs * 3
    offset = np.zeros((3, num_columns))
    for k in range(1, model.num_epochs + 1):
        increment = np.zeros((3, num_columns))
        increment[:, 3 * (k - 1) : 3 * k] = np.eye(3)
        offset += increment
        rate = increment / (model.time[k] - model.time[k - 1])
        yield offset if model.dimension == 3 else np.vstack((offset, rate))


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
