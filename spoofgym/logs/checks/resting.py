"""A log of ranges whose antenna rests and that has no IMU: does the antenna's place fit the ranges?"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from spoofgym.geodesy import position_difference
from spoofgym.logs.checks.finding import Finding
from spoofgym.logs.checks.ranges import check_ranges
from spoofgym.logs.log import Log
from spoofgym.logs.log_files import NOTES
from spoofgym.logs.notes import Notes
from spoofgym.logs.range_epochs import range_epochs
from spoofgym.logs.resting_log import resting_log
from spoofgym.logs.spoofed_ranges import spoofed_within
from spoofgym.logs.table import has_table, seconds

FAR = (10.0, 20.0)
"""Median distance of the fixes of the ranges from the antenna that is too far, horizontally and vertically, m."""


def is_resting(folder: Path) -> bool:
    """Whether a folder holds such a log; raises ValueError where its ``log.toml`` cannot be read."""
    return (folder / NOTES).is_file() and not has_table(folder, "imu") and Notes(folder / NOTES).antenna() is not None


def resting_findings(folder: Path) -> Iterator[Finding]:
    """What its ranges say about themselves and about the antenna; a log that cannot be read is an error."""
    try:
        log = resting_log(folder)
        yield Finding("note", NOTES, "the antenna rests and there is no imu.csv", "imu=simulated:GRADE simulates one")
        ranges = list(check_ranges(folder))
        yield from ranges
        if not any(finding.severity == "error" for finding in ranges):
            yield from _place(log)
    except ValueError as error:
        yield Finding("error", folder.name, str(error))


def _place(log: Log) -> Iterator[Finding]:
    epochs = range_epochs(log)
    clean = epochs.fixes.time < (epochs.time[np.argmax(epochs.spoofed)] if epochs.spoofed.any() else np.inf)
    apart = position_difference(epochs.fixes.position[clean], log.fixes.position[0])
    if len(apart):
        flat, high = float(np.median(np.hypot(*apart[:, :2].T))), float(np.median(apart[:, 2]))
        text = f"fixes of the ranges lie {flat:.1f} m beside the antenna and {high:+.1f} m above it (medians)"
        if flat > FAR[0] or abs(high) > FAR[1]:
            wrong = "antenna_lat_deg, antenna_lon_deg, antenna_h_m or ephemeris.csv is wrong"
            yield Finding("warning", NOTES, text, wrong)
        else:
            yield Finding("note", NOTES, text)
    if log.ionosphere is None:
        text = "iono_alpha and iono_beta are missing"
        yield Finding("note", NOTES, text, "the delay of the ionosphere stays in the ranges, metres of height")
    if epochs.spoofed.any():
        own = "ranges.csv itself is spoofed" if spoofed_within(log) else "ranges_spoofed.csv holds an attack"
        begin = seconds(float(epochs.time[np.argmax(epochs.spoofed)]))
        yield Finding("note", NOTES, f"{own} from {begin} s on", "attack=recorded plays it")
