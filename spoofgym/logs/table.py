"""Reading the tables of a recorded log: columns of CSV files by their names, plain or gzipped, every value checked."""

from __future__ import annotations

import difflib
import gzip
import math
import re
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.validation import LATEST

LARGEST = 2**28
"""Most bytes of text in a table, unpacked: 6 hours of an IMU at 100 Hz with 120 bytes a line. An archive that
unpacks to more is not read on."""
MOST_LINES = 10_000_000
"""Most lines of a table: 7 hours of an IMU at 400 Hz."""
LONGEST_LINE = 100_000
"""Most characters of a line: some thousand columns."""
SHOWN = 200
"""Most characters of a file that a message quotes."""

TIMES = (-LATEST, LATEST)
"""Valid values of a time, s."""

Limits = Mapping[str, tuple[float, float]]
"""Valid values, inclusive, of columns that have bounds."""


def has_table(folder: Path, name: str) -> bool:
    """Whether the folder holds ``name.csv`` or ``name.csv.gz``."""
    return (folder / f"{name}.csv").is_file() or (folder / f"{name}.csv.gz").is_file()


def table_path(folder: Path, name: str) -> Path:
    """The one of ``name.csv`` and ``name.csv.gz`` that is there.

    Raises:
        ValueError: none is, or both are.
    """
    present = [path for path in (folder / f"{name}.csv", folder / f"{name}.csv.gz") if path.is_file()]
    if not present:
        raise ValueError(f"{folder / name}.csv (or .csv.gz) is missing")
    if len(present) == 2:
        raise ValueError(f"{folder}: {present[0].name} and {present[1].name} are both there; keep one")
    return present[0]


def read_table(
    path: Path, required: list[tuple[str, ...]], optional: list[tuple[str, ...]], limits: Limits
) -> dict[str, Floats]:
    """Columns of a CSV file by their names; each optional group is there as a whole or not at all.

    Raises:
        ValueError: the file cannot be read or is too large, a column is missing or there twice, or a value is not a
            finite number or out of its limits; the message names file and line.
    """
    lines = _lines(path)
    header = [name.strip() for name in lines[0].split(",")]
    wanted: list[str] = []
    for group in required + optional:
        missing = [name for name in group if name not in header]
        if missing and (group in required or len(missing) < len(group)):
            raise ValueError(
                f"{path}, line 1: column {missing[0]!r} is missing; needed together: {', '.join(group)}; "
                f"found: {', '.join(header)[:SHOWN] or 'nothing'}{_header_hint(lines[0], header, missing[0])}"
            )
        if not missing:
            wanted += group
    twice = [name for name in wanted if header.count(name) > 1]
    if twice:
        raise ValueError(f"{path}, line 1: column {twice[0]!r} is there twice")
    if len(lines) < 3:
        raise ValueError(f"{path}: needs two lines of data or more below the header")
    _check_widths(path, lines, len(header))
    places = [header.index(name) for name in wanted]
    try:
        values = np.loadtxt(lines[1:], delimiter=",", usecols=places, comments=None, ndmin=2)
    except ValueError:
        values = None
    if values is None or len(values) != len(lines) - 1 or not np.all(np.isfinite(values)):
        raise _bad_value(path, lines, wanted, places)
    for column, name in enumerate(wanted):
        low, high = limits.get(name, (-math.inf, math.inf))
        wrong = np.flatnonzero((values[:, column] < low) | (values[:, column] > high))
        if len(wrong):
            bounds = f"{low:g} or more" if math.isinf(high) else f"between {low:g} and {high:g}"
            value = float(values[wrong[0], column])
            hint = limit_hint(name, value)
            raise ValueError(f"{path}, line {wrong[0] + 2}: {name} must be {bounds}, got {value!r}{hint}")
    return {name: np.ascontiguousarray(values[:, column]) for column, name in enumerate(wanted)}


def read_cells(path: Path) -> tuple[list[str], list[list[str]]]:
    """The names in the first line of a CSV file and the cells of all others, as text.

    Raises:
        ValueError: the file cannot be read or is too large.
    """
    lines = _lines(path)
    return [name.strip() for name in lines[0].split(",")], [line.split(",") for line in lines[1:]]


def _check_widths(path: Path, lines: list[str], columns: int) -> None:
    """Refuse lines with more cells than there are names; decimal commas make such, and would shift columns."""
    for number, line in enumerate(lines[1:], start=2):
        if line.count(",") >= columns and line.rstrip()[-1:] != ",":
            raise ValueError(
                f"{path}, line {number}: has {line.count(',') + 1} values, but line 1 has {columns} names; numbers "
                "have a decimal point, no comma"
            )


