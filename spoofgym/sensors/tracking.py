"""The error with which a spoofer tracks the vehicle."""

from __future__ import annotations

import math

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.kernels import njit


def draw_tracking_error(
    stream: np.random.Generator, shape: tuple[int, ...], sigma: float, time: float, interval: float | Floats
) -> Floats:
    """Tracking errors of consecutive epochs: first-order Gauss-Markov, stationary from the first epoch on.

    x_0 = σ n_0, x_k = a_k x_{k-1} + σ √(1 - a_k²) n_k with a_k = exp(-interval_k / time), n_k standard normal. The same
    numbers are drawn whatever the correlation time.

    Args:
        stream: source of randomness.
        shape: epochs first, then the axes.
        sigma: of the error, on every axis.
        time: correlation time, s; 0 = white.
        interval: between epochs, s; one, or that before each epoch but the first.

    Returns:
        of this shape, in the unit of ``sigma``.
    """
    white = sigma * stream.standard_normal(shape)
    if time == 0.0:
        return white
    decay = np.array([math.exp(-step / time) for step in np.broadcast_to(interval, len(white) - 1).tolist()])
    rows = white.reshape(len(white), -1)
    rows[1:] *= np.sqrt(1.0 - decay**2)[:, None]
    _remember(decay, rows)
    return rows.reshape(shape)


@njit(cache=True, nogil=True)
def _remember(decay: Floats, error: Floats) -> None:
    """x_k <- a_k x_{k-1} + x_k in place, for decays (E - 1,) and errors (E, axes)."""
    for k in range(len(decay)):
        for a in range(error.shape[1]):
            error[k + 1, a] += decay[k] * error[k, a]
