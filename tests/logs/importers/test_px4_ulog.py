"""PX4's ULog: both generations of field names come back as they were written, and a damaged file is refused by name."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from spoofgym.logs.importers.px4_ulog import check_definitions
from tests.logs.importers.drive import ABSENT, DATA, check, drive, imported

pytest.importorskip("pyulog")
BOOT = 100.0
"""Time since boot at the drive's beginning, s."""
HEADER = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1)
IMU = "uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;float[3] accelerometer_m_s2;"
ATTITUDE = "uint64_t timestamp;float[4] q;"
COMMON = (
    "float s_variance_m_s;float eph;float epv;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;"
    "uint64_t time_utc_usec;uint8_t fix_type;bool vel_ned_valid;uint8_t satellites_used;"
)
OLD = "uint64_t timestamp;int32_t lat;int32_t lon;int32_t alt;int32_t alt_ellipsoid;" + COMMON
NEW = (
    "uint64_t timestamp;uint64_t timestamp_sample;double latitude_deg;double longitude_deg;double altitude_msl_m;"
    "double altitude_ellipsoid_m;" + COMMON
)


def message(kind: str, content: bytes) -> bytes:
    return struct.pack("<HB", len(content), ord(kind)) + content


def parameter(name: str, value: float) -> bytes:
    key = f"float {name}".encode()
    return message("P", bytes([len(key)]) + key + struct.pack("<f", value))


def ulog(new: bool, fix_type: int = 3) -> bytes:
    """The drive as an ULog file."""
    true = drive()
    topics = {0: ("sensor_combined", IMU), 1: ("sensor_gps" if new else "vehicle_gps_position", NEW if new else OLD)}
    topics[2] = ("vehicle_attitude", ATTITUDE)
    parts = [HEADER, *(message("F", f"{name}:{fields}".encode()) for name, fields in topics.values())]
    parts += [parameter("EKF2_GPS_DELAY", 110.0), parameter("EKF2_GPS_POS_X", 0.5), parameter("EKF2_IMU_POS_X", 0.1)]
    parts += [message("A", struct.pack("<BH", 0, number) + name.encode()) for number, (name, _) in topics.items()]
    rows = []
    for k, time in enumerate(true.time + BOOT):
        stamp = round(1e6 * (time + 0.01))  # at the end of the 20 ms over which the samples are means
        content = struct.pack("<HQ3fI3f", 0, stamp, *true.rate[k], 20_000, *true.force[k])
        rows.append((time, message("D", content)))
        rows.append((time, message("D", struct.pack("<HQ4f", 2, stamp, np.cos(0.3), 0.0, 0.0, np.sin(0.3)))))
    for k, time in enumerate(true.fix_time + BOOT):
        latitude, longitude, height = true.place[k]
        rest = struct.pack("<6f", 0.3, 1.5, 2.5, *true.velocity[k])
        rest += struct.pack("<QBBB", 1_700_000_000_000_000 + 1000 * k, fix_type, 1, 12)
        stamp = round(1e6 * time)
        if new:
            place = struct.pack("<QQ4d", stamp + 90_000, stamp, latitude, longitude, height - 47.0, height)
        else:
            numbers = (round(1e7 * latitude), round(1e7 * longitude), round(1e3 * (height - 47.0)), round(1e3 * height))
            place = struct.pack("<Q4i", stamp + 110_000, *numbers)
        rows.append((time, message("D", struct.pack("<H", 1) + place + rest)))
    return b"".join(parts + [content for _, content in sorted(rows, key=lambda row: row[0])])


@pytest.mark.parametrize("new", [False, True])
def test_a_drive_comes_back(tmp_path: Path, new: bool) -> None:
    path = tmp_path / "drive.ulg"
    path.write_bytes(ulog(new))
    recording, log = imported(path, tmp_path / "log")
    check(log, BOOT, place=1e-7, velocity=1e-5)
    assert log.fixes.position_sigma is not None
    np.testing.assert_allclose(log.fixes.position_sigma[0], [1.5, 1.5, 2.5])
    # new releases tell when a fix was measured, so that the delay on arrival does not count
    assert recording.settings.get("gnss_delay_s") == (None if new else 0.11)
    np.testing.assert_allclose(log.lever_arm, [0.0, 0.4, 0.0])
    np.testing.assert_allclose(recording.tables["attitude"]["yaw_rad"], 0.6, atol=1e-6)


