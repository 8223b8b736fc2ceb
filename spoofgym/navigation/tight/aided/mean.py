"""The aided filter on ranges in expectation: the aids of an epoch correct the mean error before its ranges do."""

from __future__ import annotations

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.mean import Means
from spoofgym.navigation.tight.aided.kernels import correct_means
from spoofgym.navigation.tight.aided.model import AidedTightModel
from spoofgym.navigation.tight.mean import TightMeanFilter, tell_coming
from spoofgym.parallel import RunSlices


class AidedTightMeanFilter(TightMeanFilter):
    """N aided filters on ranges in expectation, everything used."""

    model: AidedTightModel

    def __init__(self, model: AidedTightModel, num_runs: int, slices: RunSlices) -> None:
        """As for `TightMeanFilter`."""
        super().__init__(model, num_runs, slices)

    def _advance(
        self, runs: Runs, index: Runs, offset: Floats, previous: Floats, interval: Floats, means: Means
    ) -> None:
        super()._advance(runs, index, offset, previous, interval, means)
        correct_means(runs, index, self.model.aided, means.prior)
        tell_coming(runs, index, offset, self._arrays, means)
