"""Sources that are folders: comma2k19, KITTI, UBX beside an IMU. The drive comes back; damage is named."""

from __future__ import annotations

import struct
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from spoofgym.geodesy import ecef_to_enu_rotation, geodetic_to_ecef
from spoofgym.logs.importers import ubx
from spoofgym.logs.importers.recording import C
from spoofgym.logs.log import IMU_COLUMNS
from tests.logs.importers.drive import drive, imported

BOOT, TOW, WEEK = 46_000.0, 404_000.0, 2012
UTC = 315_964_800 + WEEK * 604_800 + TOW - 18.0


def save(path: Path, values: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        np.save(file, values)


def comma(folder: Path, scale: float = 1e3) -> Path:
    true, log = drive(), folder / "processed_log"
    for name, values in (("gyro", true.rate), ("accelerometer", true.force)):
        save(log / "IMU" / name / "t", true.time + BOOT)
        save(log / "IMU" / name / "value", values)
    place, utc = true.place, (true.fix_time + UTC) * scale
    fixes = np.column_stack([place[:, 0], place[:, 1], true.speed, utc, place[:, 2], true.course])
    late = 0.01 * (np.arange(len(utc)) % 3)
    save(log / "GNSS" / "live_gnss_ublox" / "t", true.fix_time + BOOT + late)
    save(log / "GNSS" / "live_gnss_ublox" / "value", fixes)
    glonass = [70, WEEK, TOW + 1.0, 3, 2e7, 8, 1, 1, 40]
    raw = np.array([[5, WEEK, TOW + 1.0, np.nan, 2.2e7, 8.0, -120.0, 0.1, 45.0], glonass])
    save(log / "GNSS" / "raw_gnss_ublox" / "t", np.array([BOOT + 1.1, BOOT + 1.1]))
    save(log / "GNSS" / "raw_gnss_ublox" / "value", raw)
    position = place * [np.pi / 180.0, np.pi / 180.0, 1.0]
    enu = true.velocity[:, [1, 0, 2]] * [1.0, 1.0, -1.0]
    save(folder / "global_pose" / "frame_times", true.fix_time + BOOT)
    save(folder / "global_pose" / "frame_positions", geodetic_to_ecef(position))
    velocity = np.einsum("nji,nj->ni", ecef_to_enu_rotation(position), enu)
    save(folder / "global_pose" / "frame_velocities", velocity)
    return folder


@pytest.mark.parametrize("scale", [1.0, 1e3])
def test_comma2k19(tmp_path: Path, scale: float) -> None:
    recording, log = imported(comma(tmp_path / "segment", scale), tmp_path / "log")
    assert log.fixes.velocity is not None
    np.testing.assert_allclose(log.fixes.velocity[:, :2], drive().velocity[:, [1, 0]], atol=1e-9)
    np.testing.assert_allclose(log.imu_time - TOW, drive().time, atol=2e-6)
    np.testing.assert_allclose(log.specific_force[:, 2], -drive().force[:, 2], atol=1e-7)
    assert log.reference is not None
    assert log.reference.velocity is not None
    np.testing.assert_allclose(log.reference.position, log.fixes.position, atol=1e-3, rtol=1e-11)
    np.testing.assert_allclose(log.reference.velocity[:, 2], -drive().velocity[:, 2], atol=1e-6)
    np.testing.assert_allclose(recording.tables["ranges"]["svid"], [5])
    np.testing.assert_allclose(recording.tables["ranges"]["t_s"], [TOW + 1.0])


def test_arrays_are_never_unpickled(tmp_path: Path) -> None:
    folder = comma(tmp_path / "segment")
    path = folder / "processed_log" / "IMU" / "gyro" / "t"
    with path.open("wb") as file:
        np.save(file, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(ValueError, match=r"gyro/t, offset 0: no NumPy array"):
        imported(folder, tmp_path / "log")


def test_an_array_that_lies_about_its_size_costs_no_memory(tmp_path: Path) -> None:
    folder = comma(tmp_path / "segment")
    path = folder / "processed_log" / "IMU" / "gyro" / "value"
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000, 3), }"
    header += b" " * (117 - len(header)) + b"\n"
    path.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(48))
    with pytest.raises(ValueError, match=r"gyro/value"):
        imported(folder, tmp_path / "log")


def kitti(folder: Path) -> Path:
    """A packet at each fix: KITTI's OXTS is as slow as that."""
    true, data = drive(), folder / "oxts" / "data"
    data.mkdir(parents=True)
    stamps = []
    for k, time in enumerate(true.fix_time):
        moment = datetime(2011, 9, 26, 13, 2, 25) + timedelta(seconds=float(time))
        stamps.append(moment.strftime("%Y-%m-%d %H:%M:%S.%f") + "000")
        sample = int(np.argmin(np.abs(true.time - time)))
        values = np.zeros(30)
        values[:3], values[[6, 7, 10]] = true.place[k], true.velocity[k] * [1.0, 1.0, -1.0]
        values[5] = np.pi / 2.0 - np.radians(true.course[k])
        values[11:14], values[17:20] = true.force[sample] * [1, -1, -1], true.rate[sample] * [1, -1, -1]
        values[23:25] = 0.8, 0.05
        data.joinpath(f"{k:010d}.txt").write_text(" ".join(map(repr, values.tolist())) + "\n")
    (folder / "oxts" / "timestamps.txt").write_text("\n".join(stamps) + "\n")
    return folder