def test_rows_without_a_fix_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "drive.ulg"
    path.write_bytes(ulog(new=True, fix_type=2))
    with pytest.raises(ValueError, match="0 fixes found"):
        imported(path, tmp_path / "log")
    assert not (tmp_path / "log").exists()


@pytest.mark.parametrize(
    ("definition", "told"),
    [
        ("a:uint8_t[60000] x;", "has more than 5000 numbers"),
        ("a:a[2] x;", "nested in itself"),
        ("b:uint8_t[70] x;", None),
    ],
)
def test_formats_that_unfold_without_end_are_refused(tmp_path: Path, definition: str, told: str | None) -> None:
    path = tmp_path / "bad.ulg"
    path.write_bytes(HEADER + message("F", b"c:uint8_t x;") + message("F", definition.encode()))
    if told is None:
        check_definitions(path)
    else:
        with pytest.raises(ValueError, match=rf"bad\.ulg, offset 31: format .*{told}"):
            check_definitions(path)


def test_formats_that_multiply_are_refused(tmp_path: Path) -> None:
    """Twelve levels of ten: pyulog would make 10^12 fields."""
    path = tmp_path / "bad.ulg"
    nested = [f"m{k}:{f'm{k + 1}' if k < 12 else 'float'}[10] x;".encode() for k in range(13)]
    path.write_bytes(HEADER + b"".join(message("F", entry) for entry in nested))
    with pytest.raises(ValueError, match="more than 5000 numbers"):
        check_definitions(path)


def test_what_comes_after_damage_is_left_out(tmp_path: Path) -> None:
    """pyulog would seek a way through it for ever."""
    whole = ulog(new=False)
    path = tmp_path / "drive.ulg"
    path.write_bytes(whole + b"\xff\xff\x00" + bytes(100))
    recording, _ = imported(path, tmp_path / "log")
    assert f"damaged or cut at offset {len(whole)} of {len(whole) + 103}" in recording.problems[0]


@pytest.mark.parametrize("length", [17, 60, 200, 1000])
def test_a_file_that_is_cut_is_refused_in_one_line(tmp_path: Path, length: int) -> None:
    path = tmp_path / "cut.ulg"
    path.write_bytes(ulog(new=False)[:length])
    with pytest.raises(ValueError, match=r"cut\.ulg"):
        imported(path, tmp_path / "log")
    assert [entry.name for entry in tmp_path.iterdir()] == ["cut.ulg"]


@pytest.mark.skipif(not (DATA / "ulog").is_dir(), reason=ABSENT)
@pytest.mark.parametrize(
    ("name", "samples", "fixes", "rate"),
    [("sample_log_small", 1298, 32, 200.0), ("sample_px4_events", 7783, 423, 250.0)],
)
def test_real_files(tmp_path: Path, name: str, samples: int, fixes: int, rate: float) -> None:
    """A vehicle that stands: gravity is down, and the autopilot's own attitude says the same."""
    recording, log = imported(DATA / "ulog" / f"{name}.ulg", tmp_path / "log")
    assert len(log.imu_time) == samples
    assert len(log.fixes.time) == fixes
    assert np.median(np.diff(log.imu_time)) == pytest.approx(1.0 / rate, rel=0.05)
    force, attitude = log.specific_force.mean(axis=0), recording.tables["attitude"]
    assert np.linalg.norm(force) == pytest.approx(9.81, abs=0.25)  # one of the two has not been calibrated
    assert np.arctan2(-force[0], force[2]) == pytest.approx(np.median(attitude["roll_rad"]), abs=0.02)
    pitch = np.arctan2(force[1], np.hypot(force[0], force[2]))
    assert pitch == pytest.approx(np.median(attitude["pitch_rad"]), abs=0.02)
