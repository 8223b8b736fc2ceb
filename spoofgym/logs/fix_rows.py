"""Which rows of a table of fixes are fixes, and which of their sigmas are known.

Receivers go on writing rows while they have no fix: zeros in place of a position, or a sigma that no fix has. A single
fix may lie where no vehicle can have been. Such rows are left out; from the log's start on that is told, by a warning.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.ndimage import median_filter

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.geodesy import position_difference
from spoofgym.logs.log_warning import warn

UNKNOWN_SIGMA = 99.0
"""1 sigma from which on a number stands for "unknown", m and m/s: receivers write 99.99, 999, 9999, 4294967.295 or 1e9,
and a fix of 99 m would tell a filter nothing."""
UNMEASURED_SIGMA = 1e3
"""1 sigma that the filter believes of a component that was not measured, m and m/s."""
DEFAULT_SIGMA = (2.5, 2.5, 5.0, 0.3, 0.3, 0.5)
"""1 sigma (E, N, U) of a fix whose log states none, or 0, which means that the receiver does not know it, m and m/s."""
COLUMNS = ("sd_e_m", "sd_n_m", "sd_d_m", "sd_ve_mps", "sd_vn_mps", "sd_vd_mps")
NEAR_ZERO = 0.1
"""Latitude and longitude of a log at latitude 0 and longitude 0, degrees."""
FARTHEST = 50.0
"""Error that a fix may have, m, beside the way that the vehicle may have gone."""
LEAP_BACK = 25.0
"""Least step by which a track comes back from fixes out of reach, m: without one it has gone on from them."""
CONTRADICTION = 50.0
"""Difference that a velocity may have from the mean one before it and after it, m/s; over less than a second by as much
more as the positions tell less."""
FASTEST = 3.0
"""Speed that the vehicle may have had for a short time, over its median speed in `AROUND` steps."""
AROUND = 21
WILD = 3
"""Fixes in a row that are left out at most: what stays away longer may be true, or the attack that is in the log."""
WILD_TIME = 3.0
"""Time over which rows of a reference are left out at most, s, and `WILD` rows where that is more."""


def most_wild(time: Floats) -> int:
    """Rows of a reference that are left out in a row at most: those of `WILD_TIME`, or `WILD`.

    Args:
        time: of the rows, (n,), s.
    """
    interval = float(np.median(np.diff(time)))
    return max(WILD, math.ceil(min(WILD_TIME / interval, len(time)))) if interval > 0.0 else WILD


def usable_rows(path: Path, table: dict[str, Floats], start: float, most: int = WILD) -> tuple[dict[str, Floats], Runs]:
    """The rows of a table that are fixes.

    Args:
        path: of the table, for messages.
        table: its columns, each (n,).
        start: of the log, on the clock of the table, s.
        most: rows in a row that are left out at most because they are out of reach.

    Returns:
        The columns, (k,) each, and the lines of the file that they come from, (k,).

    Raises:
        ValueError: fewer than two rows are left.
    """
    told = table["t_s"] >= start
    no_position = _no_position(table["lat_deg"], table["lon_deg"])
    _tell(path, no_position & told, "have lat_deg = lon_deg = 0, no fix, and are left out")
    half = _half_a_position(table["lat_deg"], table["lon_deg"]) & ~no_position
    _tell(path, half & told, "have lat_deg = 0 or lon_deg = 0 far from the others, no fix, and are left out")
    no_position |= half
    no_fix = _no_fix(table) & ~no_position
    _tell(path, no_fix & told, f"have a horizontal sigma of {UNKNOWN_SIGMA:g} m or more, no fix, and are left out")
    kept = np.flatnonzero(~no_position & ~no_fix)
    if len(kept) >= 2:
        wild = np.zeros(len(told), dtype=bool)
        wild[kept] = wild_fixes(table["t_s"][kept], _track(table, kept), most)
        rest = kept[~wild[kept]]
        if "vn_mps" in table:
            velocity = np.column_stack([table["ve_mps"], table["vn_mps"], -table["vd_mps"]])[rest]
            wild[rest] = wild_velocities(table["t_s"][rest], _track(table, rest), velocity)
        _tell(path, wild & told, "have a position or velocity that the rows around make impossible, and are left out")
        kept = kept[~wild[kept]]
    if len(kept) < 2:
        raise ValueError(f"{path}, lines 2 to {len(told) + 1}: 2 rows or more must be a fix, {len(kept)} are")
    return {name: values[kept] for name, values in table.items()}, kept + 2


def _track(table: dict[str, Floats], rows: Runs) -> Floats:
    """Positions of rows from the one in the middle, (k, 3), m ENU."""
    latitude, longitude = np.radians(table["lat_deg"][rows]), np.radians(table["lon_deg"][rows])
    position = np.column_stack([latitude, longitude, table["h_m"][rows]])
    return position_difference(position, position[len(rows) // 2])


def _no_position(latitude: Floats, longitude: Floats) -> Flags:
    """Rows of zeros, degrees, unless the others are so near that a vehicle may have been there."""
    zero = (latitude == 0.0) & (longitude == 0.0)
    others = np.abs(np.column_stack([latitude, longitude])[~zero])
    near = len(others) > 0 and bool(np.all(np.median(others, axis=0) < NEAR_ZERO))
    return np.zeros(len(zero), dtype=bool) if near else zero


def _half_a_position(latitude: Floats, longitude: Floats) -> Flags:
    """Rows of which one of the two is zero, degrees, unless the vehicle came near to where that holds."""
    result = np.zeros(len(latitude), dtype=bool)
    for values in (latitude, longitude):
        others = np.abs(values[values != 0.0])
        if len(others) and others.min() >= NEAR_ZERO:
            result |= values == 0.0
    return result


def _no_fix(table: dict[str, Floats]) -> Flags:
    if "sd_n_m" not in table:
        return np.zeros(len(table["t_s"]), dtype=bool)
    return np.asarray(np.maximum(table["sd_n_m"], table["sd_e_m"]) >= UNKNOWN_SIGMA)


def _tell(path: Path, rows: Flags, what: str) -> None:
    """Warn of rows, (n,), where there are any."""
    if rows.any():
        line = int(np.argmax(rows)) + 2
        warn(path.parent, f"{path.name}: {rows.sum()} of {len(rows)} rows {what}; the first is line {line}", line)


def known_sigmas(path: Path, rows: dict[str, Floats], lines: Runs, start: float) -> dict[str, Floats]:
    """Fixes with a sigma in place of each one that is unknown.

    A sigma of 0 becomes the default, since the best fix there is would be the least likely meaning. A component whose
    sigma stands for "unknown", such as the height of a fix in two dimensions, counts as not measured.

    Args:
        path: of the table, for messages.
        rows: its columns, each (k,).
        lines: of the file, (k,).
        start: of the log, on the clock of the table, s.
    """
    default = dict(zip(COLUMNS, DEFAULT_SIGMA, strict=True))
    zero = {name: rows[name] == 0.0 for name in COLUMNS if name in rows}
    large = {name: rows[name] >= UNKNOWN_SIGMA for name in zero}
    after = rows["t_s"] >= start

    def tell(columns: dict[str, Flags], what: str, meaning: Callable[[list[str]], str]) -> None:
        told = np.flatnonzero(after & np.logical_or.reduce([np.zeros(len(lines), dtype=bool), *columns.values()]))
        if len(told):
            which = [name for name, column in columns.items() if column[told].any()]
            line = int(lines[told[0]])
            text = f"{len(told)} of {len(lines)} rows have a sigma of {what} ({', '.join(which)}), which is taken as "
            warn(path.parent, f"{path.name}: {text}{meaning(which)}; the first is line {line}", line)

    tell(zero, "0", lambda which: f"unknown: {', '.join(f'{default[name]:g}' for name in which)}")
    tell(large, f"{UNKNOWN_SIGMA:g} or more", lambda which: "not measured")
    result = dict(rows)
    for name, unknown in zero.items():
        result[name] = np.where(unknown, default[name], rows[name])
        result[name][large[name]] = UNMEASURED_SIGMA
    return result


def wild_fixes(time: Floats, track: Floats, most: int = WILD) -> Flags:
    """Fixes that are out of reach from the one before, where the track goes on from there up to ``most`` fixes later.

    Args:
        time: (n,), s, not decreasing.
        track: positions, (n, 3), m ENU.
        most: fixes in a row that are left out at most.

    Returns:
        (n,).
    """
    step, duration = np.linalg.norm(np.diff(track, axis=0), axis=1), np.diff(time)
    usual = np.divide(step, duration, out=np.zeros(len(step)), where=duration > 0.0)
    speed = FASTEST * median_filter(usual, size=AROUND, mode="mirror")
    number, wild = len(time), np.zeros(len(time), dtype=bool)

    def reached(one: int, other: int) -> bool:
        way = float(np.linalg.norm(track[other] - track[one]))
        near = way <= max(speed[one], speed[other - 1]) * (time[other] - time[one]) + FARTHEST
        return bool(near and step[other - 1] > LEAP_BACK)

    handled = 0
    for place in (np.flatnonzero(step > speed * np.maximum(duration, 0.0) + FARTHEST) + 1).tolist():
        if place <= handled:
            continue
        returns = (other for other in range(place + 1, min(place + most + 1, number)) if reached(place - 1, other))
        if (back := next(returns, None)) is not None:
            wild[place:back], handled = True, back
        elif place <= most < number - place:
            wild[:place] = True
        elif number - place <= most < place:
            wild[place:], handled = True, number
    return wild


def wild_velocities(time: Floats, track: Floats, velocity: Floats) -> Flags:
    """Velocities that contradict the change of position both before and after them.

    Args:
        time: (n,), s, not decreasing.
        track: positions, (n, 3), m ENU.
        velocity: ENU, (n, 3), m/s.

    Returns:
        (n,).
    """
    duration = np.diff(time)
    way = np.diff(track, axis=0)
    limit = CONTRADICTION * np.maximum(duration, 1.0)
    before = np.linalg.norm(velocity[1:] * duration[:, None] - way, axis=1) > limit
    after = np.linalg.norm(velocity[:-1] * duration[:, None] - way, axis=1) > limit
    return np.concatenate([[True], before]) & np.concatenate([after, [True]])
