"""Writes a recording as a log folder, whole or not at all."""

from __future__ import annotations

import gzip
import json
import os
import secrets
import shutil
from contextlib import suppress
from pathlib import Path

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.files import DRAFT
from spoofgym.logs.importers.recording import AXES, MOST_ROWS, Columns, Recording
from spoofgym.logs.table import LARGEST

PACKED = ("imu", "ranges", "ranges_other")
"""Tables that are written as ``.csv.gz``."""
MIN_SPEED = 5.0
"""Speed from which on the alignment takes a course for the heading, m/s."""
SLOW = 1.0
"""Speed below which no course is believed, m/s."""
FORWARD = np.radians(8.0)
"""Largest difference of course and yaw of a vehicle that moves forward, rad."""
CHUNK = 20_000
"""Rows that are formatted at a time."""


def start_of(recording: Recording) -> float:
    """The first fix within the inertial samples from which on the course may be the heading.

    The alignment takes the first moving fix from there on. Where the source has an attitude, it is the first fix at
    which the vehicle moves and its course is its yaw: a copter or a boat may go sideways before.

    Raises:
        ValueError: there is none.
    """
    imu, fixes = recording.tables["imu"]["t_s"], recording.tables["gnss"]["t_s"]
    imu_delay, fix_delay = (float(recording.settings.get(key, 0.0)) for key in ("imu_delay_s", "gnss_delay_s"))  # type: ignore[arg-type]
    inside = np.flatnonzero((fixes - fix_delay >= imu[0] - imu_delay) & (fixes - fix_delay <= imu[-1] - imu_delay))
    if not len(inside):
        raise ValueError(
            f"{recording.kind}: no fix lies within the inertial samples: these are from {imu[0]:.3f} to {imu[-1]:.3f} "
            f"s, the fixes from {fixes[0]:.3f} to {fixes[-1]:.3f} s ({recording.clock})"
        )
    first = _first_forward(recording, inside, fix_delay - imu_delay)
    return float(fixes[inside[0] if first is None else first] - fix_delay)


def _first_forward(recording: Recording, inside: np.ndarray, delay: float) -> int | None:
    """The first of some fixes whose course is the yaw of the attitude; None = nothing tells, or there is none."""
    fixes, attitude = recording.tables["gnss"], recording.tables.get("attitude", {})
    if "vn_mps" not in fixes or "yaw_rad" not in attitude or len(attitude["t_s"]) < 2:
        return None
    north, east, time = fixes["vn_mps"][inside], fixes["ve_mps"][inside], fixes["t_s"][inside] - delay
    yaw = np.interp(time, attitude["t_s"], np.unwrap(attitude["yaw_rad"]))
    off = np.abs(np.angle(np.exp(1j * (np.arctan2(east, north) - yaw))))
    speed = np.hypot(north, east)
    moving = speed >= min(MIN_SPEED, 0.8 * float(np.max(speed)))
    if float(np.max(speed)) < SLOW or not moving.any():
        return None
    forward = moving & (off < FORWARD)
    if forward[np.argmax(moving)]:
        return None  # the first moving fix will do
    if not forward.any():
        recording.problems.append(
            f"attitude: the vehicle never moves forward: its course is {np.degrees(np.median(off[moving])):.0f} "
            "degrees off its yaw (median); the filter takes the course for the heading and will err"
        )
        return None
    recording.problems.append("attitude: the vehicle first moves sideways; start_s is where its course is its yaw")
    return int(inside[np.argmax(forward)])


def write_log(recording: Recording, folder: Path, name: str) -> None:
    """Write ``log.toml`` and a file for each table into a folder beside, which then takes the name of ``folder``.

    Args:
        recording: tidied.
        folder: must not exist, or be empty.
        name: of the log.

    Raises:
        ValueError: the folder has something in it, or a table is too large for a log.
        OSError: it cannot be written; nothing is left there.
    """
    check_target(folder)
    folder = Path(os.path.abspath(folder))
    folder.parent.mkdir(parents=True, exist_ok=True)
    draft = folder.with_name(f".{folder.name[:100]}.{secrets.token_hex(4)}{DRAFT}")
    try:
        draft.mkdir()
        (draft / "log.toml").write_text(notes(recording, name), encoding="utf-8")
        for table, columns in recording.tables.items():
            _write_table(draft, table, columns)
        if folder.exists():
            folder.rmdir()
        draft.rename(folder)
    except BaseException:
        with suppress(OSError):
            shutil.rmtree(draft)
        raise


