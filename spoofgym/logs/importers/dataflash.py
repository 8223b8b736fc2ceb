"""ArduPilot's DataFlash logs, binary (.BIN) and text (.log). The format describes itself: FMT messages name the others.

A binary message is 0xA3 0x95, its kind, and the fields that FMT names; letters of the format say their types and scales
(ArduPilot's Logger documentation).
"""

from __future__ import annotations

import csv
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.importers.recording import (
    WEEK,
    Columns,
    Options,
    Recording,
    check_size,
    damaged,
    read_bytes,
    velocity_of_course,
)

HEAD = b"\xa3\x95"
FMT = 128
FMT_SIZE = 89
TYPES: dict[str, tuple[str, float]] = {
    **{"b": ("i1", 1.0), "B": ("u1", 1.0), "M": ("u1", 1.0), "h": ("<i2", 1.0), "H": ("<u2", 1.0)},
    **{"i": ("<i4", 1.0), "I": ("<u4", 1.0), "q": ("<i8", 1.0), "Q": ("<u8", 1.0), "f": ("<f4", 1.0)},
    **{"d": ("<f8", 1.0), "g": ("<f2", 1.0), "c": ("<i2", 0.01), "C": ("<u2", 0.01), "e": ("<i4", 0.01)},
    **{"E": ("<u4", 0.01), "L": ("<i4", 1e-7), "n": ("S4", 0.0), "N": ("S16", 0.0), "Z": ("S64", 0.0)},
    "a": ("V64", 0.0),
}
"""NumPy type and scale of each letter; scale 0 = text or an array, which is not read as a number."""
WANTED = ("IMU", "GPS", "GPA", "ATT", "BARO", "MAG", "SIM", "PARM", "WENC", "ARSP", "MSG")
MOST_TEXT = 4000
"""Longest line of a text log."""


@dataclass
class Kind:
    """A kind of message: its fields, and where its messages begin (binary) or what they say (text)."""

    name: str
    size: int
    letters: str
    columns: list[str]
    offsets: list[int] = field(default_factory=list)
    rows: list[list[str]] = field(default_factory=list)


Table = dict[str, Floats]


def recognises(path: Path) -> bool:
    """Whether the file begins with an FMT message."""
    with path.open("rb") as file:
        start = file.read(64)
    text = start.lstrip(b"\xef\xbb\xbf \r\n")
    return start.startswith(HEAD + bytes([FMT])) or text.startswith((b"FMT, 128", b"FMT,128"))


def read(path: Path, options: Options) -> Recording:
    """Read a DataFlash log.

    Raises:
        ValueError: it is damaged (naming the offset, or line), or has no IMU or GPS messages.
    """
    del options
    check_size(path)
    problems: list[str] = []
    with path.open("rb") as file:
        binary = file.read(2) == HEAD
    tables, parameters, version = _binary(path, problems) if binary else _text(path, problems)
    recording = Recording(
        kind=f"ArduPilot DataFlash {path.name}", clock="the autopilot's, since boot", axes="frd", problems=problems
    )
    if version:
        recording.remarks["vehicle"] = version
    for name in ("IMU", "GPS"):
        if not tables.get(name) or not len(tables[name]["TimeUS"]):
            raise ValueError(f"{path}: has no {name} messages")
    imu = _instance(tables["IMU"], 0)
    names = {"g": ("Gyr", "radps"), "a": ("Acc", "mps2")}
    recording.tables["imu"] = {"t_s": imu["TimeUS"] * 1e-6} | {
        f"{key}{axis.lower()}_{unit}": imu[word + axis] for key, (word, unit) in names.items() for axis in "XYZ"
    }
    _add_fixes(recording, tables, parameters)
    _add_others(recording, tables)
    _add_settings(recording, parameters)
    return recording


def _binary(path: Path, problems: list[str]) -> tuple[dict[str, Table], dict[str, float], str]:
    data = read_bytes(path)
    kinds: dict[int, Kind] = {}
    position, end, lost, first_lost = 0, len(data), 0, None
    while position + 3 <= end:
        if data[position : position + 2] != HEAD:
            following = data.find(HEAD, position + 1)
            following = end if following < 0 else following
            first_lost = position if first_lost is None else first_lost
            lost, position = lost + following - position, following
            continue
        number = data[position + 2]
        size = FMT_SIZE if number == FMT else kinds[number].size if number in kinds else 0
        if size == 0 or position + size > end:
            first_lost = position if first_lost is None else first_lost
            lost, position = lost + 1, position + 1
            continue
        if number == FMT:
            _define(path, position, data[position : position + size], kinds)
        elif kinds[number].name in WANTED:
            kinds[number].offsets.append(position)
        position += size
    if lost:
        problems.append(f"{lost} of {end} bytes are no messages and were skipped, from offset {first_lost} on")
    buffer = np.frombuffer(data, dtype=np.uint8)
    tables: dict[str, Table] = {}
    parameters: dict[str, float] = {}
    version = ""
    for kind in kinds.values():
        if not kind.offsets:
            continue
        raw = _gather(buffer, kind)
        if kind.name == "PARM" and {"Name", "Value"} <= set(raw.dtype.names or ()):
            parameters = dict(zip(map(_word, raw["Name"]), raw["Value"].astype(float).tolist(), strict=True))
        elif kind.name == "MSG" and "Message" in (raw.dtype.names or ()):
            version = next((word for word in map(_word, raw["Message"]) if "V" in word and "(" in word), "")
        else:
            tables[kind.name] = _numbers(kind, raw)
    return tables, parameters, version


