"""A response that excludes GNSS and goes back to a stretch of constant velocity (proposed by FOI-R-5687)."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Runs
from spoofgym.navigation.interface import Epoch
from spoofgym.responses.backtrack import FOI_DEPTH
from spoofgym.responses.excluding import ExcludingResponse
from spoofgym.responses.reuse import reuse_rule

DEFAULT_LONGEST = 60
DEFAULT_ACCELERATION = 0.5
DEFAULT_HOLD = 3.0


class ConstantVelocityStart(ExcludingResponse):
    """At an alarm fixes are taken back to the latest epoch, n or more back, until which the velocity was constant.

    FOI-R-5687 blames the failure of its scenario 5 on a dead reckoning that starts in a change of speed, and proposes
    to look for consecutive samples of constant velocity. Speed and heading are constant where the horizontal
    acceleration is small, which asks for no heading at rest. It is the change of the estimated velocity from epoch to
    epoch, so the filter's corrections count, too. If there is no such epoch the backtrack is n.

    Args:
        n: least number of epochs.
        longest: greatest number of epochs, n or more.
        acceleration: below which the velocity is constant, m/s².
        hold: for how long it must have been constant, s.
        reuse: consecutive consistent fixes after which GNSS is used again; 0 = as soon as no detector alarms.
        reuse_threshold: of the NIS of a consistent fix; None = the chi-square quantile at 1e-3.

    Raises:
        ValueError: a value out of range, or a threshold without a number of fixes.
    """

    kind = "constant-velocity-start"

    def __init__(
        self,
        n: int = FOI_DEPTH,
        longest: int = DEFAULT_LONGEST,
        acceleration: float = DEFAULT_ACCELERATION,
        hold: float = DEFAULT_HOLD,
        reuse: int = 0,
        reuse_threshold: float | None = None,
    ) -> None:
        self.n = validation.epochs(self.kind, "n", n, 1, validation.LONGEST_TABLE)
        self.longest = validation.epochs(self.kind, "longest", longest, 1, validation.LONGEST_TABLE)
        if self.longest < self.n:
            raise ValueError(
                f"{self.kind}: longest must be a whole number, {self.n} or more, got {self.longest}: not less than n"
            )
        self.acceleration = validation.above(self.kind, "acceleration", acceleration)
        self.hold = validation.above(self.kind, "hold", hold)
        super().__init__(reuse_rule(self.kind, reuse, reuse_threshold), self.longest)

    @property
    def name(self) -> str:
        """The specification that builds this response."""
        return self._spell(
            self.n,
            longest=None if self.longest == DEFAULT_LONGEST else self.longest,
            acceleration=None if self.acceleration == DEFAULT_ACCELERATION else self.acceleration,
            hold=None if self.hold == DEFAULT_HOLD else self.hold,
        )

    def bind(self, num_runs: int) -> None:
        """Allocate which of the last epochs ended a stretch of constant velocity, the newest first."""
        super().bind(num_runs)
        self._velocity = np.full((num_runs, 2), np.nan)
        self._time = np.full(num_runs, np.nan)
        self._held = np.zeros(num_runs)
        self._steady = np.zeros((num_runs, self.longest + 2), dtype=bool)

    def reset(self, runs: Runs) -> None:
        """Forget the velocities of these runs."""
        super().reset(runs)
        self._velocity[runs], self._time[runs] = np.nan, np.nan
        self._held[runs], self._steady[runs] = 0.0, False

    def watch(self, epoch: Epoch) -> None:
        """See the estimated velocity.

        Raises:
            ValueError: the epoch was made without a navigator.
        """
        if epoch.view is None:
            raise ValueError(f"{self.kind} needs the estimated velocity, and the epoch has no view of the filter")
        velocity, elapsed = epoch.view.velocity[:, :2], epoch.time - self._time
        constant = self._constant(velocity - self._velocity, elapsed)
        self._held = np.where(constant, self._held + elapsed, 0.0)
        self._steady[:, 1:] = self._steady[:, :-1]
        # times are sums of intervals: rounding must not cost an epoch
        self._steady[:, 0] = self._held >= self.hold - 1e-6
        self._velocity, self._time = velocity.copy(), epoch.time.copy()

    def _constant(self, change: np.ndarray, elapsed: np.ndarray) -> Flags:
        """|Δv| < a Δt; false in the first epoch, (N,)."""
        return change[:, 0] ** 2 + change[:, 1] ** 2 < (self.acceleration * elapsed) ** 2

    def depth(self, epoch: Epoch) -> Runs:
        """Least depth, n or more, that starts where the velocity was constant, else n, (N,).

        A backtrack of d epochs starts from the state of the epoch before them, d + 1 back.
        """
        starts = self._steady[:, self.n + 1 :]
        return self.n + np.where(starts.any(axis=1), starts.argmax(axis=1), 0)
