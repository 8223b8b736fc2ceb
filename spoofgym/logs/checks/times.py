"""Times of fixes: their unit, and steps of their clock that the way between two fixes contradicts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.geodesy import position_difference
from spoofgym.logs.checks.finding import Finding
from spoofgym.logs.log import Fixes

SLOWEST_FIXES = 60.0
"""Longest usual time between fixes that can be one, s."""
FAST = 4.0
"""Speed at both ends of an interval that tells how long it was, m/s."""
STEP = 0.45
"""Least difference between an interval and the time that its way took that is told, s."""
LARGEST_STEP = 25.0
"""Difference from which on the fix has leapt, and not its clock, s."""
HOLE = 5.0
"""Time without fixes that is told, s, and usual intervals, whichever is longer."""


def check_fix_times(time: Floats) -> Iterator[Finding]:
    """Whether the times of fixes, (n,), can be seconds."""
    step = float(np.median(np.diff(time)))
    if step > SLOWEST_FIXES:
        unit, factor = ("milliseconds", 1e3) if step < 1e5 else ("microseconds", 1e6)
        text = f"a fix comes each {step:g} s: t_s seems to be in {unit}"
        yield Finding("error", "gnss.csv", text, f"divide t_s by {factor:g}", 1)


def check_steps(fixes: Fixes, start: float) -> Iterator[Finding]:
    """Steps of the clock of fixes with velocities, and holes, from the log's start on."""
    used = np.flatnonzero(fixes.time >= start)
    if len(used) < 10:
        return
    time = fixes.time[used]
    interval = np.diff(time)
    usual = float(np.median(interval))
    holes = np.flatnonzero(interval > max(HOLE, 5.0 * usual))
    if len(holes):
        longest = holes[np.argmax(interval[holes])]
        text = f"{len(holes)} holes of more than {max(HOLE, 5 * usual):.3g} s; the longest is {interval[longest]:.3g} s"
        advice = "the filter coasts there"
        yield Finding("note", "gnss.csv", text, advice, _line(fixes, used[longest + 1]))
    if fixes.velocity is None:
        return
    velocity = fixes.velocity[used]
    speed = np.linalg.norm(velocity[:, :2], axis=1)
    track = position_difference(fixes.position[used], fixes.position[used[0]])[:, :2]
    way = np.linalg.norm(np.diff(track, axis=0), axis=1)
    fast = (np.minimum(speed[1:], speed[:-1]) > FAST) & (interval < 10.0) & (np.abs(np.diff(speed)) < 2.0)
    taken = way / np.maximum(0.5 * (speed[1:] + speed[:-1]), 1e-9)
    off = np.where(fast & (np.abs(interval - taken) < LARGEST_STEP), interval - taken, 0.0)
    large = np.flatnonzero(np.abs(off) > STEP + 0.25 * usual)
    if 1 <= len(large) <= max(3, int(fast.sum()) // 50):
        first = large[0]
        whole = abs(abs(off[first]) - round(abs(off[first]))) < 0.2
        reason = "a leap second, or a clock that was set" if whole else "a clock that was set, or fixes that leap"
        yield Finding(
            "warning",
            "gnss.csv",
            f"t_s steps by {interval[first]:.3g} s where the way took {taken[first]:.2g} s, {len(large)} such steps",
            f"{reason}: subtract {off[first]:.1f} s from all later times, if the IMU's clock has no such step",
            _line(fixes, used[first + 1]),
        )


def _line(fixes: Fixes, row: int) -> int:
    return int(row) + 2 if fixes.lines is None else int(fixes.lines[row])
