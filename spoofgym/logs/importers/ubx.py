"""u-blox UBX: fixes from NAV-PVT and ranges from RXM-RAWX; an IMU file in the log format lies beside.

A message is 0xB5 0x62, class, number, length (2 bytes), content, and the checksum of RFC 1145 (u-blox, Interface
Description of the protocol versions 18 to 34).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from spoofgym.logs.importers.recording import WEEK, C, Columns, Options, Recording, read_bytes
from spoofgym.logs.log import IMU_COLUMNS, LIMITS
from spoofgym.logs.table import has_table, read_table, table_path

SYNC = b"\xb5\x62"
NAV_PVT, RXM_RAWX = (0x01, 0x07), (0x02, 0x15)
PVT_SIZE, RAWX_HEAD, RAWX_EACH = 84, 16, 32
LONGEST = 8192
"""Longest content of a message that is believed, bytes."""
FIX_COLUMNS = (
    *("t_s", "lat_deg", "lon_deg", "h_m", "vn_mps", "ve_mps", "vd_mps"),
    *("sd_n_m", "sd_e_m", "sd_d_m", "sd_vn_mps", "sd_ve_mps", "sd_vd_mps", "n_sat"),
)
RANGE_COLUMNS = ("t_s", "svid", "pseudorange_m", "range_rate_mps", "cn0_dbhz", "pr_std", "rr_std", "carrier_m")
L1_WAVELENGTH = C / 1_575.42e6
GPS_ID, L1_CODE = 0, 0
OK = 0x01
"""gnssFixOK, and "pseudorange valid" of RXM-RAWX."""


def recognises(path: Path) -> bool:
    """Whether a file holds UBX messages, or a folder such a file."""
    file = ubx_file(path)
    if file is None:
        return False
    with file.open("rb") as opened:
        start = opened.read(65_536)
    return next(messages(start), None) is not None


def ubx_file(path: Path) -> Path | None:
    """The file itself, or the only one of a folder that ends in .ubx; None = there is none."""
    if path.is_file():
        return path
    found = sorted(entry for entry in path.iterdir() if entry.suffix.lower() == ".ubx" and entry.is_file())
    return found[0] if len(found) == 1 else None


def read(path: Path, options: Options) -> Recording:
    """Read a folder with one UBX file and ``imu.csv``, whose times are GPS time of week.

    Raises:
        ValueError: there is no UBX file or no ``imu.csv``, or no NAV-PVT.
    """
    del options
    file = ubx_file(path)
    if file is None:
        raise ValueError(f"{path}: must hold one file that ends in .ubx")
    beside = file.parent
    if not has_table(beside, "imu"):
        raise ValueError(
            f"{beside}: imu.csv is missing: a UBX file has no inertial samples; put those beside it, in the columns of "
            "the log format and with times in GPS time of week"
        )
    data = read_bytes(file)
    recording = Recording(kind=f"u-blox UBX {file.name}", clock="GPS time of week, s", axes="unknown")
    fixes: list[tuple[float, ...]] = []
    ranges: list[tuple[float, ...]] = []
    used = no_fix = 0
    for _, kind, content in messages(data):
        used += len(content) + 8
        if kind == NAV_PVT and len(content) >= PVT_SIZE:
            fix = _fix(content)
            no_fix += fix is None
            fixes += [] if fix is None else [fix]
        elif kind == RXM_RAWX:
            ranges += _ranges(content)
    if used < len(data):
        recording.problems.append(f"{len(data) - used} of {len(data)} bytes are no UBX messages with a right checksum")
    if no_fix:
        recording.problems.append(f"gnss: {no_fix} NAV-PVT are no valid 3D fix, and are left out")
    _add(recording, fixes, ranges)
    table = read_table(table_path(beside, "imu"), [IMU_COLUMNS], [], LIMITS)
    recording.tables["imu"] = {name: table[name] for name in IMU_COLUMNS}
    return recording


def messages(data: bytes) -> Iterator[tuple[int, tuple[int, int], bytes]]:
    """Offset, class and number, and content of each message whose checksum is right."""
    place = data.find(SYNC)
    while place >= 0 and place + 8 <= len(data):
        length = int.from_bytes(data[place + 4 : place + 6], "little")
        end = place + 8 + length
        if length <= LONGEST and end <= len(data) and checksum(data[place + 2 : end - 2]) == data[end - 2 : end]:
            yield place, (data[place + 2], data[place + 3]), data[place + 6 : end - 2]
            place = data.find(SYNC, end)
        else:
            place = data.find(SYNC, place + 1)


def checksum(data: bytes) -> bytes:
    """Fletcher's of 8 bits, 2 bytes."""
    bytes_ = np.frombuffer(data, dtype=np.uint8).astype(np.int64)
    first = int(bytes_.sum()) & 0xFF
    second = int((bytes_ * np.arange(len(bytes_), 0, -1)).sum()) & 0xFF
    return bytes((first, second))


