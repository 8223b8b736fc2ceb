"""The magnetometer of a log: its field in body axes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.table import has_table, read_table, table_path

TABLE = "magnetometer"
UNITS = ("ut", "mgauss", "gauss", "t")
"""Suffixes of its columns, microtesla to tesla: only the direction of the field counts."""


@dataclass(frozen=True, eq=False)
class MagneticField:
    """What a magnetometer measured.

    Attributes:
        time: (n,), s, on the clock of the table.
        body: right, forward, up, (n, 3), in the unit of the table.
    """

    time: Floats
    body: Floats


def read_magnetometer(folder: Path, rotation: Floats) -> MagneticField | None:
    """The table ``magnetometer.csv`` of a log, whose columns are mx, my, mz in the IMU's axes; None = it has none.

    Args:
        folder: of the log.
        rotation: from the axes of the IMU to body right, forward, up, (3, 3).

    Raises:
        ValueError: the table is damaged, or has no columns of a field.
    """
    if not has_table(folder, TABLE):
        return None
    path = table_path(folder, TABLE)
    groups = [tuple(f"m{axis}_{unit}" for axis in "xyz") for unit in UNITS]
    table = read_table(path, [("t_s",)], list(groups), {})
    for group in groups:
        if group[0] in table:
            field = np.column_stack([table[name] for name in group])
            return MagneticField(table["t_s"], field @ rotation.T)
    raise ValueError(f"{path}: has no columns of a field, such as {', '.join(groups[0])}")
