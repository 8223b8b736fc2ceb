"""A spoofer at the level of measurements, with its delays (Liu et al. 2018, section 3.2, eqs 7 to 14)."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.attacks.base import Attack
from spoofgym.attacks.profiles import EAST, heading
from spoofgym.navigation.interface import Clock
from spoofgym.specification import spell

SPEED_OF_LIGHT = 299_792_458.0
"""m/s."""
DISTANCE = 500.0
PROCESSING = 1e-6
LONGEST_PROCESSING = 1.0
"""s: light goes 300,000 km in it."""


def control_delay(offset: Floats, clock: float, spoofer: Floats, processing: float, line_of_sight: Floats) -> Floats:
    """What the spoofer must add to each signal so that the receiver believes an offset and a clock (eq 13 solved).

    A replica that is sent as it was received takes the way by the spoofer: its range is longer than the authentic one
    by c ∇τ_proc + r_s→u + (r_s - r_u). The receiver shall see a change of -e s + c δt' instead, to first order in the
    offset s. The rest is

        c ∇τ_ctrl - c δt_adv = -e s + c δt' - c ∇τ_proc - r_s→u - (r_s - r_u),

    a delay where it is positive. Where it is negative the signal must leave before it has been received: its bits must
    be predicted by so much (δt_adv).

    Args:
        offset: s, (3,), m ENU.
        clock: c δt', m.
        spoofer: its position from the receiver, (3,), m ENU; near enough for one line of sight to serve both.
        processing: ∇τ_proc, s.
        line_of_sight: e, unit vectors from the receiver to the satellites, (S, 3), ENU.

    Returns:
        By satellite, (S,), m.
    """
    nearer = line_of_sight @ spoofer
    common = SPEED_OF_LIGHT * processing + float(np.sqrt(np.sum(spoofer**2)))
    return np.asarray(clock - common + nearer - line_of_sight @ offset)


class LiuSpoofer(Attack):
    """A spoofer that pulls position and time separately (Liu 2018, eqs 13 and 14).

    The spoofed ranges are the authentic ones plus c δt'_u,s, common to all satellites, plus c τ'_s, their own. The
    latter moves the position, by

        s(t) = α t h + b h      after the onset,

    synchronised with b = 0, unsynchronised else. What is common moves the clock alone, by

        c δt'(t) = (1 - advance) (c ∇τ_proc + r_s→u) + b_t + α_t t      after the onset:

    processing and the way from the spoofer to the receiver delay every signal alike, unless the spoofer predicts the
    bits and sends that much in advance (`control_delay`). The spoofer keeps its distance. A filter that takes fixes
    does not see the clock; one that takes ranges does. The spoofed rate of a range is that of the range.

    The equations are the paper's; a jump and a rate of the clock, and the share of the delay that is compensated, are
    how its free terms are filled here.

    Args:
        rate: α, m/s.
        direction: of h, azimuth, degrees clockwise from north.
        jump: b, m.
        clock_jump: b_t, m.
        clock_rate: α_t, m/s.
        processing: ∇τ_proc, s.
        distance: r_s→u, m.
        advance: share of both delays that is compensated, 0 to 1; 1 = a synchronised spoofer.
        onset: scenario time, s; None = the start of the game.

    Raises:
        ValueError: rate, jump, processing or distance is negative, advance is no share, or a value is not finite.
    """

    kind = "liu-spoofer"

    def __init__(
        self,
        rate: float,
        direction: float = EAST,
        jump: float = 0.0,
        clock_jump: float = 0.0,
        clock_rate: float = 0.0,
        processing: float = PROCESSING,
        distance: float = DISTANCE,
        advance: float = 1.0,
        onset: float | None = None,
    ) -> None:
        self.rate = validation.non_negative(self.kind, "rate", rate)
        self.direction = validation.finite(self.kind, "direction", direction)
        self.jump = validation.non_negative(self.kind, "jump", jump)
        self.clock_jump = validation.finite(self.kind, "clock_jump", clock_jump)
        self.clock_rate = validation.finite(self.kind, "clock_rate", clock_rate)
        self.processing = validation.non_negative(self.kind, "processing", processing, LONGEST_PROCESSING)
        self.distance = validation.non_negative(self.kind, "distance", distance)
        self.advance = validation.share(self.kind, "advance", advance)
        self.onset = None if onset is None else validation.time(self.kind, "onset", onset)
        self._heading = heading(self.direction)
        delay = SPEED_OF_LIGHT * self.processing + self.distance
        self._clock_jump = (1.0 - self.advance) * delay + self.clock_jump

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return spell(
            self.kind,
            self.rate,
            direction=None if self.direction == EAST else self.direction,
            jump=self.jump or None,
            clock_jump=self.clock_jump or None,
            clock_rate=self.clock_rate or None,
            processing=None if self.processing == PROCESSING else self.processing,
            distance=None if self.distance == DISTANCE else self.distance,
            advance=None if self.advance == 1.0 else self.advance,
            onset=self.onset,
        )

    def offset(self, clock: Clock) -> Floats:
        """s, (N, 3), m ENU."""
        along = self.rate * self.elapsed(clock) + self.jump * self.started(clock)
        return along[:, None] * self._heading

    def clock_offset(self, clock: Clock) -> Floats:
        """c δt', (N,), m."""
        return self.clock_rate * self.elapsed(clock) + self._clock_jump * self.started(clock)
