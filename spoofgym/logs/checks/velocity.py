"""Velocities of fixes against the differences of their positions: swapped columns, other units, wrong signs.

Each likely mistake is a matrix that turns the velocity in the log into the one that the positions show. A mistake is
named where its matrix explains the positions and the velocity as it stands does not.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.geodesy import position_difference
from spoofgym.logs.checks.finding import Finding
from spoofgym.logs.log import Fixes

LONGEST_STEP = 3.0
"""Longest time between two fixes that are compared, s."""
MOVING = 2.0
"""Least speed, by the positions or the velocities, of an interval that tells something, m/s."""
FEWEST = 10
"""Least number of intervals that tell something."""
SUSPICIOUS, UNEXPLAINED = 0.12, 0.3
"""Share of the squared ways between fixes that the velocity leaves unexplained, from which on a mistake is looked for,
and from which on it is told even if none is found."""
EXPLAINED = 0.1
"""Largest share that a mistake leaves unexplained which is named."""
LEAP = 5.0
"""Way between two fixes over the usual one from which on it is a leap, which says nothing of the velocity."""
VERTICAL_WAY = 10.0
"""Least root of the sum of the squared steps in height that tell something, m."""
UNITS = {
    "in knots": (1852.0 / 3600.0, "multiply vn_mps, ve_mps and vd_mps by 0.5144"),
    "in km/h": (1.0 / 3.6, "divide vn_mps, ve_mps and vd_mps by 3.6"),
    "in mph": (0.44704, "multiply vn_mps, ve_mps and vd_mps by 0.44704"),
    "in feet per second": (0.3048, "multiply vn_mps, ve_mps and vd_mps by 0.3048"),
    "in cm/s": (0.01, "divide vn_mps, ve_mps and vd_mps by 100"),
    "in mm/s": (0.001, "divide vn_mps, ve_mps and vd_mps by 1000"),
}
RADIANS = float(np.radians(1.0))


def check_velocity(fixes: Fixes, start: float, file: str = "gnss.csv") -> Iterator[Finding]:
    """Findings about the velocity of fixes from the log's start on; none where there is no velocity or no motion.

    Args:
        fixes: of the receiver, or a reference.
        start: of the log, s.
        file: that they were read from.
    """
    if fixes.velocity is None:
        return
    used = np.flatnonzero(fixes.time >= start)
    if len(used) <= FEWEST:
        return
    time, velocity, position = fixes.time[used], fixes.velocity[used], fixes.position[used]
    duration = np.diff(time)
    way = np.diff(position_difference(position, position[0]), axis=0)
    told = 0.5 * (velocity[1:] + velocity[:-1]) * duration[:, None]
    fast = np.maximum(np.hypot(*way[:, :2].T), np.hypot(*told[:, :2].T)) > MOVING * duration
    fast &= (duration > 0.0) & (duration <= max(LONGEST_STEP, 2.0 * float(np.median(duration))))
    size = np.linalg.norm(way[:, :2], axis=1)
    if fast.any():
        fast &= size <= LEAP * np.median(size[fast])
    if np.count_nonzero(fast) >= FEWEST:
        yield from _horizontal(way[fast, :2], told[fast, :2], position[0], file)
    short = (duration > 0.0) & (duration <= max(LONGEST_STEP, 2.0 * float(np.median(duration))))
    yield from _vertical(way[short, 2], told[short, 2], file)


def _horizontal(way: Floats, told: Floats, place: Floats, file: str) -> Iterator[Finding]:
    """Ways (n, 2) and what the velocities say of them (n, 2), m, east and north."""
    before = unexplained(way, told)
    if before <= SUSPICIOUS:
        return
    mistakes = _mistakes(place)
    shares = {name: unexplained(way, told @ matrix.T) for name, (matrix, _) in mistakes.items()}
    best = min(shares, key=lambda name: shares[name])
    if shares[best] <= EXPLAINED and shares[best] < before / 3.0:
        yield Finding("error", file, f"{best}: the differences of the positions say so", mistakes[best][1], 1)
        return
    if before <= UNEXPLAINED:
        return
    correlation = float((way * told).sum() / np.sqrt(max(float((way**2).sum() * (told**2).sum()), 1e-300)))
    ratio = float(np.sqrt((way**2).sum() / max(float((told**2).sum()), 1e-300)))
    yield Finding(
        "warning",
        file,
        f"the velocity does not fit the differences of the positions (correlation {correlation:.2f}, these are "
        f"{ratio:.3g} times as large)",
        "velocity=false leaves the velocity out of the filter; look at its columns, units, signs and times",
        1,
    )


def unexplained(way: Floats, told: Floats) -> float:
    """Share of the squared ways, by the largest of both, that is not explained."""
    return float(((way - told) ** 2).sum() / max(float((way**2).sum()), float((told**2).sum()), 1e-300))


def _mistakes(place: Floats) -> dict[str, tuple[Floats, str]]:
    """By name: what turns the velocity in the log into that of the positions, east and north, and what to do."""
    same, swap = np.eye(2), np.array([[0.0, 1.0], [1.0, 0.0]])
    latitude, longitude = float(place[0]), float(place[1])
    # positions with latitude and longitude exchanged: steps in longitude are stretched as at the wrong latitude
    exchanged = np.array([[0.0, np.cos(latitude)], [1.0 / max(np.cos(longitude), 0.01), 0.0]])
    # positions in radians: steps in longitude are stretched as near to the equator
    radians = RADIANS * np.diag([np.cos(latitude) / np.cos(np.clip(latitude / RADIANS, -1.5, 1.5)), 1.0])
    result = {f"the velocity is {unit}": (factor * same, advice) for unit, (factor, advice) in UNITS.items()}
    result |= {
        "vn_mps and ve_mps are swapped": (swap, "exchange the two columns"),
        "lat_deg and lon_deg are swapped": (exchanged, "exchange the two columns"),
        "vn_mps and ve_mps have the wrong sign": (-same, "multiply both by -1"),
        "ve_mps has the wrong sign": (np.diag([-1.0, 1.0]), "multiply it by -1: it is positive to the east"),
        "vn_mps has the wrong sign": (np.diag([1.0, -1.0]), "multiply it by -1: it is positive to the north"),
        "lat_deg and lon_deg are in radians": (radians, "multiply both by 57.29578"),
        "vn_mps and ve_mps are swapped and in knots": (1852.0 / 3600.0 * swap, "exchange them, and times 0.5144"),
    }
    return result


def _vertical(way: Floats, told: Floats, file: str) -> Iterator[Finding]:
    """Steps in height (n,) and what the vertical velocities say of them, m, up."""
    if len(way) < FEWEST or not told.any() or float((way**2).sum()) < VERTICAL_WAY**2:
        return
    before = unexplained(way, told)
    mistakes = {
        "vd_mps is positive upwards": (-1.0, "multiply it by -1: it is positive downwards"),
        "h_m is in feet": (1.0 / 0.3048, "multiply it by 0.3048"),
        "h_m is in millimetres": (1000.0, "divide it by 1000"),
    }
    shares = {name: unexplained(way, factor * told) for name, (factor, _) in mistakes.items()}
    best = min(shares, key=lambda name: shares[name])
    if before > 0.8 and shares[best] < 0.5:
        yield Finding("error", file, f"{best}: the differences of the heights say so", mistakes[best][1], 1)
