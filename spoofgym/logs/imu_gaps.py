"""Gaps of the inertial samples, over which no filter can be led."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.table import seconds

MAX_IMU_GAP = 0.5
"""Longest time between inertial samples inside a game, s."""


def refuse_gaps(owner: str, time: Floats, begin: float, onset: float, end: float) -> None:
    """Refuse a gap between the alignment and the end of a game.

    Args:
        owner: whom the message names.
        time: of the samples, (n,), s, increasing.
        begin: of the alignment, s.
        onset: of the attack, s.
        end: of the game, s.

    Raises:
        ValueError: there is one; the message says how to leave it out.
    """
    gaps = np.flatnonzero((np.diff(time) > MAX_IMU_GAP) & (time[1:] > begin) & (time[:-1] < end))
    if len(gaps):
        at, length = time[gaps[0]], time[gaps[0] + 1] - time[gaps[0]]
        remedy = "a smaller horizon ends the game before it" if at > onset else "a later start_s begins after it"
        raise ValueError(
            f"{owner}: the IMU has a gap of {length:.3g} s at {seconds(at)} s; valid is at most {MAX_IMU_GAP:g} s "
            f"between the alignment at {seconds(begin)} s and the end of the game at {seconds(end)} s; {remedy}"
        )