def limit_hint(name: str, value: float) -> str:
    """What a value out of its limits may be, for a message."""
    size = abs(value)
    if name in ("lat_deg", "lon_deg") and size > 1e6:
        return "; is it in 1e-7 degrees? Divide it by 1e7"
    if name in ("lat_deg", "lon_deg") and size > 360.0:
        return "; is it in degrees and minutes (ddmm.mmmm of NMEA)? It must be in degrees"
    if name == "lat_deg":
        return "; are lat_deg and lon_deg swapped?"
    if name == "h_m" and size > 1e5:
        return "; is it in millimetres?"
    return ""


def _header_hint(line: str, header: list[str], missing: str) -> str:
    """Why a column may be missing, for a message."""
    for separator, name in ((";", "semicolons"), ("\t", "tabs"), ("|", "bars")):
        if line.count(separator) > line.count(","):
            return f"; the line is separated by {name}: it must be by commas, and numbers have a decimal point"
    if all(_is_numeral(cell) for cell in header):
        return "; the first line must name the columns"
    same = [name for name in header if name.strip('"\'').lower() == missing.lower()]
    near = same or difflib.get_close_matches(missing, header, 1, 0.6)
    return f"; is it {near[0]!r}? Names and units must be as in the log format" if near else ""


def _is_numeral(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def check_increasing(path: Path, time: Floats, lines: Runs | None = None) -> None:
    """Refuse times that do not increase.

    Args:
        path: of the table.
        time: (n,), s.
        lines: of the file that they come from, (n,); None = one after the other from the second on.

    Raises:
        ValueError: a time is not later than the one before it.
    """
    late = np.flatnonzero(np.diff(time) <= 0.0)
    if len(late):
        line = late[0] + 3 if lines is None else lines[late[0] + 1]
        others = f"; so it is in {len(late)} of {len(time)} lines" if len(late) > 1 else ""
        step = float(time[late[0]] - time[late[0] + 1])
        back = step + float(np.median(np.diff(time)))
        if step == 0.0:
            others += "; a row that is there twice, or too few digits in t_s"
        elif abs(back - round(back)) < 0.05 and back > 0.5:
            others += f"; the clock was set back by {back:.0f} s, or rows are in another order"
        else:
            others += "; sort the rows, or leave these out"
        raise ValueError(
            f"{path}, line {line}: t_s must increase, got {seconds(time[late[0] + 1])} after "
            f"{seconds(time[late[0]])}{others}"
        )


def seconds(time: float) -> str:
    """A time for a message, to the microsecond, however large it is: those of Unix keep their digits."""
    return np.format_float_positional(time, precision=6, trim="-")


def _lines(path: Path) -> list[str]:
    """Lines of a plain or gzipped text file, without blank ones at its end.

    A line ends with a line feed, perhaps after a carriage return, and with nothing else: what is counted before the
    text is split is what it is split at.
    """
    try:
        with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
            data = file.read(LARGEST + 1)
        if len(data) > LARGEST:
            raise ValueError(f"{path}: has more than {LARGEST} bytes of text, which is the limit; cut the log in parts")
        if data.count(b"\n") > MOST_LINES:
            raise ValueError(f"{path}: has more than {MOST_LINES} lines, which is the limit; cut the log in parts")
        if data.count(b"\r") > data.count(b"\r\n"):
            line = data.count(b"\n", 0, re.search(rb"\r(?!\n)", data).start()) + 1  # type: ignore[union-attr]
            raise ValueError(
                f"{path}, line {line}: a carriage return without a line feed; lines must end with \\n or \\r\\n"
            )
        text = data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: cannot be read: it is no text in UTF-8: {error.reason}") from None
    except (OSError, EOFError, zlib.error) as error:
        raise ValueError(f"{path}: cannot be read: {error}") from None
    lines = text.rstrip().split("\n")
    longest = max(map(len, lines))
    if longest > LONGEST_LINE:
        line = next(number for number, text in enumerate(lines, 1) if len(text) == longest)
        raise ValueError(f"{path}, line {line}: has {longest} characters; valid are {LONGEST_LINE} at most")
    return lines


def _bad_value(path: Path, lines: list[str], wanted: list[str], places: list[int]) -> ValueError:
    """The error that names the first line with a value that is not a finite number."""
    for number, line in enumerate(lines[1:], start=2):
        cells = line.split(",")
        for name, place in zip(wanted, places, strict=True):
            if place >= len(cells):
                return ValueError(f"{path}, line {number}: {name} is missing, the line has {len(cells)} of the columns")
            try:
                valid = math.isfinite(float(cells[place])) and "_" not in cells[place]
            except ValueError:
                valid = False
            if not valid:
                return ValueError(
                    f"{path}, line {number}: {name} must be a finite number, got {cells[place].strip()[:SHOWN]!r}"
                )
    return ValueError(f"{path}: cannot be read as a table of numbers")
