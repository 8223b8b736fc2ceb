"""What an import has found, in lines for people: rates, gaps, clocks, sigmas, problems."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.importers.recording import Columns, Recording
from spoofgym.logs.importers.tidy import WITHOUT_TIME
from spoofgym.logs.table import seconds

GAP = 3.0
"""Shortest time between two rows that is a gap, in usual intervals."""
SIGMAS = ("sd_n_m", "sd_e_m", "sd_d_m", "sd_vn_mps", "sd_ve_mps", "sd_vd_mps")


def summary(recording: Recording) -> list[str]:
    """Lines that tell what was found."""
    lines = [f"{recording.kind}; times: {recording.clock}; axes of the IMU: {recording.axes}"]
    lines += [f"{key} = {value!r}" for key, value in recording.settings.items()]
    lines += [_line(name, table) for name, table in recording.tables.items()]
    fixes = recording.tables.get("gnss")
    if fixes is not None:
        known = [f"{name} {np.median(fixes[name]):.3g}" for name in SIGMAS if name in fixes]
        lines.append("sigmas of the fixes (median): " + (", ".join(known) if known else "none in the source"))
        if "vn_mps" not in fixes:
            lines.append("the fixes have no velocity: the filter takes positions alone")
    return lines + [f"problem: {problem}" for problem in recording.problems]


def _line(name: str, table: Columns) -> str:
    rows = len(next(iter(table.values())))
    if name in WITHOUT_TIME or rows < 2:
        return f"{name}: {rows} rows"
    time = np.unique(table["t_s"])
    if len(time) < 2:
        return f"{name}: {rows} rows at {seconds(time[0])} s"
    step = np.diff(time)
    span = f"{seconds(time[0])} to {seconds(time[-1])} s"
    each = f", {rows / len(time):.1f} rows a time" if rows > len(time) else ""
    return f"{name}: {rows} rows{each}, {1.0 / np.median(step):.4g} Hz, {span}, {_gaps(time, step)}"


def _gaps(time: Floats, step: Floats) -> str:
    wide = np.flatnonzero(step > GAP * np.median(step))
    if not len(wide):
        return "no gaps"
    longest = wide[np.argmax(step[wide])]
    return f"{len(wide)} gaps, the longest {step[longest]:.3g} s at {seconds(time[longest])} s"
