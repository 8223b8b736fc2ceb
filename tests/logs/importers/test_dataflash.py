"""ArduPilot's DataFlash: the drive comes back from binary and from text, and stray bytes are skipped and told."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from spoofgym.geodesy import position_difference
from spoofgym.logs.log import interpolate
from tests.logs.importers.drive import ABSENT, DATA, drive, imported

BOOT = 200.0
FORMATS = {
    128: ("FMT", "BBnNZ", "Type,Length,Name,Format,Columns", 89),
    1: ("GPS", "QBIHBcLLeffffB", "TimeUS,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U", 0),
    2: ("GPA", "QCCCCfBIH", "TimeUS,VDop,HAcc,VAcc,SAcc,YAcc,VV,SMS,Delta", 0),
    3: ("IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", 0),
    4: ("PARM", "QNf", "TimeUS,Name,Value", 0),
    5: ("MSG", "QZ", "TimeUS,Message", 0),
    6: ("ATT", "QccccCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw", 0),
}
PACK = {"L": "i", "c": "h", "C": "H", "e": "i", "n": "4s", "N": "16s", "Z": "64s"}
SCALE = {"L": 1e7, "c": 100.0, "C": 100.0, "e": 100.0}
Rows = list[tuple[str, list[object]]]


def layout(letters: str) -> str:
    return "<" + "".join(PACK.get(letter, letter) for letter in letters)


def rows() -> Rows:
    """Messages in the order of their times."""
    true = drive()
    result: list[tuple[float, str, list[object]]] = [
        (0.0, "MSG", [0, "ArduRover V4.5.7 (abcdef01)"]),
        (0.0, "PARM", [0, "GPS_DELAY_MS", 120.0]),
        (0.0, "PARM", [0, "GPS_POS1_Z", -0.8]),
    ]
    for k, time in enumerate(true.time + BOOT):
        stamp = round(1e6 * time)
        result.append((time, "IMU", [stamp, 0, *true.rate[k], *true.force[k]]))
        result.append((time, "IMU", [stamp + 200, 1, *(-true.rate[k]), *true.force[k]]))
        result.append((time, "ATT", [stamp, 0.0, 10.0, 0.0, -5.0, 0.0, 270.0]))
    for k, time in enumerate(true.fix_time + BOOT):
        stamp = round(1e6 * (time + 0.12))
        place = [true.place[k, 0], true.place[k, 1], true.place[k, 2]]
        status = 6 if k else 1
        gps = [stamp, status, 300_000_000 + 200 * k, 2300, 14, 0.8, *place, true.speed[k], true.course[k]]
        result.append((time, "GPS", [*gps, true.velocity[k, 2], 0.0, 1]))
        result.append((time, "GPA", [stamp, 1.2, 0.9, 1.6, 0.2, 0.0, 1, 1000, 200]))
    result.sort(key=lambda row: row[0])
    return [(name, values) for _, name, values in result]


def binary(messages: Rows) -> bytes:
    numbers = {entry[0]: number for number, entry in FORMATS.items()}
    parts = []
    for number, (name, letters, columns, size) in FORMATS.items():
        size = size or 3 + struct.calcsize(layout(letters))
        content = struct.pack("<BB4s16s64s", number, size, name.encode(), letters.encode(), columns.encode())
        parts.append(b"\xa3\x95\x80" + content)
    for name, values in messages:
        letters = FORMATS[numbers[name]][1]
        raw = [
            value.encode() if isinstance(value, str) else round(value * SCALE[letter]) if letter in SCALE else value  # type: ignore[operator]
            for letter, value in zip(letters, values, strict=True)
        ]
        parts.append(b"\xa3\x95" + bytes([numbers[name]]) + struct.pack(layout(letters), *raw))
    return b"".join(parts)


def text(messages: Rows) -> str:
    lines = [f"FMT, {n}, {s or 99}, {name}, {letters}, {columns}" for n, (name, letters, columns, s) in FORMATS.items()]
    return "\n".join(lines + [", ".join([name, *map(str, values)]) for name, values in messages]) + "\n"


@pytest.mark.parametrize("form", ["bin", "log"])
def test_a_drive_comes_back(tmp_path: Path, form: str) -> None:
    path = tmp_path / f"drive.{form}"
    path.write_bytes(binary(rows()) if form == "bin" else text(rows()).encode())
    recording, log = imported(path, tmp_path / "log")
    assert recording.settings == {"gnss_delay_s": 0.12, "antenna_lever_arm_m": [0.0, 0.0, -0.8]}
    assert recording.remarks["vehicle"] == "ArduRover V4.5.7 (abcdef01)"
    assert f"1 of {len(drive().fix_time)} rows are no 3D fix" in recording.problems[0]
    np.testing.assert_allclose(log.fixes.time - BOOT, drive().fix_time[1:], atol=2e-6)
    np.testing.assert_allclose(np.degrees(log.fixes.position[:, :2]), drive().place[1:, :2], atol=1e-7)
    np.testing.assert_allclose(log.imu_time - BOOT, drive().time, atol=2e-6)
    np.testing.assert_allclose(log.angular_rate[:, 1], drive().rate[:, 0], atol=1e-6)
    assert log.fixes.velocity is not None
    np.testing.assert_allclose(log.fixes.velocity[:, 0], drive().velocity[1:, 1], atol=1e-3)
    assert log.fixes.position_sigma is not None
    np.testing.assert_allclose(log.fixes.position_sigma[0], [0.9, 0.9, 1.6])
    np.testing.assert_allclose(recording.tables["attitude"]["yaw_rad"], np.radians(270.0), atol=1e-9)


def test_stray_bytes_are_skipped_and_told(tmp_path: Path) -> None:
    """Among them a head without a message, and a kind that no FMT has named."""
    messages = rows()
    whole = binary(messages)
    definitions = len(binary([]))
    stray = b"\xa3\x95\xee garbage \xa3"
    path = tmp_path / "drive.bin"
    path.write_bytes(whole[:definitions] + stray + whole[definitions:])
    recording, log = imported(path, tmp_path / "log")
    assert len(log.imu_time) == len(drive().time)
    assert f"{len(stray)} of {len(whole) + len(stray)} bytes are no messages" in recording.problems[0]
    assert f"from offset {definitions} on" in recording.problems[0]


def test_a_format_that_contradicts_itself_is_refused(tmp_path: Path) -> None:
    whole = bytearray(binary(rows()))
    place = whole.find(b"\x80\x01") + 2  # the length of GPS
    whole[place] = 7
    path = tmp_path / "drive.bin"
    path.write_bytes(whole)
    with pytest.raises(ValueError, match=r"drive\.bin, offset 89: FMT of 'GPS' says 7 bytes"):
        imported(path, tmp_path / "log")


@pytest.mark.skipif(not (DATA / "dataflash").is_dir(), reason=ABSENT)
def test_a_real_file_agrees_with_the_simulators_truth(tmp_path: Path) -> None:
    recording, log = imported(DATA / "dataflash" / "00000150.BIN", tmp_path / "log")
    assert len(log.fixes.time) == 278
    assert log.reference is not None
    inside = log.fixes.time < log.reference.time[-1]
    inside &= log.fixes.time > log.reference.time[0]
    place, velocity = interpolate(log.reference, log.fixes.time[inside])
    apart = position_difference(log.fixes.position[inside], place)
    assert np.abs(apart[:, 2]).max() < 1.0
    assert np.hypot(apart[:, 0], apart[:, 1]).max() < 1.5  # the simulator's GPS is 0.2 s late, at up to 4.8 m/s
    assert log.fixes.velocity is not None
    np.testing.assert_allclose(log.fixes.velocity[inside], velocity, atol=1.5)
    assert "14 of 2930688 bytes" in recording.problems[0]