def _define(path: Path, offset: int, message: bytes, kinds: dict[int, Kind]) -> None:
    """Take up a kind of message; its size must be that of its fields."""
    number, size, name, letters, columns = struct.unpack("<BB4s16s64s", message[3:])
    kind = Kind(_word(name), size, _word(letters), _word(columns).split(",") if _word(columns) else [])
    if any(letter not in TYPES for letter in kind.letters):
        raise damaged(path, offset, f"FMT of {kind.name!r} has a type that is unknown: {kind.letters!r}")
    needed = 3 + sum(np.dtype(TYPES[letter][0]).itemsize for letter in kind.letters)
    if size != needed or len(kind.columns) != len(kind.letters) or len(set(kind.columns)) < len(kind.columns):
        if kind.name in WANTED:
            raise damaged(
                path,
                offset,
                f"FMT of {kind.name!r} says {size} bytes and {len(kind.columns)} columns; its types {kind.letters!r} "
                f"have {needed} bytes and {len(kind.letters)} columns",
            )
        kind.name = ""
    if size < 3:
        raise damaged(path, offset, f"FMT of {kind.name!r} says a message has {size} bytes; valid are 3 or more")
    kinds[number] = kind


def _gather(buffer: np.ndarray, kind: Kind) -> np.ndarray:
    """The messages of a kind as a structured array."""
    layout = np.dtype([(name, TYPES[letter][0]) for name, letter in zip(kind.columns, kind.letters, strict=True)])
    rows = buffer[np.asarray(kind.offsets)[:, None] + np.arange(3, kind.size)]
    return np.ascontiguousarray(rows).view(layout).ravel()


def _numbers(kind: Kind, raw: np.ndarray) -> Table:
    return {
        name: raw[name].astype(np.float64) * TYPES[letter][1]
        for name, letter in zip(kind.columns, kind.letters, strict=True)
        if TYPES[letter][1]
    }


def _word(text: bytes) -> str:
    return bytes(text).split(b"\0")[0].decode("ascii", "replace").strip()


def _text(path: Path, problems: list[str]) -> tuple[dict[str, Table], dict[str, float], str]:
    kinds: dict[str, Kind] = {}
    parameters: dict[str, float] = {}
    version, bad = "", []
    for line, cells in _lines(path):
        name = cells[0]
        if name == "FMT" and len(cells) > 5:
            kinds[cells[3]] = Kind(cells[3], 0, cells[4], cells[5:])
        elif name == "PARM" and len(cells) >= 3 and name in kinds and "Name" in kinds[name].columns:
            key = cells[1 + kinds[name].columns.index("Name")]
            value = cells[min(2 + kinds[name].columns.index("Name"), len(cells) - 1)]
            parameters[key] = _number(value)
        elif name == "MSG" and not version and "V" in cells[-1] and "(" in cells[-1]:
            version = cells[-1]
        elif name in WANTED and name in kinds:
            if len(cells) == len(kinds[name].columns) + 1:
                kinds[name].rows.append(cells[1:])
            else:
                bad.append(line)
    if bad:
        problems.append(f"{len(bad)} lines have another number of columns than their FMT; left out; first: {bad[0]}")
    tables = {}
    for kind in kinds.values():
        if kind.rows:
            values = np.array([[_number(cell) for cell in row] for row in kind.rows])
            tables[kind.name] = {name: values[:, k].copy() for k, name in enumerate(kind.columns)}
    return tables, parameters, version


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        number = 0
        while text := file.readline(MOST_TEXT):
            number += 1
            if len(text) == MOST_TEXT:
                raise ValueError(f"{path}, line {number}: has {MOST_TEXT} characters or more, and is no DataFlash text")
            cells = [cell.strip() for cell in next(csv.reader([text.rstrip("\r\n")]), [])]
            if cells:
                yield number, cells


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


def _instance(table: Table, number: int) -> Table:
    """The rows of one sensor, where several write the same kind of message."""
    for name in ("I", "Instance"):
        if name in table:
            here = table[name] == number
            return {key: values[here] for key, values in table.items()}
    return table


