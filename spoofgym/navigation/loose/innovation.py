"""How a fix and a filter of its own covariance make an innovation, in both fidelities."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.kernels import njit
from spoofgym.navigation import kalman
from spoofgym.navigation.batch import InnovationArrays


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


class FilterRuns(NamedTuple):
    """The arrays of a filter of N runs with covariances of their own.

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


@njit(cache=True, nogil=True, error_model="numpy")
def form_innovation(
    run: int,
    place: int,
    observation: Floats,
    noise: FilterNoise,
    noise_scale: float,
    filters: FilterRuns,
    formed: InnovationArrays,
    work: tuple[Floats, Floats],
) -> None:
    """S, the whitened gain, the whitened residual and the NIS of one run, whose residual is formed.

    Args:
        run: which.
        place: where the outputs stand.
        observation: H on the nine navigation states, (m, 9).
        noise: gives R.
        noise_scale: factor on it.
        filters: of all runs; the run's gain is overwritten.
        formed: the outputs.
        work: (m, n) and (m, m), overwritten.
    """
    cross, factor = work
    variance, innovation, gain = noise.covariance[noise.row[run]], formed.covariance[place], filters.gain[run]
    kalman.innovation_covariance(filters.covariance[run], observation, variance, cross, innovation)
    kalman.scale_noise(noise_scale, variance, innovation)
    kalman.cholesky(innovation, factor)
    kalman.whitened_gain(cross, factor, gain)
    formed.nis[place] = kalman.whiten(factor, formed.residual[place], formed.whitened[place])