def test_kitti(tmp_path: Path) -> None:
    _, log = imported(kitti(tmp_path / "drive"), tmp_path / "log")
    midnight = 13 * 3600 + 2 * 60 + 25
    assert log.reference is not None
    np.testing.assert_allclose(log.reference.time - midnight, drive().fix_time, atol=2e-6)
    assert log.reference.velocity is not None
    np.testing.assert_allclose(log.reference.velocity[:, :2], drive().velocity[:, [1, 0]], atol=1e-7)
    assert np.all(np.abs(np.diff(log.fixes.time) - 1.0) < 1e-5)
    samples = [int(np.argmin(np.abs(drive().time - time))) for time in drive().fix_time]
    np.testing.assert_allclose(log.specific_force[:, 1], drive().force[samples, 0], atol=1e-7)
    np.testing.assert_allclose(log.angular_rate[:, 2], -drive().rate[samples, 2], atol=1e-8)
    assert log.fixes.position_sigma is not None
    np.testing.assert_allclose(log.fixes.position_sigma[0], 0.8)


@pytest.mark.parametrize(
    ("file", "content", "told"),
    [
        ("data/0000000004.txt", "1 2 3\n", r"0000000004\.txt, line 1: must have 30 numbers, got 3"),
        ("data/0000000004.txt", "x " * 30, r"0000000004\.txt, line 1: could not convert"),
        ("timestamps.txt", "yesterday\n", r"timestamps\.txt, line 1: must be like 2011-09-26"),
        ("data/more.txt", "1 " * 30, "as many are needed"),
    ],
)
def test_a_damaged_kitti_drive_is_named(tmp_path: Path, file: str, content: str, told: str) -> None:
    folder = kitti(tmp_path / "drive")
    (folder / "oxts" / file).write_text(content)
    with pytest.raises(ValueError, match=told):
        imported(folder, tmp_path / "log")


def message(kind: tuple[int, int], content: bytes) -> bytes:
    body = bytes(kind) + struct.pack("<H", len(content)) + content
    first = second = 0
    for byte in body:  # RFC 1145, as u-blox prints it
        first = (first + byte) & 0xFF
        second = (second + first) & 0xFF
    return b"\xb5\x62" + body + bytes((first, second))


def pvt(k: int, fix: int = 3) -> bytes:
    true = drive()
    content = bytearray(92)
    struct.pack_into("<I", content, 0, round(1e3 * (TOW + true.fix_time[k])))
    content[20], content[21], content[23] = fix, 1, 12
    place = (round(1e7 * true.place[k, 1]), round(1e7 * true.place[k, 0]), round(1e3 * true.place[k, 2]), 0)
    struct.pack_into("<4i2I3i", content, 24, *place, 1500, 2500, *np.round(1e3 * true.velocity[k]).astype(int).tolist())
    struct.pack_into("<I", content, 68, 200)
    return message((1, 7), bytes(content))


def rawx(time: float) -> bytes:
    """A GPS L1 range, one that is not valid, and one of Galileo."""
    content = bytearray(16 + 3 * 32)
    struct.pack_into("<d", content, 0, time)
    content[11] = 3
    for k, (system, status) in enumerate(((0, 1), (0, 0), (2, 1))):
        struct.pack_into("<ddfBBB", content, 16 + 32 * k, 2.2e7, 1.1e8, 1000.0, system, 5 + k, 0)
        content[16 + 32 * k + 26], content[16 + 32 * k + 27], content[16 + 32 * k + 30] = 47, 3, status
    return message((2, 0x15), bytes(content))


def receiver(folder: Path, *, imu: bool = True, before: bytes = b"") -> Path:
    folder.mkdir()
    parts = [pvt(k, 3 if k else 2) + (rawx(TOW + 1.0) if k == 5 else b"") for k in range(len(drive().fix_time))]
    (folder / "drive.ubx").write_bytes(before + b"".join(parts))
    if imu:
        values = np.column_stack([drive().time + TOW, drive().rate, drive().force])
        np.savetxt(folder / "imu.csv", values, delimiter=",", header=",".join(IMU_COLUMNS), comments="", fmt="%.12g")
    return folder


def test_ubx(tmp_path: Path) -> None:
    stray = b"$GNGGA,123,,*00\r\n\xb5\x62\x01\x07\xff\xff"
    recording, log = imported(receiver(tmp_path / "drive", before=stray), tmp_path / "log", axes="frd")
    np.testing.assert_allclose(log.fixes.time - TOW, drive().fix_time[1:], atol=1e-3)
    np.testing.assert_allclose(np.degrees(log.fixes.position[:, 1]), drive().place[1:, 1], atol=1e-7)
    assert log.fixes.velocity is not None
    np.testing.assert_allclose(log.fixes.velocity[:, 0], drive().velocity[1:, 1], atol=1e-3)
    assert log.fixes.position_sigma is not None
    np.testing.assert_allclose(log.fixes.position_sigma[0], [1.5, 1.5, 2.5])
    ranges = recording.tables["ranges"]
    np.testing.assert_array_equal(ranges["svid"], [5])
    np.testing.assert_allclose(ranges["range_rate_mps"], -1000.0 * C / 1_575.42e6)  # a rising Doppler comes nearer
    np.testing.assert_allclose([ranges["pr_std"][0], ranges["cn0_dbhz"][0]], [0.08, 47.0])
    assert f"{len(stray)} of" in recording.problems[0]
    assert "1 NAV-PVT are no valid 3D fix" in recording.problems[1]


def test_ubx_without_inertial_samples_says_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"imu\.csv is missing: a UBX file has no inertial samples"):
        imported(receiver(tmp_path / "drive", imu=False), tmp_path / "log")


def test_checksum_is_that_of_the_protocol() -> None:
    for content in (b"", b"\x01", bytes(range(200))):
        whole = message((1, 2), content)
        assert [found[2] for found in ubx.messages(whole)] == [content]
    assert list(ubx.messages(whole[:-1] + b"\x00")) == []