def _fix(content: bytes) -> tuple[float, ...] | None:
    """A row of fixes; None = no valid 3D fix."""
    tow, kind, flags, satellites = int.from_bytes(content[:4], "little"), content[20], content[21], content[23]
    if kind not in (3, 4) or not flags & OK:
        return None
    longitude, latitude, height, _, horizontal, vertical = struct.unpack_from("<4i2I", content, 24)
    north, east, down = struct.unpack_from("<3i", content, 48)
    speed_accuracy = struct.unpack_from("<I", content, 68)[0] / 1e3
    place = (latitude * 1e-7, longitude * 1e-7, height / 1e3)
    velocity = (north / 1e3, east / 1e3, down / 1e3)
    sigmas = (horizontal / 1e3, horizontal / 1e3, vertical / 1e3, *(speed_accuracy,) * 3)
    return (tow / 1e3, *place, *velocity, *sigmas, float(satellites))


def _ranges(content: bytes) -> list[tuple[float, ...]]:
    """Rows of GPS L1 C/A; the number of measurements is what the message has room for."""
    if len(content) < RAWX_HEAD:
        return []
    time, count = struct.unpack_from("<d", content, 0)[0], content[11]
    rows = []
    for k in range(min(count, (len(content) - RAWX_HEAD) // RAWX_EACH)):
        at = RAWX_HEAD + k * RAWX_EACH
        pseudorange, carrier, doppler, system, satellite, signal = struct.unpack_from("<ddfBBB", content, at)
        cn0, code, _, rate, status = struct.unpack_from("<5B", content, at + 26)
        if system == GPS_ID and signal == L1_CODE and status & OK:
            deviation = 0.01 * 2 ** (code & 0x0F), 0.002 * 2 ** (rate & 0x0F) * L1_WAVELENGTH
            row = (pseudorange, -doppler * L1_WAVELENGTH, cn0, *deviation, carrier * L1_WAVELENGTH)
            rows.append((time, float(satellite), *map(float, row)))
    return rows


def _add(recording: Recording, fixes: list[tuple[float, ...]], ranges: list[tuple[float, ...]]) -> None:
    recording.tables["gnss"] = _columns(FIX_COLUMNS, fixes)
    _unwrap(recording.tables["gnss"])
    if ranges:
        recording.tables["ranges"] = _columns(RANGE_COLUMNS, ranges)
        _unwrap(recording.tables["ranges"])
        recording.problems.append("ranges: ephemeris.csv is missing: take it from a RINEX navigation file")


def _columns(names: tuple[str, ...], rows: list[tuple[float, ...]]) -> Columns:
    values = np.array(rows, dtype=np.float64).reshape(len(rows), len(names))
    return {name: values[:, k].copy() for k, name in enumerate(names)}


def _unwrap(table: Columns) -> None:
    """Let the time of week run on over the end of the week."""
    back = np.concatenate([[False], np.diff(table["t_s"]) < -0.5 * WEEK])
    table["t_s"] += WEEK * np.cumsum(back[: len(table["t_s"])])
