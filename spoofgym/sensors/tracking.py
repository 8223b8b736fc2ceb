"""How well a spoofer knows where the vehicle is: the error of whatever sensor it tracks the vehicle with."""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import lfilter

from spoofgym.arrays import Floats


def draw_tracking_error(
    stream: np.random.Generator, shape: tuple[int, ...], sigma: float, time: float, interval: float
) -> Floats:
    """Tracking errors of consecutive epochs: first-order Gauss-Markov, stationary from the first epoch on.

    x_0 = σ n_0, x_k = a x_{k-1} + σ √(1 - a²) n_k with a = exp(-interval / time), n_k standard normal. The same numbers
    are drawn whatever the correlation time.

    Args:
        stream: source of randomness.
        shape: epochs first, then the axes.
        sigma: of the error, on every axis.
        time: correlation time, s; 0 = white.
        interval: between epochs, s.

    Returns:
        of this shape, in the unit of ``sigma``.
    """
    white = sigma * stream.standard_normal(shape)
    if time == 0.0:
        return white
    decay = math.exp(-interval / time)
    white[1:] *= math.sqrt(1.0 - decay**2)
    return np.asarray(lfilter([1.0], [1.0, -decay], white, axis=0))
