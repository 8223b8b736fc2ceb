"""Fixes by themselves: rows that repeat, positions with few digits, columns of a status, sigmas nobody has, heights."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.geodesy import position_difference
from spoofgym.logs.checks.finding import Finding
from spoofgym.logs.log import Fixes, Log, covered, interpolate, velocity_of
from spoofgym.logs.table import has_table, read_cells, table_path

MOVING = 2.0
"""Speed of a vehicle that moves, m/s."""
REPEATED = 3
"""Positions in a row that are the same while the vehicle moves, from which on it is told."""
COARSE = 0.5
"""Least step of the positions that is told, m."""
TINY_SIGMA = 1e-3
"""Sigma below which none is believed, m."""
STATUS = ("fix_q", "fix_type", "fix", "quality", "status", "gps_status", "fix_quality", "fix_status", "valid")
"""Columns that may tell whether a row is a fix; receivers disagree, so that none is used."""
FAR = 2000.0
"""Distance from the reference that no fix has, m."""
HEIGHTS_APART = 8.0
"""Median difference of heights between fixes and reference that is told, m."""


def check_fixes(log: Log) -> Iterator[Finding]:
    """Findings about the fixes of a log from its start on."""
    fixes = log.fixes
    used = np.flatnonzero(fixes.time >= log.start)
    if len(used) >= 10:
        yield from _check_repeated(fixes, used)
        yield from _check_digits(fixes, used)
        yield from _check_sigmas(fixes, used)
    yield from _check_heights(log)


def _check_repeated(fixes: Fixes, used: np.ndarray) -> Iterator[Finding]:
    place = fixes.position[used, :2]
    same = np.concatenate([[False], (np.diff(place, axis=0) == 0.0).all(axis=1)])
    speed = np.zeros(len(used))
    if fixes.velocity is not None:
        speed = np.linalg.norm(fixes.velocity[used, :2], axis=1)
    runs = np.zeros(len(used), dtype=np.int64)
    for k in np.flatnonzero(same).tolist():
        runs[k] = runs[k - 1] + 1
    if fixes.velocity is None:  # without a velocity: half of the rows repeat, the others leap
        share = float(np.mean(same))
        moving = share > 0.2 and _leaps(fixes, used, same)
        frozen = same if moving else np.zeros(len(used), dtype=bool)
    else:
        frozen = (runs >= REPEATED) & (speed > MOVING)
    if frozen.any():
        line = _line(fixes, int(used[np.argmax(frozen)]))
        text = f"{int(frozen.sum())} of {len(used)} rows repeat the position before while the vehicle moves"
        advice = "a recorder that is faster than the receiver: leave these rows out"
        yield Finding("warning", "gnss.csv", text, advice, line)


def _leaps(fixes: Fixes, used: np.ndarray, same: np.ndarray) -> bool:
    """Whether the rows that do not repeat a position go on as a vehicle does."""
    own = used[~same]
    if len(own) < 5:
        return False
    track = position_difference(fixes.position[own], fixes.position[own[0]])[:, :2]
    speed = np.linalg.norm(np.diff(track, axis=0), axis=1) / np.diff(fixes.time[own])
    return bool(np.median(speed) > MOVING)


def _check_digits(fixes: Fixes, used: np.ndarray) -> Iterator[Finding]:
    """Positions in steps that are large: too few digits, or single precision."""
    track = position_difference(fixes.position[used], fixes.position[used[0]])[:, :2]
    for axis, name in ((0, "lon_deg"), (1, "lat_deg")):
        values = np.unique(np.round(track[:, axis], 3))
        if len(values) < 8:
            continue
        step = np.diff(values)
        least = float(np.percentile(step, 5.0))
        even = np.mean(np.abs(step / least - np.round(step / least)) < 0.1) > 0.9
        if least > COARSE and even and len(values) < 0.7 * len(used):
            text = f"{name} has steps of {least:.2g} m: too few digits"
            yield Finding("warning", "gnss.csv", text, "write 8 digits after the point, in double precision", 1)
            return


def _check_sigmas(fixes: Fixes, used: np.ndarray) -> Iterator[Finding]:
    if fixes.position_sigma is None:
        return
    sigma = fixes.position_sigma[used, :2]
    small = (sigma < TINY_SIGMA).any(axis=1)
    if small.any():
        line = _line(fixes, int(used[np.argmax(small)]))
        text = f"{int(small.sum())} of {len(used)} rows have a sigma of less than {1e3 * TINY_SIGMA:g} mm"
        advice = "is it in metres, and no variance? sigma_floor= holds it at 0.3 m"
        yield Finding("warning", "gnss.csv", text, advice, line)


def check_status(folder: Path) -> Iterator[Finding]:
    """Columns that may say that a row is no fix, which are not used."""
    if not has_table(folder, "gnss"):
        return
    path = table_path(folder, "gnss")
    header, rows = read_cells(path)
    for name in STATUS:
        if name not in header:
            continue
        place = header.index(name)
        values = [_number(row[place]) if place < len(row) else math.nan for row in rows]
        bad = [k for k, value in enumerate(values) if value <= 0.0]
        if bad and len(bad) < 0.5 * len(values):
            text = f"{len(bad)} of {len(values)} rows have {name} = 0, which many receivers write without a fix"
            advice = "the rows are used as fixes: leave them out if they are none"
            yield Finding("warning", path.name, text, advice, bad[0] + 2)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _check_heights(log: Log) -> Iterator[Finding]:
    """Heights of the fixes against those of the reference."""
    reference = log.reference
    if reference is None:
        return
    used = (log.fixes.time >= log.start) & covered(reference, log.fixes.time)
    if np.count_nonzero(used) < 10:
        return
    place, _ = interpolate(reference, log.fixes.time[used])
    if _apart(log.fixes.position[used], place) > FAR > _apart(log.fixes.position[used][:, [1, 0, 2]], place):
        text = "lat_deg and lon_deg are swapped, here or in reference.csv"
        yield Finding("error", "gnss.csv", text, "exchange the two columns", 1)
        return
    apart = log.fixes.position[used, 2] - place[:, 2]
    median, spread = float(np.median(apart)), float(np.median(np.abs(apart - np.median(apart))))
    level = float(np.median(place[:, 2]))
    sigma = 5.0 if log.fixes.position_sigma is None else float(np.median(log.fixes.position_sigma[used, 2]))
    if abs(median) < max(HEIGHTS_APART, 3.0 * sigma, 3.0 * spread):
        return
    ratio = float(np.median(log.fixes.position[used, 2])) / level if level else 0.0
    if abs(ratio * 0.3048 - 1.0) < 0.03 and abs(level) > 20.0:
        meaning = "those of the fixes are in feet: multiply h_m by 0.3048"
    elif abs(ratio / 0.3048 - 1.0) < 0.03 and abs(level) > 20.0:
        meaning = "those of the reference are in feet: multiply h_m by 0.3048"
    else:
        meaning = "one may be above sea level, the other above the ellipsoid; only changes of height matter to a game"
    text = f"the heights of the fixes lie {median:.1f} m from those of the reference (median)"
    yield Finding("warning", "gnss.csv", text, meaning, 1)


def _apart(one: Floats, other: Floats) -> float:
    """Median horizontal distance of positions, (n, 3) each, m."""
    return float(np.median(np.hypot(*position_difference(one, other)[:, :2].T)))


def check_zero_velocity(fixes: Fixes, start: float, file: str) -> Iterator[Finding]:
    """Velocities that are 0 in every fix of a vehicle that moves."""
    used = np.flatnonzero(fixes.time >= start)
    if fixes.velocity is None or len(used) < 10 or fixes.velocity[used, :2].any():
        return
    moved = velocity_of(Fixes(fixes.time, fixes.position, None, None, None))[used]
    if np.median(np.hypot(moved[:, 0], moved[:, 1])) > MOVING:
        text = "vn_mps and ve_mps are 0 in every fix, and the positions move"
        yield Finding("error", file, text, "leave out the three columns of the velocity", 1)


def _line(fixes: Fixes, row: int) -> int:
    return row + 2 if fixes.lines is None else int(fixes.lines[row])
