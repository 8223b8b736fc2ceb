"""A response that excludes GNSS and goes back to the estimated onset of spoofing."""

from __future__ import annotations

from spoofgym import validation
from spoofgym.arrays import Runs
from spoofgym.navigation.interface import Epoch
from spoofgym.responses.excluding import ExcludingResponse
from spoofgym.responses.onset import WINDOW, OnsetEstimator
from spoofgym.responses.reuse import reuse_rule

DEFAULT_MARGIN = 2


class OnsetDepth(ExcludingResponse):
    """At an alarm the onset is estimated, and the fixes since then are taken back.

    The estimate is that of `OnsetEstimator`: of the last n whitened horizontal innovations, the present one counted,
    the n that maximises |sum|²/n. The depth is n plus a margin, for an estimate that comes late spoils what follows
    while one that comes early only costs a little more coasting.

    Args:
        margin: epochs beyond the estimate.
        window: epochs among which the onset is looked for.
        reuse: consecutive consistent fixes after which GNSS is used again; 0 = as soon as no detector alarms.
        reuse_threshold: of the NIS of a consistent fix; None = the chi-square quantile at 1e-3.

    Raises:
        ValueError: a value out of range, or a threshold without a number of fixes.
    """

    kind = "onset-depth"

    def __init__(
        self,
        margin: int = DEFAULT_MARGIN,
        window: int = WINDOW,
        reuse: int = 0,
        reuse_threshold: float | None = None,
    ) -> None:
        self.margin = validation.epochs(self.kind, "margin", margin, 0, validation.LONGEST_TABLE)
        self.window = validation.epochs(self.kind, "window", window, 1, validation.LONGEST_TABLE)
        super().__init__(reuse_rule(self.kind, reuse, reuse_threshold), self.window + self.margin)

    @property
    def name(self) -> str:
        """The specification that builds this response."""
        return self._spell(
            margin=None if self.margin == DEFAULT_MARGIN else self.margin,
            window=None if self.window == WINDOW else self.window,
        )

    def bind(self, num_runs: int) -> None:
        """Allocate the innovations of the window."""
        super().bind(num_runs)
        self._onset = OnsetEstimator(num_runs, self.window)

    def reset(self, runs: Runs) -> None:
        """Forget the innovations of these runs."""
        super().reset(runs)
        self._onset.reset(runs)

    def watch(self, epoch: Epoch) -> None:
        """Remember the whitened innovation."""
        self._onset.push(epoch.innovation.whitened)

    def depth(self, epoch: Epoch) -> Runs:
        """Epochs since the estimated onset plus the margin, (N,)."""
        return self._onset.estimate()[0] + self.margin
