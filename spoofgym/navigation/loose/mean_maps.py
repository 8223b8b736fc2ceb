"""Linear maps of the loosely coupled mean recursion: from offsets to innovations and errors, and back.

The equations (Liu 2018, eqs 32-34) are those of `mean.py`:

    e⁻ = Φ e,      u = L⁻¹ (H e⁻ - s),      e = e⁻ - U u.

There compiled loops play a game run by run. Here each line is a matrix product that carries all columns of a map at
once, or is solved for s, or transposed. A product adds up in another order than a loop, so the two forms differ in the
last bits and neither can replace the other without changing results; `tests/navigation/test_mean.py` holds them
together.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.navigation.error_model import NUM_NAVIGATION
from spoofgym.navigation.linear_model import LinearModel

HORIZONTAL = slice(6, 8)
"""East and north of the position error."""


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
    """The offsets that cause given mean innovations: s_k = H_k e⁻_k - L_k u_k (position fixes only).

    Args:
        model: the filter along the scenario.
        whitened: u_k of epochs 1..M, (M, 3).

    Returns:
        s_k, (M, 3), m ENU.

    Raises:
        ValueError: m is not 3.
    """
    check_position_fix(model, "an offset for every innovation")
    error = np.zeros(model.num_states)
    offsets = np.empty_like(whitened)
    for k, mean in enumerate(whitened, start=1):
        error = model.transition[k] @ error
        offsets[k - 1] = _observed(model, k, error) - model.innovation_factor[k] @ mean
        error = _corrected(model, k, error, mean)
    return offsets


def expected_columns(model: LinearModel, deviations: Iterable[Floats], num_columns: int) -> tuple[Floats, Floats]:
    """The mean innovations of many games at once, and their mean errors at the end.

    Args:
        model: the filter along epochs 0..K.
        deviations: what the spoofers add to the fixes of each epoch 1..K, a column per game, each (m, C).
        num_columns: C.

    Returns:
        u of epochs 1..K, (K, m, C), and e after epoch K, (n, C).
    """
    whitened = np.empty((model.num_epochs, model.dimension, num_columns))
    error = np.zeros((model.num_states, num_columns))
    for k, deviation in enumerate(deviations, start=1):
        error = model.transition[k] @ error
        _whiten(model.innovation_factor[k], _observed(model, k, error) - deviation, whitened[k - 1])
        error = _corrected(model, k, error, whitened[k - 1])
    return whitened, error


def error_map(model: LinearModel) -> Floats:
    """T: from the mean whitened innovations of epochs 1..K to the horizontal errors after them, (2K, K * m), m.

    Args:
        model: the filter along the scenario.
    """
    num_epochs, m = model.num_epochs, model.dimension
    error = np.zeros((model.num_states, num_epochs * m))
    rows = np.empty((num_epochs, 2, num_epochs * m))
    for k in range(1, num_epochs + 1):
        error[:, : k * m] = model.transition[k] @ error[:, : k * m]
        error[:, (k - 1) * m : k * m] -= model.whitened_gain[k].T
        rows[k - 1] = error[HORIZONTAL]
    return rows.reshape(2 * num_epochs, num_epochs * m)


def quiet_offsets(model: LinearModel, directions: int) -> Floats:
    """The offsets that move the position most over a game per unit of noncentrality.

    Args:
        model: the filter along the scenario.
        directions: r, how many attacks; their innovations are orthogonal, the most effective first.

    Returns:
        Horizontal offsets of epochs 0..K with Σ|u_k|² = 1, none at epoch 0, (K+1, 2, r), m.

    Raises:
        ValueError: m is not 3.
    """
    _, _, right = np.linalg.svd(error_map(model), full_matrices=False)
    offsets = [offsets_of(model, vector.reshape(-1, model.dimension))[:, :2] for vector in right[:directions]]
    return np.concatenate([np.zeros((1, 2, directions)), np.stack(offsets, axis=2)])


def final_response(model: LinearModel, rows: Floats, num_epochs: int) -> Floats:
    """How the innovation of each epoch moves linear functions of the last error: A e_M = Σ_k G_k u_k.

    G_k = -A Φ_M ... Φ_{k+1} U_k, by the recursion of the rows backward from epoch M.

    Args:
        model: the filter along the scenario.
        rows: A, (r, n).
        num_epochs: M, the epoch whose error counts.

    Returns:
        G_k of epochs 1..M, (r, M, m), per unit of whitened innovation.
    """
    response = np.empty((len(rows), num_epochs, model.dimension))
    for k in range(num_epochs, 0, -1):
        response[:, k - 1] = -rows @ model.whitened_gain[k].T
        rows = rows @ model.transition[k]
    return response


def _observed(model: LinearModel, epoch: int, error: Floats) -> Floats:
    """H e of errors (n,) or (n, C)."""
    observed: Floats = model.observation[epoch] @ error[:NUM_NAVIGATION]
    return observed


def _whiten(factor: Floats, residual: Floats, whitened: Floats) -> None:
    """u = L⁻¹ r: residual r (m, C), whitened u (m, C), result.

    It is a forward substitution, since a LAPACK call for 3 rows costs more than it computes.
    """
    for a in range(len(factor)):
        whitened[a] = (residual[a] - factor[a, :a] @ whitened[:a]) / factor[a, a]


def _corrected(model: LinearModel, epoch: int, error: Floats, whitened: Floats) -> Floats:
    """e⁻ - U u; errors (n,) or (n, C)."""
    corrected: Floats = error - model.whitened_gain[epoch].T @ whitened
    return corrected
