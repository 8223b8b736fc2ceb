"""Clean innovations of a matched filter: white, and independent of its state, so that they can be drawn directly."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.kernels import njit
from spoofgym.navigation.interface import Epoch, Innovation
from spoofgym.timeline import Timeline


@dataclass(frozen=True)
class WhiteInnovations:
    """What clean innovations are made of, by epoch.

    Attributes:
        factor: L, lower, of epochs 0..K, (K+1, m, m), or one for all, (1, m, m).
        range_response: L⁻¹ H on the position, (K+1, m, 3), where ranges are measured.
        present: whether each measurement is there, (K+1, m), where ranges are measured.
    """

    factor: Floats
    range_response: Floats | None = None
    present: Flags | None = None

    @property
    def dimension(self) -> int:
        """m."""
        return self.factor.shape[1]

    @cached_property
    def covariance(self) -> Floats:
        """S = L L', like `factor`."""
        return np.einsum("kij,klj->kil", self.factor, self.factor)

    def innovation(self, epoch: int, normals: Floats) -> Innovation:
        """The innovation made of standard normals (N, m); epochs outside 0..K are as the nearest one."""
        n, m = normals.shape
        k = min(max(epoch, 0), len(self.factor) - 1)
        present = None if self.present is None else np.broadcast_to(self.present[k], (n, m))
        response = None if self.range_response is None else np.broadcast_to(self.range_response[k], (n, m, 3))
        whitened = np.ascontiguousarray(normals if present is None else np.where(present, normals, 0.0))
        residual, nis = np.empty((n, m)), np.empty(n)
        _colour(whitened, np.ascontiguousarray(self.factor[k].T), residual, nis)
        covariance = np.broadcast_to(self.covariance[k], (n, m, m))
        return Innovation(residual, covariance, whitened, nis, response, present)


@njit(cache=True, nogil=True)
def _colour(whitened: Floats, columns: Floats, residual: Floats, nis: Floats) -> None:
    """Write L w and |w|² of each run, whose w (N, m) is given; ``columns`` are those of L, lower, (m, m)."""
    n, m = whitened.shape
    for run in range(n):
        square = 0.0
        for i in range(m):
            residual[run, i] = 0.0
        for j in range(m):
            normal = whitened[run, j]
            square += normal * normal
            for i in range(j, m):
                residual[run, i] += normal * columns[j, i]
        nis[run] = square


def white_epochs(white: WhiteInnovations, timeline: Timeline, normals: Floats) -> list[Epoch]:
    """The last epochs before epoch 0 of a timeline, of a matched filter: its innovations do not depend on its state.

    Args:
        white: what innovations are made of.
        timeline: of the game.
        normals: standard normals of each run and epoch, (n, epochs, m).
    """
    n, memory, _ = normals.shape
    epochs = []
    for k in range(-memory, 0):
        index = np.full(n, k)
        time = timeline.start + index * timeline.interval
        epochs.append(Epoch(index, time, white.innovation(k, normals[:, memory + k])))
    return epochs
