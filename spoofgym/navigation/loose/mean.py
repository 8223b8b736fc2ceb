"""The offsets that provoke wanted innovations: the mean recursion of the filter, solved for what the spoofer adds."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.navigation.error_model import NUM_STATES
from spoofgym.navigation.linear_model import LinearModel


def check_position_fix(model: LinearModel, owner: str) -> None:
    """Refuse a model whose fixes are not a position alone.

    Args:
        model: the filter along the scenario.
        owner: who needs a position fix, for the message.

    Raises:
        ValueError: m is not 3, so offsets cannot provoke every innovation.
    """
    dimension = model.dimension
    if dimension != 3:
        raise ValueError(f"{owner} exists only for position fixes (m = 3), this model has m = {dimension}")


def offsets_of(model: LinearModel, whitened: Floats) -> Floats:
    """The offsets that provoke given mean innovations: s_k = H_k e⁻_k - L_k u_k (position fixes only).

    Liu 2018, eqs 32-34, with e⁻_k = Φ_k e_{k-1} and e_k = e⁻_k - U_k u_k.

    Args:
        model: the filter along the scenario.
        whitened: u_k of epochs 1..M, (M, 3).

    Returns:
        s_k, (M, 3), m ENU.

    Raises:
        ValueError: m is not 3.
    """
    check_position_fix(model, "an offset for every innovation")
    error = np.zeros(NUM_STATES)
    offsets = np.empty_like(whitened)
    for k, mean in enumerate(whitened, start=1):
        error = model.transition[k] @ error
        offsets[k - 1] = model.observation[k] @ error[:9] - model.innovation_factor[k] @ mean
        error = error - mean @ model.whitened_gain[k]
    return offsets
