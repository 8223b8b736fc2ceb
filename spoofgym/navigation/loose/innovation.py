"""How a fix and a filter of its own covariance make an innovation, in both fidelities."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman


class FilterNoise(NamedTuple):
    """What the filter of each run believes of its noises.

    Attributes:
        covariance: all R, (r, m, m).
        row: which of them is a run's, (N,).
        process_scale: factor on Q, (N,).
    """

    covariance: Floats
    row: Runs
    process_scale: Floats


class FixNoise(NamedTuple):
    """The R of some fixes: rows of all R, (r, m, m), one for each of all runs, (N,); and factors, (n,)."""

    covariance: Floats
    row: Runs
    scale: Floats


class FilterRuns(NamedTuple):
    """The arrays of N filters with covariances of their own.

    Attributes:
        covariance: P, (N, n, n).
        gain: U' of the last innovation, (N, m, n).
        deviation: of the present fix, (N, m).
        whitened: the last innovation, whitened, (N, m).
    """

    covariance: Floats
    gain: Floats
    deviation: Floats
    whitened: Floats


def constant_noise(covariance: Floats, num_runs: int) -> FilterNoise:
    """The same R (m, m) in every run, and Q as it is."""
    return FilterNoise(np.array(covariance)[None], np.zeros(num_runs, dtype=np.int64), np.ones(num_runs))


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def form_innovation(
    covariance: Floats,
    observation: Floats,
    noise: Floats,
    noise_scale: float,
    innovation: Floats,
    gain: Floats,
    cross: Floats,
    factor: Floats,
) -> None:
    """S, its factor and the whitened gain of one run.

    Args:
        covariance: P, (n, n).
        observation: H, (m, h).
        noise: R, (m, m).
        noise_scale: factor on it.
        innovation: S, (m, m), overwritten.
        gain: U', (m, n), overwritten.
        cross: (m, n), overwritten.
        factor: L of S = L L', (m, m), overwritten.
    """
    kalman.innovation_covariance(covariance, observation, noise, cross, innovation)
    kalman.scale_noise(noise_scale, noise, innovation)
    kalman.cholesky(innovation, factor)
    kalman.whitened_gain(cross, factor, gain)
