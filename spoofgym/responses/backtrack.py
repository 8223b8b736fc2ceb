"""A response that excludes GNSS and goes back a fixed number of epochs (FOI-R-5687)."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Runs
from spoofgym.navigation.interface import Epoch
from spoofgym.responses.excluding import ExcludingResponse
from spoofgym.responses.reuse import reuse_rule

FOI_DEPTH = 20


class ExcludeAndBacktrack(ExcludingResponse):
    """At an alarm the fixes of the last n epochs are taken back, and GNSS is left out (FOI-R-5687, chapter 4).

    What a test needs several epochs to see has been used meanwhile. The report recomputes from 10 or 20 samples before
    the detection by dead reckoning and uses GNSS again as soon as its test is silent.

    Args:
        n: epochs.
        reuse: consecutive consistent fixes after which GNSS is used again; 0 = as soon as no detector alarms.
        reuse_threshold: of the NIS of a consistent fix; None = the chi-square quantile at 1e-3.

    Raises:
        ValueError: a value out of range, or a threshold without a number of fixes.
    """

    kind = "exclude-and-backtrack"

    def __init__(self, n: int = FOI_DEPTH, reuse: int = 0, reuse_threshold: float | None = None) -> None:
        self.n = validation.epochs(self.kind, "n", n, 1, validation.LONGEST_TABLE)
        super().__init__(reuse_rule(self.kind, reuse, reuse_threshold), self.n)

    @property
    def name(self) -> str:
        """The specification that builds this response."""
        return self._spell(self.n)

    def depth(self, epoch: Epoch) -> Runs:
        """n in every run, (N,)."""
        return np.full(len(epoch.index), self.n)
