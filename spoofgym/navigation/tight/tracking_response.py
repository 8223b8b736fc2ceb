"""How a tightly coupled filter responds to a spoofer's tracking error, its own feedback included.

The spoofer replays the signals of a place that is off by ν_k along a direction u. The ranges differ by H u ν, and so do
the filter's errors and innovations from what they would have been,

    e⁻ = Φ e,        w = L⁻¹ (H e⁻ - H u ν),        e = e⁻ - U w,

a linear map of ν. Kujur 2024 leaves e out; with it, an innovation sees little more than the first difference of ν.
"""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.navigation.error_model import NUM_NAVIGATION
from spoofgym.navigation.tight.model import TightModel
from spoofgym.navigation.tight.states import CLOCK, DRIFT, INERTIAL, POSITION, VELOCITY, slot_states


def tracking_response(model: TightModel, direction: Floats) -> Floats:
    """What a metre of tracking error at epoch j does to the whitened innovation of epoch k, (K, m, K), 1/m.

    Where range rates are measured they are those of an offset that has moved at a constant rate since the last epoch.

    Args:
        model: the filter; the spoofing goes on from its epoch 1 to K.
        direction: u, unit vector (3,), ENU.
    """
    dynamics, epochs = model.dynamics, model.num_epochs
    slots = slot_states(dynamics.num_slots)
    moved, shaken = _design(model, POSITION, direction), _design(model, VELOCITY, direction) / dynamics.interval
    response = np.zeros((epochs, model.dimension, epochs))
    error = np.zeros((dynamics.num_states, epochs))
    for k in range(1, epochs + 1):
        e = error[:, :k]
        e[CLOCK] += dynamics.interval * e[DRIFT]
        e[:NUM_NAVIGATION] = dynamics.transition[k] @ e[INERTIAL]
        e[NUM_NAVIGATION:] *= dynamics.decay[NUM_NAVIGATION:, None]
        e[slots[dynamics.started[k]]] = 0.0
        residual = np.add.reduce(dynamics.values[k][:, :, None] * e[dynamics.columns], axis=1)
        residual[:, k - 1] -= moved[k] + shaken[k]
        if k > 1:
            residual[:, k - 2] += shaken[k]
        response[k - 1, :, :k] = np.linalg.solve(model.innovation_factor[k], residual)
        e -= model.whitened_gain[k].T @ response[k - 1, :, :k]
    return response


def projected_response(model: TightModel, direction: Floats) -> Floats:
    """What it does to s_k / σ_s, the innovation projected onto the direction (eqs 17 to 20), (K, K), 1/m.

    Arguments as in `tracking_response`.
    """
    axis = model.position_response[1:] @ direction
    size = np.sqrt(np.add.reduce(axis**2, axis=1))
    axis /= np.where(size > 0.0, size, 1.0)[:, None]
    return np.einsum("km,kmj->kj", axis, tracking_response(model, direction))


def _design(model: TightModel, states: slice, direction: Floats) -> Floats:
    """H on three states times u, (K+1, m)."""
    dynamics = model.dynamics
    observed = dynamics.columns[:, 0] == states.start
    return observed * (dynamics.values[:, :, :3] @ direction)
