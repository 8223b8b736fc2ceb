"""The filter of one game that knows what really acts, and the maps by which offsets move it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.navigation.loose.true_model import TrueModel
from spoofgym.optimum.play import HORIZONTAL


class Filter(NamedTuple):
    """The best filter of a game without an attack; leading axis: epochs 0..K. Where there is no fix, it coasts.

    An offset s shifts the mean u of its whitened innovations and the mean c of what its estimate misses: u = seen c -
    whiten s, then c <- closed c + gain s.

    Attributes:
        closed: (I - K C) A, stored by columns, (K+1, n, n).
        seen: L⁻¹ C A, (K+1, 3, n).
        whiten: L⁻¹, (K+1, 3, 3).
        gain: K, (K+1, 3, n), stored by columns.
        covariance: of the horizontal error after the fix, (K+1, 2, 2), m².
        later: that of the horizontal error a while later if no fix is used until then, (K+1, 2, 2), m².
        rows: from y to that error, (K+1, 2, n).
    """

    closed: Floats
    seen: Floats
    whiten: Floats
    gain: Floats
    covariance: Floats
    later: Floats
    rows: Floats


class Look(NamedTuple):
    """What becomes of y some epochs ahead, or at the end of the game, without fixes; leading axis: epochs 0..K.

    Attributes:
        rows: from y to the horizontal error then, (K+1, 2, n).
        noise: covariance of what comes on top, (K+1, 2, 2), m².
    """

    rows: Floats
    noise: Floats


def look_ahead(model: TrueModel, epochs: int) -> Look:
    """Look so many epochs ahead."""
    count, _, n = model.observation.shape
    rows, noise = np.zeros((count, 2, n)), np.zeros((count, 2, 2))
    for k in range(count):
        seen = np.eye(n)[HORIZONTAL]
        for step in range(min(k + epochs, count - 1), k, -1):
            noise[k] += seen @ model.process_noise[step] @ seen.T
            seen = seen @ model.transition[step]
        rows[k] = seen
    return Look(rows, noise)


def best_filter(model: TrueModel, available: Flags, disturbance: Floats, look: Look) -> Filter:
    """The gains of a game.

    Args:
        model: what really acts.
        available: whether there is a fix, (K+1,).
        disturbance: white noise of the position that comes on top of the receiver's, 1 sigma per axis, (K+1,), m.
        look: how far it looks ahead.
    """
    epochs = len(available)
    _, m, n = model.observation.shape
    closed, seen = np.empty((epochs, n, n)), np.zeros((epochs, m, n))
    whiten, gain = np.zeros((epochs, m, m)), np.zeros((epochs, m, n))
    horizontal, later = np.empty((epochs, 2, 2)), np.empty((epochs, 2, 2))
    covariance = model.prior_covariance
    for k in range(epochs):
        advance, observed = model.transition[k], model.observation[k]
        covariance = advance @ covariance @ advance.T + model.process_noise[k]
        closed[k] = advance.T
        if available[k]:
            cross = observed @ covariance
            noise = model.measurement_covariance + disturbance[k] ** 2 * np.eye(m)
            whiten[k] = np.linalg.inv(np.linalg.cholesky(cross @ observed.T + noise))
            half = whiten[k] @ cross
            gain[k] = whiten[k].T @ half
            covariance = covariance - half.T @ half
            seen[k] = whiten[k] @ observed @ advance
            closed[k] -= advance.T @ observed.T @ gain[k]
        covariance = 0.5 * (covariance + covariance.T)
        horizontal[k] = covariance[HORIZONTAL, HORIZONTAL]
        later[k] = look.rows[k] @ covariance @ look.rows[k].T + look.noise[k]
    return Filter(closed, seen, whiten, gain, horizontal, later, look.rows[:epochs])


def run_filter(found: Filter, residual: Floats) -> tuple[Floats, Floats]:
    """What the filter makes of the fixes of games with the same gains.

    Args:
        found: the filter.
        residual: innovations of an unaided solution, (G, K+1, 3), m; of no account where there is no fix.

    Returns:
        Whitened innovations (G, K+1, 3), and the estimate of y of the unaided solution, (G, K+1, n).
    """
    games, epochs, _ = residual.shape
    state = np.zeros((games, found.closed.shape[1]))
    whitened, estimate = np.empty_like(residual), np.empty((games, epochs, state.shape[1]))
    for k in range(epochs):
        # z = C y - n: what the filter expects to see is C A y, its own state carried on
        whitened[:, k] = residual[:, k] @ found.whiten[k].T - state @ found.seen[k].T
        state = state @ found.closed[k] + residual[:, k] @ found.gain[k]
        estimate[:, k] = state
    return whitened, estimate
