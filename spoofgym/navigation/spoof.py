"""What a spoofer makes the receivers of N runs believe at one epoch."""

from __future__ import annotations

from dataclasses import dataclass

from spoofgym.arrays import Flags, Floats


@dataclass(frozen=True)
class Spoof:
    """What a spoofer makes the receivers believe at an epoch.

    Attributes:
        offset: of the position, (N, 3), m ENU.
        rate: what is added to the velocity, (N, 3), m/s ENU; its own rate in a consistent attack.
        clock: offset of the receiver's clock, (N,), m. A receiver of fixes solves for its clock and does not show it.
        clock_rate: its rate, (N,), m/s.
        satellites: slots whose signal the receiver takes from the spoofer, (N, S); None = all.
        carrier: whether the carrier, and with it the range rate, follows the code, (N,); None = in every run.
        ranges: what a recorded attack adds to each range beside, (N, m), m and m/s; None = nothing.
    """

    offset: Floats
    rate: Floats
    clock: Floats
    clock_rate: Floats
    satellites: Flags | None = None
    carrier: Flags | None = None
    ranges: Floats | None = None
