"""Which alignment a log gets: the one that is asked for, or the first that its contents allow."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from spoofgym import validation
from spoofgym.geodesy import position_difference
from spoofgym.logs.alignment.base import Alignment
from spoofgym.logs.alignment.coarse import GOOD_SIGMA, WINDOWS, coarse, match
from spoofgym.logs.alignment.course import by_course
from spoofgym.logs.alignment.own_attitude import TABLE, by_own_attitude
from spoofgym.logs.alignment.rest import at_rest, resting_fixes, without_motion
from spoofgym.logs.log import Log
from spoofgym.logs.notes import ALIGNMENTS
from spoofgym.logs.table import has_table, seconds

METHODS = ALIGNMENTS
AUTO = METHODS[0]
NEAR = 20.0
"""Of a hovering vehicle, median distance from its start, m."""
MOST_APART = np.radians(30.0)
"""Between course and heading of a vehicle that drives forward, rad."""


def align(log: Log, method: str | None = None, least_speed: float | None = None) -> Alignment:
    """Align a log.

    Args:
        log: with body axes.
        method: one of `METHODS`; None = what ``log.toml`` says, else "auto".
        least_speed: whose course is trusted as heading, m/s; None = as in `by_course`.

    Raises:
        ValueError: the method is unknown, or the log does not allow it, or any.
    """
    method = (log.alignment or AUTO) if method is None else validation.one_of("recorded", "alignment", method, METHODS)
    if method == AUTO:
        return _first_that_fits(log, least_speed)
    if method == "course":
        return by_course(log, least_speed)
    return {"static": at_rest, "attitude": by_own_attitude, "coarse": coarse}[method](log)


def _first_that_fits(log: Log, least_speed: float | None) -> Alignment:
    """A stated heading counts most, then the attitude of the log, the course, and what the accelerations tell.

    Raises:
        ValueError: none fits; the message is that of the course.
    """
    if log.heading is not None:
        return without_motion(log, _first_fix(log), "heading")
    if has_table(log.folder, TABLE):
        # an attitude of other axes, such as a phone's, or one that begins later is passed over
        with suppress(ValueError):
            return by_own_attitude(log)
    try:
        found = by_course(log, least_speed)
    except ValueError as error:
        return _without_course(log, error)
    begin = float(log.fixes.time[found.fix])
    for length in WINDOWS[:3]:
        matched = match(log, begin, begin + length)
        if matched is not None and matched.heading_sigma <= GOOD_SIGMA:
            apart = Alignment("", 0, matched.before, found.velocity, found.attitude_sigma).heading - found.heading
            return found if np.cos(apart) > np.cos(MOST_APART) else coarse(log)
    return found


def _without_course(log: Log, error: ValueError) -> Alignment:
    """The alignment of a vehicle that does not move forward, or not at all."""
    try:
        return coarse(log)
    except ValueError:
        pass
    resting = np.flatnonzero(resting_fixes(log))
    if len(resting):
        return without_motion(log, int(resting[0]), "static")
    if not _stays(log):
        raise ValueError(f"{error}; or state heading_deg in log.toml") from None
    return without_motion(log, _first_fix(log), "hover")


def _stays(log: Log) -> bool:
    """Whether the vehicle stays near the place where it starts, so that its heading hardly matters."""
    track = position_difference(log.fixes.position, log.fixes.position[_first_fix(log)])
    return bool(np.median(np.hypot(track[:, 0], track[:, 1])) <= NEAR)


def _first_fix(log: Log) -> int:
    """The first fix from the log's start on that has others, and inertial samples, around it.

    Raises:
        ValueError: there is none.
    """
    time = log.fixes.time
    fits = (time >= max(log.start, log.imu_time[0])) & (time <= log.imu_time[-1])
    fits[[0, -1]] = False
    if not fits.any():
        raise ValueError(f"log {str(log.folder)!r}: no fix after start_s = {seconds(log.start)} s to align at")
    return int(np.flatnonzero(fits)[0])
