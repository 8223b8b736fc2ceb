"""Whether the reference of a recorded log fits its fixes.

What contradicts itself and the fixes is left out: a position that stands still while the vehicle drives on. What only
contradicts the fixes is told, since they may be wrong.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from spoofgym.arrays import Flags
from spoofgym.geodesy import position_difference
from spoofgym.logs.log import Fixes, Log, covered, interpolate
from spoofgym.logs.log_warning import warn

APART = 3.0
"""Median distance between fixes and reference that is too large, over the median sigma of the fixes."""
UNSTATED_SIGMA = 3.5
"""Horizontal 1 sigma of fixes that state none, m."""
LEAST_SIGMA = 1.0
"""Least sigma of fixes that a reference is compared with, m: it may hold for another point of the vehicle."""


FAR = 50.0
"""Least distance between a row of the reference and the fixes around it of which a warning tells, m."""
FAR_SHARE = 10.0
"""Least ratio of this distance to the larger of the median distance and the sigma of the fixes."""
FROZEN = 1.0
"""Time for which a reference may repeat a position of a vehicle that drives, s."""
MOVING = 0.5
"""Speed from which on a vehicle moves, m/s."""
SUDDEN = 3.0
"""Speed to the next position that shows that a reference has stood still and the vehicle has not, m/s."""
WAY = 5.0
"""Way of a vehicle that does not stand, over the sigma of the fixes."""


def checked_reference(log: Log) -> Log:
    """The log without the rows of its reference that are frozen.

    Warns:
        LogWarning: rows are left out; fixes lie far from the reference, all of them or some.
    """
    if log.reference is None:
        return log
    frozen = frozen_rows(log.reference, log.fixes)
    if np.count_nonzero(~frozen) >= 2 and frozen.any():
        _tell(
            log,
            frozen & (log.reference.time >= log.start),
            f"repeat a position for more than {FROZEN:g} s while the fixes move on, and are left out",
        )
        log = replace(log, reference=_rows(log.reference, ~frozen))
    check_reference(log)
    check_rows(log)
    return log


def frozen_rows(reference: Fixes, fixes: Fixes) -> Flags:
    """Rows that repeat the position of the one before, for longer than `FROZEN`, while the fixes move on, (n,).

    A vehicle that stands comes to a halt and drives off by and by, and its own velocity is none. A tracker that freezes
    stops at once, or leaps when it goes on.
    """
    time, place = reference.time, reference.position[:, :2]
    first = np.flatnonzero(np.concatenate([[True], (np.diff(place, axis=0) != 0.0).any(axis=1)]))
    last = np.concatenate([first[1:], [len(time)]]) - 1
    frozen = np.zeros(len(time), dtype=bool)
    long = time[last] - time[first] > FROZEN
    if not long.any():
        return frozen
    track = position_difference(reference.position, reference.position[0])[:, :2]
    speed = np.hypot(*(np.diff(track, axis=0) / np.diff(time)[:, None]).T)
    sigma = max(_sigma(fixes, np.ones(len(fixes.time), dtype=bool)), LEAST_SIGMA)
    known = np.flatnonzero(covered(fixes, time))
    moved, velocity = interpolate(fixes, time[known])
    moving = np.hypot(*velocity[:, :2].T) > MOVING
    for begin, end in zip(first[long], last[long], strict=True):
        inside = slice(*np.searchsorted(known, [begin, end + 1]))
        rows = known[inside]
        if len(rows) < 2:
            continue
        own = 0.0 if reference.velocity is None else np.median(np.hypot(*reference.velocity[rows, :2].T))
        leap = max(speed[begin - 1] if begin else 0.0, speed[end] if end < len(speed) else 0.0)
        way = np.hypot(*position_difference(moved[inside], moved[inside][0])[:, :2].T).max()
        if way > WAY * sigma and (leap > SUDDEN or own > MOVING):
            frozen[rows] = moving[inside] & (rows > begin)
    return frozen


def check_rows(log: Log) -> None:
    """Warn of rows of the reference that lie far from the fixes around them, where the others do not.

    Warns:
        LogWarning: how many do, and the line of the first one.
    """
    assert log.reference is not None
    reference, fixes = log.reference, log.fixes
    used = np.flatnonzero((reference.time >= log.start) & covered(fixes, reference.time))
    if len(used) < 3:
        return
    place = interpolate(fixes, reference.time[used])[0]
    distance = np.hypot(*position_difference(reference.position[used], place)[:, :2].T)
    sigma = np.full(len(used), UNSTATED_SIGMA)
    if fixes.position_sigma is not None:
        sigma = np.interp(reference.time[used], fixes.time, np.hypot(*fixes.position_sigma[:, :2].T))
    usual = np.maximum(sigma, float(np.median(distance)))
    far = np.zeros(len(reference.time), dtype=bool)
    far[used] = distance > np.maximum(FAR, FAR_SHARE * usual) + float(np.linalg.norm(log.lever_arm))
    _tell(
        log,
        far,
        f"lie more than {FAR:g} m from the fixes around them (up to {distance.max():.0f} m, median "
        f"{np.median(distance):.1f} m): the reference or the fixes are wrong there",
    )


def _tell(log: Log, rows: Flags, what: str) -> None:
    """Warn of rows of the reference, (n,), where there are any."""
    if rows.any():
        assert log.reference is not None
        place = int(np.argmax(rows))
        line = place + 2 if log.reference.lines is None else int(log.reference.lines[place])
        text = f"reference.csv: {rows.sum()} of {len(rows)} rows {what}; the first is line {line}"
        warn(log.folder, text, line)


def _rows(solution: Fixes, kept: Flags) -> Fixes:
    def cut(values: Any) -> Any:
        return None if values is None else values[kept]

    return Fixes(**{item.name: cut(getattr(solution, item.name)) for item in fields(solution)})


def _sigma(fixes: Fixes, used: Flags) -> float:
    """Median horizontal 1 sigma of some fixes, m."""
    if fixes.position_sigma is None:
        return UNSTATED_SIGMA
    return float(np.median(np.hypot(*fixes.position_sigma[used, :2].T)))


def check_reference(log: Log) -> None:
    """Warn where the fixes lie far from the reference.

    Warns:
        LogWarning: the distances, and the shift in time that makes them smaller, if there is one.
    """
    if log.reference is None:
        return
    used = (log.fixes.time >= log.start) & covered(log.reference, log.fixes.time)
    if np.count_nonzero(used) < 3:
        return
    place, velocity = interpolate(log.reference, log.fixes.time[used])
    apart = position_difference(log.fixes.position[used], place)[:, :2]
    sigma = _sigma(log.fixes, used)
    distance = float(np.median(np.hypot(*apart.T)))
    if distance <= APART * max(sigma, LEAST_SIGMA) + float(np.linalg.norm(log.lever_arm)):
        return
    speed = np.square(velocity[:, :2]).sum()
    delay = float((apart * velocity[:, :2]).sum() / speed) if speed > 0.0 else 0.0
    left = float(np.median(np.hypot(*(apart - delay * velocity[:, :2]).T)))
    shift = f"; with the times of the reference {-delay:+.2f} s it is {left:.1f} m" if left < distance / 2.0 else ""
    warn(
        log.folder,
        f"reference: the fixes lie {distance:.1f} m from it (median), their sigma is {sigma:.1f} m{shift}; likely "
        "reasons: another clock (UTC against GPS time: 18 s), another datum, a point of the vehicle far from the "
        "antenna, fixes that were spoofed",
    )
