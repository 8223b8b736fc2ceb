"""What N runs of a filter have in common whose aids are told about, in either fidelity."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.aid_innovations import AidInnovations
from spoofgym.navigation.aids.aid_set import AidSet
from spoofgym.navigation.aids.kernels import Told
from spoofgym.navigation.batch import FilterBatch
from spoofgym.navigation.interface import Demands
from spoofgym.streams import RunStreams


class AidedBatch(FilterBatch):
    """N runs of an aided filter.

    Attributes:
        auxiliary: all states of the solution without GNSS minus those of the filter, (N, n); (N, 0) if not demanded.
            It takes every reading that the filter takes, with the filter's gain.
    """

    walk_normals: Floats
    aid_normals: Floats

    def _listen(self, aids: AidSet, num_states: int, demands: Demands) -> None:
        """Allocate what the aids tell, for a filter of ``num_states``."""
        n = len(self.index)
        self.aids = aids
        self.auxiliary = np.zeros((n, num_states if demands.auxiliary else 0))
        count = np.zeros((n, len(aids.aids)), dtype=np.int64)
        self._told = Told(np.zeros((n, aids.num_rows)), count, count.copy())

    def _draw_aids(self, runs: Runs, streams: RunStreams) -> None:
        """Draw the noise of the aids of new episodes, from a stream of its own."""
        for run in runs.tolist():
            stream = streams(run, "aids")
            stream.standard_normal(out=self.aid_normals[run])
            stream.standard_normal(out=self.walk_normals[run])
        for part in self._told:
            part[runs] = 0

    def aid_innovations(self, runs: Runs) -> AidInnovations:
        """What the aids told these runs on the way to their present epoch."""
        told, count = self._told, self._told.number[runs]
        rows = np.repeat(np.maximum(count, 1), [aid.dimension for aid in self.aids.aids], axis=1)
        whitened = told.whitened[runs] / np.sqrt(rows)
        return AidInnovations(self.aids.names, self.aids.first_row, whitened, count, told.rejected[runs])
