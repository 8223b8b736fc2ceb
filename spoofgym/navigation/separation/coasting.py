"""Solutions that coast on inertia from every past epoch, beside the filter that uses ranges: all of them at once.

The coasting that departs from the filter after epoch j obeys the same Φ and Q as every other. Brought back to a common
origin by C_k = Φ_k C_(k-1), the difference to a solution that has never been corrected, and what the covariance is
beyond that of pure process noise, Γ_k = Φ_k Γ_(k-1) Φ_k' + Q_k,

    E_k = C_k⁻¹ (x_KF - x_unaided),        M_k = C_k⁻¹ (P_k - Γ_k) C_k⁻ᵀ,

change at a correction only: -C_k⁻¹ U_k w_k and -C_k⁻¹ U_k U_k' C_k⁻ᵀ. A coasting keeps those of its departure. So along
a direction u, with b_k = C_k' u,

    u' (x_KF - x_coast) = b_k' (E_k - E_j),        u' (P_coast - P_KF) u = b_k' (M_j - M_k) b_k,

and no second solution is ever carried forward. C grows without end, and with it what rounding leaves of the
differences: the origin is moved on from time to time, E <- C E and M <- C M C' + Γ, and C begins anew. The fifteen
inertial states suffice: no other state acts on them between epochs. The separation and its variance are of Kujur 2024,
eqs 49 and 50; the common origin is ours.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation.error_model import INERTIAL, NUM_INERTIAL, POSITION
from spoofgym.navigation.packed import packed_size
from spoofgym.navigation.tight.model import TightModel

ORIGIN_LIFE = 600.0
"""Time after which the origin is moved on, s: about the time constant of a free vertical channel, in which C grows.
It is never moved twice within the windows that are open at once."""

PACKED = packed_size(NUM_INERTIAL)
"""Entries of the lower triangle of a covariance of the inertial states."""


class CoastingTables(NamedTuple):
    """What all windows of all runs share, by epoch; rows are the epochs 1 - n..K. It is never changed.

    Attributes:
        num_windows: n, open at once.
        origin_rows: B; the origin is moved on before each row that is a multiple of B, except the first.
        moved: C of the row before, about the origin before, for each such row; the first is the unit matrix, (R/B, 15,
            15).
        spread: Γ of the same rows; the first is zero, (R/B, 15, 15).
        directions: places of the A directions u among east, north and up, (A,).
        inverse: C⁻¹, (R, 15, 15).
        projected: b = C' u, (R, A, 15).
        noise: Γ, (R, 15, 15).
        response: C⁻¹ U, (R, 15, m): what a whitened innovation does to E, less the sign; every range used.
        variance: u' (P_coast - P_KF) u by the epochs since the window was opened, from 1 on, (R, A, n), m²; every range
            used.
        filtered: u' P_KF u after the ranges, (R, A), m²; every range used.
        early: M of the windows opened before epoch 0 less that of epoch -1, by the epochs since then at epoch 0, from 1
            on, packed, (120, n).
    """

    num_windows: int
    origin_rows: int
    moved: Floats
    spread: Floats
    directions: Runs
    inverse: Floats
    projected: Floats
    noise: Floats
    response: Floats
    variance: Floats
    filtered: Floats
    early: Floats

    def __deepcopy__(self, memo: dict[int, Any]) -> CoastingTables:
        """Itself: the copies of a detector share their tables."""
        return self


def coasting_tables(
    model: TightModel, directions: tuple[int, ...], num_windows: int, burn_in: int = 0
) -> CoastingTables:
    """The tables of a bank.

    Args:
        model: of epochs -burn_in..K; those before are as the first of them.
        directions: places of the directions among east, north and up.
        num_windows: n.
        burn_in: epochs of the model before epoch 0.
    """
    places = np.array(directions, dtype=np.int64)
    rows = np.maximum(np.arange(1 - num_windows + burn_in, model.num_epochs + 1), 0)
    origin_rows = max(num_windows, math.ceil(ORIGIN_LIFE / model.dynamics.interval))
    moved, spread, inverse, projected, noise = _about_origins(model, rows, origin_rows, places)
    gain = model.whitened_gain[:, :, INERTIAL]
    response = inverse @ gain[rows].transpose(0, 2, 1)
    variance = np.zeros((len(rows), len(places), num_windows))
    _separation_variance(response, projected, origin_rows, moved, variance)
    position_gain = gain[:, :, POSITION][:, :, places]
    prior = model.covariance[:, POSITION, POSITION][:, places, places]
    filtered = prior - np.add.reduce(position_gain**2, axis=1)
    return CoastingTables(
        num_windows=num_windows,
        origin_rows=origin_rows,
        moved=moved,
        spread=spread,
        directions=places,
        inverse=inverse,
        projected=projected,
        noise=noise,
        response=response,
        variance=variance,
        filtered=filtered[rows],
        early=_early(response, num_windows),
    )


def _about_origins(
    model: TightModel, rows: Runs, origin_rows: int, places: Runs
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """C and Γ at which the origin is moved on, then C⁻¹, C' u and Γ of all rows."""
    n = model.separation_transition.shape[1]
    transition, process_noise = model.separation_transition, model.separation_noise
    backward = np.linalg.inv(transition)
    inverse, noise = np.empty((len(rows), n, n)), np.empty((len(rows), n, n))
    projected = np.empty((len(rows), len(places), n))
    carried, undone, spread = np.eye(n), np.eye(n), np.zeros((n, n))
    moved, spreads = [], []
    for r, k in enumerate(rows):
        if r % origin_rows == 0:
            moved.append(carried)
            spreads.append(spread)
            carried, undone, spread = np.eye(n), np.eye(n), np.zeros((n, n))
        carried, undone = transition[k] @ carried, undone @ backward[k]
        spread = transition[k] @ spread @ transition[k].T + process_noise[k]
        inverse[r], projected[r], noise[r] = undone, carried[POSITION][places], spread
    return np.array(moved), np.array(spreads), inverse, projected, noise


@njit(cache=True, nogil=True, error_model="numpy")
def _separation_variance(
    response: Floats, projected: Floats, origin_rows: int, moved: Floats, variance: Floats
) -> None:
    """Σ |U_i' C_i⁻ᵀ b_k|² over the epochs i since a window was opened; variance (R, A, n), overwritten."""
    rows, axes, windows = variance.shape
    direction, before = np.empty(NUM_INERTIAL), np.empty(NUM_INERTIAL)
    for k in range(rows):
        for a in range(axes):
            total = 0.0
            for i in range(NUM_INERTIAL):
                direction[i] = projected[k, a, i]
            for age in range(min(windows, k + 1)):
                for c in range(response.shape[2]):
                    part = 0.0
                    for i in range(NUM_INERTIAL):
                        part += response[k - age, i, c] * direction[i]
                    total += part * part
                variance[k, a, age] = total
                if (k - age) % origin_rows == 0:
                    # the epochs before have the origin before: C' b
                    before[:] = 0.0
                    for i in range(NUM_INERTIAL):
                        for j in range(NUM_INERTIAL):
                            before[j] += moved[(k - age) // origin_rows, i, j] * direction[i]
                    for i in range(NUM_INERTIAL):
                        direction[i] = before[i]


def _early(response: Floats, num_windows: int) -> Floats:
    """M of the windows opened before epoch 0, as in `CoastingTables`."""
    lower = np.tril_indices(response.shape[1])
    early = np.zeros((len(lower[0]), num_windows))
    for age in range(1, num_windows):
        gain = response[num_windows - 1 - age]
        early[:, age] = early[:, age - 1] + (gain @ gain.T)[lower]
    return early
