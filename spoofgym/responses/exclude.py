"""The two simplest responses: none, and leaving the fix out while an alarm lasts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spoofgym.navigation.interface import Decision, Demands, Epoch
from spoofgym.responses.base import Response


class AlwaysUse(Response):
    """Every fix is used, whatever the detectors say."""

    demands = Demands()

    @property
    def name(self) -> str:
        """The specification that builds this response."""
        return "always-use"

    def decide(self, epoch: Epoch, alarm: NDArray[np.bool_]) -> Decision:
        """Use it."""
        return Decision(np.ones_like(alarm))


class Exclude(Response):
    """The fix is left out while an alarm lasts, and the INS coasts."""

    @property
    def name(self) -> str:
        """The specification that builds this response."""
        return "exclude"

    def decide(self, epoch: Epoch, alarm: NDArray[np.bool_]) -> Decision:
        """Use it where there is no alarm."""
        return Decision(~alarm)
