"""KITTI's OXTS folders: one text file of 30 numbers for each packet of an OXTS unit (KITTI raw development kit).

The position is the unit's own solution, not a fix of its receiver: each second's becomes a fix, and all are the
reference, as independent of the fixes as inertial navigation between them makes it.
"""

from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.importers.recording import MOST_ROWS, Options, Recording

FIELDS = 30
LAT, LON, ALT, ROLL, PITCH, YAW, VN, VE, VU = 0, 1, 2, 3, 4, 5, 6, 7, 10
AX, WX = 11, 17
POSITION_ACCURACY, VELOCITY_ACCURACY = 23, 24
LONGEST = 10_000
"""Most bytes of a packet's file: it has about 500."""
FIX_INTERVAL = 0.999
"""Least time between two fixes, s."""


def recognises(path: Path) -> bool:
    """Whether the folder is one of OXTS, or holds one."""
    return _oxts(path) is not None


def _oxts(path: Path) -> Path | None:
    for place in (path, path / "oxts"):
        if (place / "timestamps.txt").is_file() and (place / "data").is_dir():
            return place
    return None


def read(path: Path, options: Options) -> Recording:
    """Read a drive.

    Raises:
        ValueError: a file is missing or damaged, naming file and line.
    """
    del options
    folder = _oxts(path)
    if folder is None:
        raise ValueError(f"{path}: no KITTI drive: oxts/timestamps.txt and oxts/data are needed")
    time, day = _times(folder / "timestamps.txt")
    files = sorted(folder.joinpath("data").glob("*.txt"))
    if len(files) != len(time):
        raise ValueError(f"{folder}: timestamps.txt has {len(time)} lines, data {len(files)} files; as many are needed")
    values = np.array([_packet(file) for file in files])
    recording = Recording(kind=f"KITTI OXTS {path.name}", clock=f"UTC, s since {day}", axes="flu")
    recording.tables["imu"] = {
        "t_s": time,
        **{f"g{axis}_radps": values[:, WX + k] for k, axis in enumerate("xyz")},
        **{f"a{axis}_mps2": values[:, AX + k] for k, axis in enumerate("xyz")},
    }
    table = {
        **{"t_s": time, "lat_deg": values[:, LAT], "lon_deg": values[:, LON], "h_m": values[:, ALT]},
        **{"vn_mps": values[:, VN], "ve_mps": values[:, VE], "vd_mps": -values[:, VU]},
    }
    angles = {
        "roll_deg": np.degrees(values[:, ROLL]),
        "pitch_deg": -np.degrees(values[:, PITCH]),  # positive where the front is low, in OXTS's axes
        "yaw_deg": np.degrees(np.mod(np.pi / 2.0 - values[:, YAW], 2.0 * np.pi)),  # counterclockwise from east
    }
    recording.tables["reference"] = table | angles
    chosen = _seldom(time)
    position, velocity = values[:, POSITION_ACCURACY], values[:, VELOCITY_ACCURACY]
    sigmas = {f"sd_{axis}_m": position for axis in "ned"} | {f"sd_v{axis}_mps": velocity for axis in "ned"}
    recording.tables["gnss"] = {name: column[chosen] for name, column in (table | sigmas).items()}
    recording.remarks["gnss_from"] = "the OXTS unit's INS/GNSS solution, each second: smoother than fixes of a receiver"
    recording.remarks["reference_of"] = "the same solution at all its times: not independent"
    return recording


def _times(path: Path) -> tuple[Floats, str]:
    """Seconds since the first midnight, and its date."""
    lines = path.read_text(encoding="utf-8-sig", errors="replace").split("\n")
    lines = [line.strip() for line in lines[:MOST_ROWS] if line.strip()]
    times, midnight = [], None
    for number, line in enumerate(lines, 1):
        try:
            whole, _, fraction = line.partition(".")
            moment = datetime.strptime(whole, "%Y-%m-%d %H:%M:%S").replace(tzinfo=timezone.utc)
            part = float(f"0.{fraction or 0}")
        except ValueError:
            wanted = "2011-09-26 13:02:25.594"
            raise ValueError(f"{path}, line {number}: must be like {wanted}, got {line[:60]!r}") from None
        midnight = midnight or moment.replace(hour=0, minute=0, second=0)
        times.append((moment - midnight).total_seconds() + part)
    if len(times) < 2 or midnight is None:
        raise ValueError(f"{path}: needs two lines or more")
    return np.array(times), midnight.strftime("%Y-%m-%d")


def _packet(path: Path) -> list[float]:
    with path.open("rb") as file:
        text = file.read(LONGEST + 1)
    cells = text.split()
    if len(text) > LONGEST or len(cells) < VELOCITY_ACCURACY + 1:
        raise ValueError(f"{path}, line 1: must have {FIELDS} numbers, got {len(cells)} in {len(text)} bytes")
    try:
        return [float(cell) for cell in cells[: VELOCITY_ACCURACY + 1]]
    except ValueError as error:
        raise ValueError(f"{path}, line 1: {error}") from None


def _seldom(time: Floats) -> np.ndarray:
    """The first time of each second."""
    chosen, last = [], -np.inf
    for k, moment in enumerate(time.tolist()):
        if moment - last >= FIX_INTERVAL:
            chosen.append(k)
            last = moment
    return np.array(chosen)
