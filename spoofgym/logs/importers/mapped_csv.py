"""Any CSV files, by a TOML file that says which column is what, in which unit: the source is that TOML file."""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Mapping
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.importers.recording import (
    AXES,
    MOST_ROWS,
    Columns,
    Options,
    Recording,
    check_size,
    velocity_of_course,
)
from spoofgym.logs.log import (
    IMU_COLUMNS,
    POSITION_COLUMNS,
    POSITION_SIGMA_COLUMNS,
    VELOCITY_COLUMNS,
    VELOCITY_SIGMA_COLUMNS,
)
from spoofgym.validation import nearest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

LENGTHS = {"m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3, "ft": 0.3048}
SPEEDS = {"m/s": 1.0, "km/h": 1 / 3.6, "knots": 1852 / 3600, "mph": 0.44704, "cm/s": 1e-2, "mm/s": 1e-3, "ft/s": 0.3048}
DEGREES = {"deg": 1.0, "rad": math.degrees(1.0), "1e-7deg": 1e-7}
RATES = {"rad/s": 1.0, "deg/s": math.radians(1.0), "mrad/s": 1e-3}
FORCES = {"m/s2": 1.0, "g": 9.80665, "mg": 9.80665e-3, "ft/s2": 0.3048}
ISO = "iso8601"
UNITS: dict[str, dict[str, float]] = {
    "t_s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, ISO: 1.0},
    **dict.fromkeys(IMU_COLUMNS[1:4], RATES),
    **dict.fromkeys(IMU_COLUMNS[4:], FORCES),
    **dict.fromkeys(("lat_deg", "lon_deg", "course_deg", "yaw_deg", "roll_deg", "pitch_deg"), DEGREES),
    **dict.fromkeys(("h_m", "sd_h_m", *POSITION_SIGMA_COLUMNS), LENGTHS),
    **dict.fromkeys(("speed_mps", "vu_mps", "sd_v_mps", *VELOCITY_COLUMNS, *VELOCITY_SIGMA_COLUMNS), SPEEDS),
}
"""Units of each column and what makes them those of the log format; the first is the default."""
VARIANCES = {
    name: {f"{unit}^2": factor for unit, factor in units.items()} for name, units in UNITS.items() if name[:3] == "sd_"
}
GROUPS = {
    "imu": (IMU_COLUMNS, ()),
    "gnss": (POSITION_COLUMNS, tuple(name for name in UNITS if name not in IMU_COLUMNS)),
    "reference": (POSITION_COLUMNS, tuple(name for name in UNITS if name not in IMU_COLUMNS)),
}
"""Columns of each table: needed, and welcome."""
ABOUT = ("file", "delimiter", "decimal", "skip_lines", "header", "comment", "keep", "shift_s")
TOP = ("name", "axes", "clock", "imu_delay_s", "gnss_delay_s", "antenna_lever_arm_m", "source", "vehicle", *GROUPS)
LONGEST = 100_000
"""Most characters of a line."""


def recognises(path: Path) -> bool:
    """Whether the file is a mapping: a TOML file with tables for imu and gnss."""
    return path.suffix.lower() == ".toml" and path.stat().st_size < 1_000_000


def read(path: Path, options: Options) -> Recording:
    """Read the CSV files that a mapping names, which lie beside it.

    Raises:
        ValueError: the mapping has an unknown key or unit, or a file or column is missing; naming the file.
    """
    del options
    mapping = _mapping(path)
    axes = mapping.get("axes", "unknown")
    if axes not in AXES:
        raise ValueError(f"{path}: axes must be one of {', '.join(AXES)}, got {axes!r:.100}")
    source, clock = str(mapping.get("source", f"CSV by {path.name}")), str(mapping.get("clock", "the source's"))
    recording = Recording(kind=source, clock=clock, axes=axes)
    for key in ("imu_delay_s", "gnss_delay_s", "antenna_lever_arm_m"):
        if key in mapping:
            recording.settings[key] = mapping[key]
    if "vehicle" in mapping:
        recording.remarks["vehicle"] = str(mapping["vehicle"])
    for name in GROUPS:
        if name in mapping:
            recording.tables[name] = _table(path, name, mapping[name], recording)
    return recording


def _mapping(path: Path) -> dict[str, Any]:
    try:
        mapping = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: not valid TOML: {error}") from None
    _check_keys(path, mapping, TOP, "")
    for name in ("imu", "gnss"):
        if not isinstance(mapping.get(name), dict):
            raise ValueError(f"{path}: table [{name}] is missing: it names a file and its columns")
    return mapping


def _check_keys(path: Path, table: Mapping[str, Any], valid: tuple[str, ...], where: str) -> None:
    for key in table:
        if key not in valid:
            meant = nearest(key, valid) or ";"
            raise ValueError(f"{path}: unknown key {key!r:.100}{where}{meant} valid are {', '.join(valid)}")


def _table(path: Path, name: str, about: Any, recording: Recording) -> Columns:
    """One table of the log, its columns in the units of the format."""
    if not isinstance(about, dict):
        raise ValueError(f"{path}: {name} must be a table [{name}]")
    needed, welcome = GROUPS[name]
    _check_keys(path, about, (*ABOUT, *needed, *welcome), f" in [{name}]")
    for key in (*needed, "file"):
        if key not in about:
            raise ValueError(f"{path}: [{name}] needs {key}; needed are file, {', '.join(needed)}")
    file = path.parent / str(about["file"])
    wanted = {key: _column(path, name, key, about[key]) for key in about if key not in ABOUT}
    keep = _column(path, name, "keep", about["keep"]) if "keep" in about else None
    sources = [entry["column"] for entry in wanted.values()] + ([keep["column"]] if keep else [])
    cells = _cells(file, about, sources)
    table = {key: _converted(path, file, name, key, entry, cells[entry["column"]]) for key, entry in wanted.items()}
    table["t_s"] = table["t_s"] + float(about.get("shift_s", 0.0))
    if keep is not None:
        least = keep.get("at_least")
        if not isinstance(least, (int, float)):
            got = f"{about['keep']!r:.100}"
            raise ValueError(f"{path}: keep of [{name}] must be {{column = ..., at_least = NUMBER}}, got {got}")
        good = np.array([_number(cell, ".") for cell in cells[keep["column"]]]) >= least
        if not good.all():
            recording.problems.append(f"{name}: {int((~good).sum())} of {len(good)} rows are left out by keep")
        table = {key: values[good] for key, values in table.items()}
    return _composed(path, name, table)


def _column(path: Path, table: str, key: str, about: Any) -> dict[str, Any]:
    """What a mapping says of a column: a name or number, or a table of column, unit, sign."""
    entry = about if isinstance(about, dict) else {"column": about}
    valid = ("column", "at_least") if key == "keep" else ("column", "unit", "sign")
    _check_keys(path, entry, valid, f" in {key} of [{table}]")
    if not isinstance(entry.get("column"), (str, int)) or isinstance(entry.get("column"), bool):
        raise ValueError(f"{path}: {key} of [{table}] must name a column, by its name or its number from 1 on")
    if entry.get("sign", 1) not in (1, -1):
        raise ValueError(f"{path}: sign of {key} in [{table}] must be 1 or -1, got {entry['sign']!r:.50}")
    return entry


def _cells(file: Path, about: Mapping[str, Any], wanted: list[str | int]) -> dict[str | int, list[str]]:
    """The cells of some columns of a CSV file."""
    check_size(file)
    delimiter, skip = str(about.get("delimiter", ",")), about.get("skip_lines", 0)
    if len(delimiter) != 1 or not isinstance(skip, int) or skip < 0:
        raise ValueError(f"{file}: delimiter must be one character and skip_lines a whole number of 0 or more")
    comment = str(about.get("comment", "#"))
    places: dict[str | int, int] = {}
    found: dict[str | int, list[str]] = {column: [] for column in wanted}
    with file.open(encoding="utf-8-sig", errors="replace", newline="") as opened:
        number = 0
        while text := opened.readline(LONGEST):
            number += 1
            if len(text) == LONGEST:
                raise ValueError(f"{file}, line {number}: has {LONGEST} characters or more")
            if number <= skip or not text.strip() or (comment and text.startswith(comment) and places):
                continue
            cells = next(csv.reader([text.rstrip("\r\n")], delimiter=delimiter))
            if not places:
                header = [cell.strip().lstrip("#").strip() for cell in cells] if about.get("header", True) else None
                places = {column: _place(file, number, column, header, len(cells)) for column in wanted}
                if header is not None:
                    continue
            if len(found[wanted[0]]) >= MOST_ROWS:
                raise ValueError(f"{file}, line {number}: more than {MOST_ROWS} rows")
            for column, place in places.items():
                found[column].append(cells[place] if place < len(cells) else "")
    return found


def _place(file: Path, line: int, column: str | int, header: list[str] | None, width: int) -> int:
    if isinstance(column, int):
        if not 1 <= column <= width:
            raise ValueError(f"{file}, line {line}: column {column} is not there: the line has {width}, from 1 on")
        return column - 1
    if header is None or column not in header:
        named = ", ".join(header or [])[:300] or "no header"
        raise ValueError(f"{file}, line {line}: column {column!r:.100} is not there; there are: {named}")
    return header.index(column)


def _converted(path: Path, file: Path, table: str, key: str, entry: Mapping[str, Any], cells: list[str]) -> Floats:
    """A column in the unit of the log format; NaN where a cell is no number."""
    units, variances = UNITS[key], VARIANCES.get(key, {})
    unit = entry.get("unit", next(iter(units)))
    if unit not in units and unit not in variances:
        valid = ", ".join((*units, *variances))
        raise ValueError(f"{path}: unit of {key} in [{table}] must be one of {valid}, got {unit!r:.50}")
    if unit == ISO:
        return np.array([_moment(cell) for cell in cells])
    numbers = np.array([_number(cell, ",") for cell in cells])
    if len(numbers) and not np.isfinite(numbers).any():
        column = f"{entry['column']!r:.100}"
        raise ValueError(f"{file}: {key}: no cell of column {column} is a number; the first is {cells[0][:60]!r}")
    sign = float(entry.get("sign", 1))
    return np.sqrt(numbers) * variances[unit] if unit in variances else sign * units[unit] * numbers


def _number(text: str, decimal: str) -> float:
    """A number; with a decimal comma where there is one and no point."""
    cleaned = text.strip()
    if decimal == "," and cleaned.count(",") == 1 and "." not in cleaned:
        cleaned = cleaned.replace(",", ".")
    try:
        return float(cleaned)
    except ValueError:
        return math.nan


def _moment(text: str) -> float:
    """Unix time of a date and time; UTC where no zone is named."""
    try:
        moment = datetime.fromisoformat(text.strip().replace("Z", "+00:00"))
    except ValueError:
        return math.nan
    return (moment if moment.tzinfo else moment.replace(tzinfo=timezone.utc)).timestamp()


def _composed(path: Path, name: str, table: Columns) -> Columns:
    """Speed and course, a velocity up, and a common sigma, as the columns of the format."""
    if ("speed_mps" in table) != ("course_deg" in table):
        raise ValueError(f"{path}: [{name}] needs speed_mps and course_deg together")
    if "speed_mps" in table:
        north, east = velocity_of_course(table.pop("speed_mps"), table.pop("course_deg"))
        table |= {"vn_mps": north, "ve_mps": east}
    if "vu_mps" in table:
        table["vd_mps"] = -table.pop("vu_mps")
    if "vn_mps" in table and "ve_mps" in table and "vd_mps" not in table:
        table["vd_mps"] = np.zeros(len(table["t_s"]))  # 0 in every fix = not measured
    if "sd_h_m" in table:
        horizontal = table.pop("sd_h_m")
        table = {"sd_n_m": horizontal, "sd_e_m": horizontal, "sd_d_m": 1.5 * horizontal} | table
    if "sd_v_mps" in table:
        table |= dict.fromkeys(VELOCITY_SIGMA_COLUMNS, table.pop("sd_v_mps"))
    order = [key for key in (*UNITS,) if key in table]
    return {key: table[key] for key in order}
