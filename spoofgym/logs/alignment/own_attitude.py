"""Alignment by the attitude that the log itself holds: the estimate of an autopilot, or of a phone."""

from __future__ import annotations

import numpy as np

from spoofgym.logs.alignment.base import Alignment, levelled
from spoofgym.logs.log import Log, velocity_of
from spoofgym.logs.table import has_table, read_table, seconds, table_path
from spoofgym.mechanization import attitude_matrix

METHOD = "attitude"
TABLE = "attitude"
IN_RADIANS = ("roll_rad", "pitch_rad", "yaw_rad")
IN_DEGREES = ("roll_deg", "pitch_deg", "yaw_deg")
SIGMA = (np.radians(3.0), np.radians(3.0), np.radians(10.0))
"""Of the attitude (E, N, U), rad."""
LARGEST_GAP = 1.0
"""Between two attitudes around a fix, s."""
MOST_TILT_APART = np.radians(20.0)
"""Between the vertical of the attitude and that of the specific force, rad."""


def by_own_attitude(log: Log) -> Alignment:
    """Align at the first fix from the log's start on for which ``attitude.csv`` has an entry.

    Raises:
        ValueError: there is no such table or fix, it is damaged, or its vertical is not that of the specific force.
    """
    owner = f"log {str(log.folder)!r}: alignment attitude"
    if not has_table(log.folder, TABLE):
        raise ValueError(f"{owner}: attitude.csv (or .csv.gz) is missing; it has t_s and {', '.join(IN_RADIANS)}")
    path = table_path(log.folder, TABLE)
    table = read_table(path, [("t_s",)], [IN_RADIANS, IN_DEGREES], {})
    radians = IN_RADIANS[0] in table
    if not radians and IN_DEGREES[0] not in table:
        raise ValueError(f"{path}: has neither {', '.join(IN_RADIANS)} nor {', '.join(IN_DEGREES)}")
    angles = np.column_stack([table[name] for name in (IN_RADIANS if radians else IN_DEGREES)])
    angles = np.unwrap(angles if radians else np.radians(angles), axis=0)
    order = np.argsort(table["t_s"], kind="stable")
    time, angles = table["t_s"][order] - log.imu_delay, angles[order]
    fixes = log.fixes.time
    after = np.clip(np.searchsorted(time, fixes), 1, len(time) - 1)
    fits = (fixes >= max(log.start, log.imu_time[0], time[0])) & (fixes <= min(log.imu_time[-1], time[-1]))
    fits &= time[after] - time[after - 1] <= LARGEST_GAP
    fits[[0, -1]] = False
    if not fits.any():
        raise ValueError(f"{owner}: {path.name} tells nothing at any fix after start_s = {seconds(log.start)} s")
    fix = int(np.flatnonzero(fits)[0])
    roll, pitch, yaw = (float(np.interp(fixes[fix], time, column)) for column in angles.T)
    attitude = attitude_matrix(pitch, roll, yaw)
    apart = float(np.arccos(np.clip(attitude[2] @ levelled(log, fix, yaw)[2], -1.0, 1.0)))
    if apart > MOST_TILT_APART:
        raise ValueError(
            f"{owner}: at {seconds(fixes[fix])} s the vertical of {path.name} is {np.degrees(apart):.0f}° off that of "
            "the specific force: other axes than imu_to_body_frd (roll, pitch and yaw are those of forward, right, "
            "down against north, east, down), another unit or another clock"
        )
    return Alignment(METHOD, fix, attitude, velocity_of(log.fixes)[fix].copy(), np.array(SIGMA))
