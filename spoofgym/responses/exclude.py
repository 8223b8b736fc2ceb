"""The simplest responses: use every fix or none, leave fixes out while an alarm lasts, or leave GNSS out for good."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags
from spoofgym.navigation.interface import Decision, Demands, Epoch
from spoofgym.responses.base import Response
from spoofgym.responses.excluding import ExcludingResponse
from spoofgym.responses.reuse import Never, reuse_rule


class AlwaysUse(Response):
    """Every fix is used, whatever the detectors say."""

    demands = Demands()

    @property
    def name(self) -> str:
        """The specification that builds this response."""
        return "always-use"

    def decide(self, epoch: Epoch, alarm: Flags) -> Decision:
        """Use it."""
        return Decision(np.ones_like(alarm))


class AlwaysExclude(Response):
    """No fix of the game is used, whatever the detectors say: the yardstick of a defender who trusts nobody."""

    demands = Demands(excludes=True)

    @property
    def name(self) -> str:
        """The specification that builds this response."""
        return "always-exclude"

    def decide(self, epoch: Epoch, alarm: Flags) -> Decision:
        """Leave it out."""
        return Decision(np.zeros_like(alarm))


class Exclude(ExcludingResponse):
    """The fix is left out from an alarm on, and the INS coasts; nothing is taken back.

    Args:
        reuse: consecutive consistent fixes after which GNSS is used again; 0 = as soon as no detector alarms.
        reuse_threshold: of the NIS of a consistent fix; None = the chi-square quantile at 1e-3.

    Raises:
        ValueError: a value out of range, or a threshold without a number of fixes.
    """

    kind = "exclude"

    def __init__(self, reuse: int = 0, reuse_threshold: float | None = None) -> None:
        super().__init__(reuse_rule(self.kind, reuse, reuse_threshold))


class Latch(ExcludingResponse):
    """The first alarm excludes GNSS for good."""

    kind = "latch"

    def __init__(self) -> None:
        super().__init__(Never())
