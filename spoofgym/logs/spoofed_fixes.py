"""A real attack that a log holds: the fixes as the victim got them, beside the true ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.geodesy import position_difference
from spoofgym.logs.log import LIMITS, POSITION_COLUMNS, VELOCITY_COLUMNS, Log, as_fixes
from spoofgym.logs.table import check_increasing, has_table, read_table, seconds, table_path

TABLE = "gnss_spoofed"
SAME_TIME = 2e-3
"""Fixes of both tables this close to each other are the same epoch, s."""


@dataclass(frozen=True, eq=False)
class RecordedSpoof:
    """What a recorded attack adds to the fixes, or to the ranges, of a log.

    Attributes:
        time: of the log's fixes, or of the epochs of its ranges, (n,), s.
        offset: of the positions, (n, 3), m ENU; zero outside the attack.
        velocity: of the velocities, (n, 3), m/s ENU; zero outside the attack and where the victim got none.
        begin: of the first spoofed fix, s.
        end: of the last spoofed fix, s.
        ranges: what it adds to code and range rate of every slot, (n, 2 S), m and m/s, with offsets of zero; None =
            the attack is on fixes.
    """

    time: Floats
    offset: Floats
    velocity: Floats
    begin: float
    end: float
    ranges: Floats | None = None


def recorded_spoof(log: Log) -> RecordedSpoof:
    """The attack in ``gnss_spoofed.csv``, whose columns are those of ``gnss.csv``.

    It lasts from ``attack_start_s`` to ``attack_end_s`` of ``log.toml``, on the clock of the fixes.

    Raises:
        ValueError: the log holds none, its interval is missing or empty, or a fix has no counterpart.
    """
    owner = f"log {str(log.folder)!r}: attack recorded"
    if not has_table(log.folder, TABLE):
        raise ValueError(f"{owner}: {TABLE}.csv (or .csv.gz) is missing: the fixes as the victim got them")
    if log.attacked is None:
        raise ValueError(
            f"{owner}: log.toml must state attack_start_s and attack_end_s, of the first spoofed fix and the last"
        )
    path = table_path(log.folder, TABLE)
    rows = read_table(path, [POSITION_COLUMNS], [VELOCITY_COLUMNS], LIMITS)
    check_increasing(path, rows["t_s"])
    spoofed, fixes = as_fixes(rows, log.fix_delay), log.fixes
    begin, end = log.attacked[0] - log.fix_delay, log.attacked[1] - log.fix_delay
    after = np.clip(np.searchsorted(spoofed.time, fixes.time), 1, len(spoofed.time) - 1)
    near = np.where(fixes.time - spoofed.time[after - 1] < spoofed.time[after] - fixes.time, after - 1, after)
    during = (fixes.time >= begin - SAME_TIME) & (fixes.time <= end + SAME_TIME)
    if not during.any():
        raise ValueError(f"{owner}: no fix lies between attack_start_s and attack_end_s")
    missing = during & (np.abs(spoofed.time[near] - fixes.time) > SAME_TIME)
    if missing.any():
        at = float(fixes.time[np.flatnonzero(missing)[0]]) + log.fix_delay
        raise ValueError(f"{owner}: {path.name} has no row for the fix at {seconds(at)} s")
    offset = np.where(during[:, None], position_difference(spoofed.position[near], fixes.position), 0.0)
    velocity = np.zeros_like(offset)
    if spoofed.velocity is not None and fixes.velocity is not None:
        velocity = np.where(during[:, None], spoofed.velocity[near] - fixes.velocity, 0.0)
    return RecordedSpoof(fixes.time, offset, velocity, begin, end)