def check_target(folder: Path) -> None:
    """Refuse a place where a log would overwrite something.

    Raises:
        ValueError: it is a file, or a folder with something in it.
    """
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise ValueError(f"{folder} is no folder; -o names the folder of the new log")
    if folder.is_dir() and any(folder.iterdir()):
        raise ValueError(f"{folder} is not empty; -o names a folder that is new or empty")


def notes(recording: Recording, name: str) -> str:
    """The text of ``log.toml``."""
    rows = ", ".join("[" + ", ".join(map(str, row)) + "]" for row in AXES[recording.axes])
    comment = "  # unknown: found from the drive" if not rows else f"  # sensor axes: {recording.axes}"
    lines = [f"name = {_text(name)}", f"imu_to_body_frd = [{rows}]{comment}"]
    lines += [f"start_s = {start_of(recording):.6f}"]
    lines += [f"{key} = {value!r}" for key, value in recording.settings.items()]
    lines += [f"source = {_text(recording.kind)}", f"time = {_text(recording.clock)}"]
    if recording.remarks or recording.problems:
        lines += ["", "[notes]", *(f"{key} = {_text(value)}" for key, value in recording.remarks.items())]
        if recording.problems:
            lines += ["import_told = [", *(f"    {_text(problem)}," for problem in recording.problems), "]"]
    return "\n".join(lines) + "\n"


def _text(value: str) -> str:
    """A TOML string on one line: JSON's escapes are TOML's, but for DEL."""
    return json.dumps(" ".join(value.split()), ensure_ascii=False).replace("\x7f", "")


def _write_table(folder: Path, name: str, table: Columns) -> None:
    rows = len(next(iter(table.values())))
    if rows > MOST_ROWS:
        raise ValueError(f"{name}: {rows} rows; a log has {MOST_ROWS} at most: cut it with --begin and --end")
    formats = [_format(column, values) for column, values in table.items()]
    lines, values = ",".join(formats), list(table.values())
    path, size = folder / f"{name}.csv{'.gz' if name in PACKED else ''}", 0
    with path.open("wb") as raw:
        file = gzip.GzipFile("", "wb", 6, raw, mtime=0) if name in PACKED else raw
        file.write((",".join(table) + "\n").encode())
        for first in range(0, rows, CHUNK):
            part = np.column_stack([column[first : first + CHUNK] for column in values])
            text = "".join(lines % tuple(row) + "\n" for row in part.tolist()).encode()
            size += len(text)
            if size > LARGEST:
                raise ValueError(
                    f"{name}: more than {LARGEST} bytes of text, the limit of a table: cut it with --begin and --end"
                )
            file.write(text)
        if file is not raw:
            file.close()


def _format(name: str, values: Floats) -> str:
    """How numbers of a column are written: as finely as the quantity is known."""
    if name in ("lat_deg", "lon_deg"):
        return "%.10f"
    if name == "t_s":
        return "%.6f"
    if np.all(values == np.round(values)) and np.all(np.abs(values) < 1e15):
        return "%.0f"
    if name.startswith("pseudorange") or name.startswith("h_"):
        return "%.4f"
    return "%.15g" if name in EPHEMERIS_DIGITS else "%.9g"


EPHEMERIS_DIGITS = (
    *("toe_s", "sqrta", "ecc", "m0_rad", "dn_radps", "omega_rad", "omega0_rad", "omegadot_radps", "i0_rad"),
    *("idot_radps", "cuc_rad", "cus_rad", "crc_m", "crs_m", "cic_rad", "cis_rad", "toc_s", "af0_s", "af1", "af2"),
    "tgd_s",
)
"""Columns of an ephemeris, which keep all their digits."""
