"""FusionRipper: a constant offset beside the road, then an exponential one (Shen et al. 2020)."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.attacks.fixed_offsets import FixedOffsets
from spoofgym.specification import spell
from spoofgym.travel import SIDES, lateral
from spoofgym.validation import written

SCALE = 1.2
LARGEST_FACTOR = 1e300
"""The growth is computed in the logarithm: any factor is valid."""
WAIT = 10.0
LIMIT = 1000.0


class FusionRipper(FixedOffsets):
    """Two stages at right angles to the direction of travel (Shen et al., USENIX Security 2020).

    Stage 1, vulnerability profiling: a constant offset of d metres. Stage 2, aggressive spoofing: d · f^i, which a
    filter that has lost its other sources follows. Our readings: i is the time since stage 2 began in seconds, a real
    number, which at the paper's 1 Hz is its count of fixes. The paper's spoofer begins stage 2 when it sees the victim
    deviate; this one is blind and begins after a fixed wait. The paper ends the attack when the vehicle has left its
    lane; here the offset stays at ``limit``. "Lateral" is that of the true velocity of the present epoch, so that the
    offset turns with the vehicle.

    Args:
        d: offset of stage 1, m.
        f: factor per second in stage 2.
        wait: length of stage 1, s.
        side: "left" or "right" of the direction of travel.
        limit: largest offset, m.
        onset: scenario time, s; None = the start of the game.

    Raises:
        ValueError: d or the wait is negative, f is less than 1, the limit is less than d, a side that does not exist,
            or a value is not finite.
    """

    def __init__(
        self,
        d: float,
        f: float = SCALE,
        wait: float = WAIT,
        side: str = "right",
        limit: float = LIMIT,
        onset: float | None = None,
    ) -> None:
        self.d = validation.zero_or_above("fusion-ripper", "d", d)
        self.f = validation.finite("fusion-ripper", "f", f, LARGEST_FACTOR)
        if self.f < 1.0:
            raise ValueError(f"fusion-ripper: f must be 1 or more, got {f!r}")
        self.wait = validation.non_negative("fusion-ripper", "wait", wait)
        self.side = validation.one_of("fusion-ripper", "side", side, SIDES)
        self.limit = validation.finite("fusion-ripper", "limit", limit)
        if self.limit < self.d:
            raise ValueError(f"fusion-ripper: limit must be d = {written(self.d)} m or more, got {limit!r}")
        self.onset = None if onset is None else validation.time("fusion-ripper", "onset", onset)

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return spell(
            "fusion-ripper",
            self.d,
            f=None if self.f == SCALE else self.f,
            wait=None if self.wait == WAIT else self.wait,
            side=None if self.side == "right" else self.side,
            limit=None if self.limit == LIMIT else self.limit,
            onset=self.onset,
        )

    def follow(self, velocity: Floats) -> None:
        """Take the vehicle's true velocity at the moments of the game's steps, (M+1, 3), ENU, m/s.

        Raises:
            ValueError: the vehicle never moves.
        """
        _, _, epochs = self._timeline.steps
        self._lay(self._distance(self._since())[:, None] * lateral(velocity, self.side)[epochs])

    def _distance(self, since: Floats) -> Floats:
        """The offset's length at times since the onset (n,), m."""
        if self.d == 0.0:
            return np.zeros_like(since)
        # in the logarithm, so that the cut at the limit comes before an overflow
        growth = np.maximum(since - self.wait, 0.0) * np.log(self.f)
        return self.d * np.exp(np.minimum(growth, np.log(self.limit / self.d)))