def _add_fixes(recording: Recording, tables: dict[str, Table], parameters: dict[str, float]) -> None:
    gps = _instance(tables["GPS"], 0)
    north, east = velocity_of_course(gps["Spd"], gps["GCrs"])
    table: Columns = {
        "t_s": gps["TimeUS"] * 1e-6,
        **{"lat_deg": gps["Lat"], "lon_deg": gps["Lng"], "h_m": gps["Alt"]},
        **{"vn_mps": north, "ve_mps": east, "vd_mps": gps["VZ"]},
    }
    accuracy = _instance(tables["GPA"], 0) if "GPA" in tables else None
    if accuracy is not None and len(accuracy["TimeUS"]):
        nearest = np.clip(np.searchsorted(accuracy["TimeUS"], gps["TimeUS"]), 0, len(accuracy["TimeUS"]) - 1)
        pick = {key: accuracy[key][nearest] for key in ("HAcc", "VAcc", "SAcc")}
        table |= {"sd_n_m": pick["HAcc"], "sd_e_m": pick["HAcc"], "sd_d_m": pick["VAcc"]}
        table |= {f"sd_v{axis}_mps": pick["SAcc"] for axis in "ned"}
    table["n_sat"] = gps["NSats"]
    table["tow_s"] = gps["GMS"] / 1000.0
    fix = gps["Status"] >= 3
    again = np.concatenate([[False], (np.diff(gps["GMS"]) == 0) & (np.diff(gps["GWk"]) == 0)])
    if np.count_nonzero(~fix):
        recording.problems.append(f"gnss: {np.count_nonzero(~fix)} of {len(fix)} rows are no 3D fix, and are left out")
    if again.any():
        recording.problems.append(f"gnss: {int(again.sum())} rows repeat the fix before, and are left out")
    recording.tables["gnss"] = {key: values[fix & ~again] for key, values in table.items()}
    recording.remarks["height"] = "h_m is above sea level: ArduPilot logs no other; the difference is constant"
    _tell_jitter(recording, gps["TimeUS"] * 1e-6, gps["GWk"] * WEEK + gps["GMS"] / 1000.0, fix)


def _tell_jitter(recording: Recording, logged: Floats, measured: Floats, fix: np.ndarray) -> None:
    """Tell by how much the delay from measuring to logging varies."""
    late = (logged - measured)[fix]
    if len(late) > 1 and (spread := float(np.percentile(late, 95.0) - np.min(late))) > 0.05:
        recording.problems.append(f"gnss: fixes are logged with a delay that varies by {spread:.2f} s (95 %)")


def _add_settings(recording: Recording, parameters: dict[str, float]) -> None:
    delay = parameters.get("GPS_DELAY_MS", parameters.get("GPS1_DELAY_MS", 0.0)) / 1000.0
    if 0.0 < delay < 1.0:
        recording.settings["gnss_delay_s"] = round(delay, 4)
    arm = []
    for axis in "XYZ":
        antenna = parameters.get(f"GPS_POS1_{axis}", parameters.get(f"GPS1_POS_{axis}", 0.0))
        arm.append(round(antenna - parameters.get(f"INS_POS1_{axis}", parameters.get(f"INS_POS_{axis}", 0.0)), 4))
    if any(arm):
        recording.settings["antenna_lever_arm_m"] = [float(value) for value in arm]


def _add_others(recording: Recording, tables: dict[str, Table]) -> None:
    if "ATT" in tables:
        angles = {f"{name.lower()}_rad": np.radians(tables["ATT"][name]) for name in ("Roll", "Pitch", "Yaw")}
        recording.tables["attitude"] = {"t_s": tables["ATT"]["TimeUS"] * 1e-6, **angles}
    wanted = {
        "barometer": ("BARO", {"baro_m": "Alt", "pressure_pa": "Press"}),
        "magnetometer": ("MAG", {f"m{axis.lower()}_mgauss": f"Mag{axis}" for axis in "XYZ"}),
        "airspeed": ("ARSP", {"airspeed_mps": "Airspeed"}),
        "wheels": ("WENC", {"distance_0_m": "Dist0", "distance_1_m": "Dist1"}),
    }
    for name, (kind, columns) in wanted.items():
        table = _instance(tables.get(kind, {}), 0)
        if table and all(column in table for column in columns.values()):
            named = {key: table[column] for key, column in columns.items()}
            recording.tables[name] = {"t_s": table["TimeUS"] * 1e-6, **named}
    if "SIM" in tables and {"Lat", "Lng", "Alt"} <= set(tables["SIM"]):
        truth = tables["SIM"]
        angles = {f"{name.lower()}_deg": truth[name] for name in ("Roll", "Pitch", "Yaw")}
        place = {"lat_deg": truth["Lat"], "lon_deg": truth["Lng"], "h_m": truth["Alt"]}
        recording.tables["reference"] = {"t_s": truth["TimeUS"] * 1e-6, **place, **angles}
        recording.remarks["reference_of"] = "the simulator's truth (SIM)"
