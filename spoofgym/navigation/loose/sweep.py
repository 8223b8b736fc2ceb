"""One filter over all epochs of a game in a single compiled call, for estimates that run it hundreds of times."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.kernels import njit
from spoofgym.navigation.batch import InnovationArrays
from spoofgym.navigation.history import Ring
from spoofgym.navigation.loose.innovation import FilterRuns, FixNoise
from spoofgym.navigation.loose.kernels import FixReference, StrapdownRuns, StrapdownSteps, carry, correct, innovate

LOST = 1e8
"""NIS of a filter that has diverged."""


class Sweep(NamedTuple):
    """What a filter sees and believes at the epochs of a game, every fix used.

    Attributes:
        formed: innovations, one an epoch.
        position: that is predicted for each fix, latitude rad, longitude rad, height m, (E, 3).
        position_variance: what the filter believes of it, E, N, U, (E, 3), m².
    """

    formed: InnovationArrays
    position: Floats
    position_variance: Floats


@njit(cache=True, nogil=True)
def sweep(
    steps: StrapdownSteps,
    vehicles: StrapdownRuns,
    ring: Ring,
    reference: FixReference,
    noise: FixNoise,
    filters: FilterRuns,
    found: Sweep,
) -> bool:
    """Carry a single run from its start over all epochs; whether its filter lasts to the end.

    Args:
        steps: of the game.
        vehicles: one run before its first epoch; in place.
        ring: of the run, without a history.
        reference: what fixes are compared with.
        noise: of the fixes, a row for each epoch.
        filters: of the run; in place.
        found: the result.
    """
    formed, position, variance = found
    run, one, scale = np.zeros(1, dtype=np.int64), np.ones(1, dtype=np.int64), np.ones(1)
    unaided = np.zeros((1, 0))
    for k in range(len(formed.nis)):
        carry(run, one, steps, scale, vehicles, ring, unaided)
        here = InnovationArrays(
            formed.residual[k : k + 1], formed.covariance[k : k + 1], formed.whitened[k : k + 1], formed.nis[k : k + 1]
        )
        innovate(run, run, vehicles.epoch, vehicles.fix, reference, noise, filters, here)
        if not here.nis[0] < LOST:
            return False
        for a in range(3):
            position[k, a] = vehicles.solution.position[0, a]
            variance[k, a] = filters.covariance[0, 6 + a, 6 + a]
        correct(run, vehicles.solution, filters.gain, here.whitened, filters.covariance)
    return True
