"""The reader of recorded logs: conversion at the door, and every kind of bad input."""

from __future__ import annotations

import gzip
import math
from pathlib import Path

import numpy as np
import pytest

from spoofgym.logs.log import interpolate, read_log, velocity_of

NOTES = """name = "small"
imu_to_body_frd = [[0, 1, 0], [1, 0, 0], [0, 0, -1]]
imu_delay_s = 0.5
gnss_delay_s = 0.25
start_s = 1.0
"""
IMU = "t_s,gx_radps,gy_radps,gz_radps,ax_mps2,ay_mps2,az_mps2,extra\n" + "".join(
    f"{0.5 + 0.1 * k:.1f},1,2,3,0.1,0.2,9.8,text\n" for k in range(100)
)
GNSS = "t_s,lat_deg,lon_deg,h_m,vn_mps,ve_mps,vd_mps,sd_n_m,sd_e_m,sd_d_m\n" + "".join(
    f"{k},45.0,{9.0 + 1e-4 * k},100,1,2,3,4,5,6\n" for k in range(10)
)


def write(folder: Path, *, notes: str = NOTES, imu: str = IMU, gnss: str = GNSS, reference: str | None = None) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "log.toml").write_text(notes, encoding="utf-8")
    (folder / "imu.csv").write_text(imu, encoding="utf-8")
    (folder / "gnss.csv").write_text(gnss, encoding="utf-8")
    if reference is not None:
        (folder / "reference.csv").write_text(reference, encoding="utf-8")
    return folder


def line(text: str, number: int, new: str) -> str:
    lines = text.splitlines()
    lines[number - 1] = new
    return "\n".join(lines) + "\n"


def test_everything_is_converted_at_the_door(tmp_path: Path) -> None:
    log = read_log(write(tmp_path / "log"))
    assert log.name == "small"
    assert log.start == 1.0
    assert log.reference is None
    np.testing.assert_allclose(log.imu_time[:2], [0.0, 0.1], atol=1e-12)
    # sensor (right, forward, up) -> body right, forward, up
    np.testing.assert_allclose(log.angular_rate[0], [1, 2, 3])
    np.testing.assert_allclose(log.specific_force[0], [0.1, 0.2, 9.8])
    np.testing.assert_allclose(log.fixes.time[:2], [-0.25, 0.75])
    np.testing.assert_allclose(log.fixes.position[0], [math.pi / 4, math.radians(9), 100])
    assert log.fixes.velocity is not None
    assert log.fixes.position_sigma is not None
    np.testing.assert_allclose(log.fixes.velocity[0], [2, 1, -3])
    np.testing.assert_allclose(log.fixes.position_sigma[0], [5, 4, 6])
    assert log.fixes.velocity_sigma is None


def test_gzipped_tables_and_reordered_columns(tmp_path: Path) -> None:
    folder = write(tmp_path / "log")
    plain = read_log(folder)
    rows = [row.split(",") for row in GNSS.splitlines()]
    (folder / "gnss.csv").write_text("\r\n".join(",".join(reversed(row)) for row in rows) + "\r\n\r\n")
    (folder / "imu.csv").unlink()
    (folder / "imu.csv.gz").write_bytes(gzip.compress(IMU.encode()))
    packed = read_log(folder)
    np.testing.assert_array_equal(packed.angular_rate, plain.angular_rate)
    np.testing.assert_array_equal(packed.fixes.position, plain.fixes.position)


def test_velocity_from_differences_and_interpolation(tmp_path: Path) -> None:
    gnss = "\n".join(",".join(row.split(",")[:4]) for row in GNSS.splitlines())
    log = read_log(write(tmp_path / "log", gnss=gnss))
    assert log.fixes.velocity is None
    east = math.radians(1e-4) * 6378137.0 / math.sqrt(1 - 0.00669438 * 0.5) * math.sqrt(0.5)
    np.testing.assert_allclose(velocity_of(log.fixes)[:, 0], east, rtol=1e-4)
    position, velocity = interpolate(log.fixes, np.array([2.35]))
    np.testing.assert_allclose(position[0, 1], math.radians(9.0 + 2.6e-4), rtol=1e-12)
    np.testing.assert_allclose(velocity[0], [east, 0, 0], rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"imu": line(IMU, 7, "1.0,1,x,3,0,0,9.8,t")}, r"imu\.csv, line 7: gy_radps must be a finite number, got 'x'"),
        ({"imu": line(IMU, 8, "1.1,1,nan,3,0,0,9.8,t")}, r"imu\.csv, line 8: gy_radps must be a finite number"),
        ({"imu": line(IMU, 9, "1.2,1,inf,3,0,0,9.8,t")}, r"imu\.csv, line 9: gy_radps"),
        ({"imu": line(IMU, 10, "1.3,1,,3,0,0,9.8,t")}, r"imu\.csv, line 10: gy_radps"),
        ({"imu": line(IMU, 11, "1.4,1,2")}, r"imu\.csv, line 11: gz_radps is missing"),
        ({"imu": line(IMU, 12, "")}, r"imu\.csv, line 12: t_s must be a finite number"),
        ({"imu": line(IMU, 6, "0.8,1,2,3,0,0,9.8,t")}, r"imu\.csv, line 6: t_s must increase, got 0\.8 after 0\.8"),
        ({"imu": IMU.replace("az_mps2", "az")}, r"imu\.csv, line 1: column 'az_mps2' is missing"),
        ({"imu": IMU.replace("extra", "t_s")}, r"imu\.csv, line 1: column 't_s' is there twice"),
        ({"imu": IMU.replace(",9.8,", ",1.0,")}, r"imu\.csv: the median specific force is 1\.0"),
        ({"imu": ""}, r"imu\.csv, line 1: column 't_s' is missing"),
        ({"imu": IMU.splitlines()[0]}, r"imu\.csv: needs two lines"),
        ({"gnss": line(GNSS, 4, "2,95.0,9,100,1,2,3,4,5,6")}, r"gnss\.csv, line 4: lat_deg must be between -89 and 89"),
        ({"gnss": line(GNSS, 5, "3,45.0,9,100,1,2,3,4,-5,6")}, r"gnss\.csv, line 5: sd_e_m must be 0 or more"),
        ({"gnss": line(GNSS, 3, "0,45.0,9,100,1,2,3,4,5,6")}, r"gnss\.csv, line 3: t_s must increase"),
        ({"gnss": GNSS.replace("vd_mps", "vu_mps")}, r"gnss\.csv, line 1: column 'vd_mps' is missing"),
        ({"reference": line(GNSS, 6, "4,?,9,100,1,2,3,4,5,6")}, r"reference\.csv, line 6: lat_deg"),
        ({"reference": GNSS.replace("\n1", "\n1e9").replace("\n0,", "\n1e8,")}, r"reference\.csv, line"),
        ({"gnss": GNSS.replace("\n4,", "\n1e300,")}, r"gnss\.csv, line 6: t_s must be between -1e\+12 and 1e\+12"),
        ({"reference": GNSS.replace("\n4,", "\n1e300,")}, r"reference\.csv, line 6: t_s must be between"),
        ({"imu": line(IMU, 2, "-1e300,0,0,0,0,0,9.8")}, r"imu\.csv, line 2: t_s must be between"),
        ({"notes": NOTES.replace("start_s = 1.0", "start_s = 100.0")}, "no overlap"),
        ({"notes": NOTES.replace("imu_delay_s = 0.5", "imu_delay_s = 50.0")}, "no overlap"),
        ({"notes": NOTES.replace("start_s = 1.0", "")}, r"log\.toml: start_s is missing"),
        ({"notes": NOTES.replace("start_s = 1.0", "start_s = 'soon'")}, r"log\.toml: start_s must be a finite number"),
        ({"notes": "name = "}, r"log\.toml: not valid TOML"),
        ({"notes": "imu_to_body_frd = []\nstart_s = 0.0"}, "the mounting of the IMU cannot be found: 0 intervals"),
        ({"notes": "start_s = 0.0"}, r"log\.toml: imu_to_body_frd is missing"),
        ({"notes": NOTES.replace("[0, 0, -1]", "[0, 0, 1]")}, "must be a rotation"),
        ({"notes": NOTES.replace("[0, 0, -1]", "[0, 0, -2]")}, "must be a rotation"),
        ({"notes": NOTES.replace("[0, 0, -1]", "[0, 0]")}, "must be a rotation"),
    ],
)
def test_bad_input_is_named(tmp_path: Path, change: dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_log(write(tmp_path / "log", **change))


@pytest.mark.parametrize("name", ["log.toml", "imu.csv", "gnss.csv"])
def test_a_missing_file_is_named(tmp_path: Path, name: str) -> None:
    folder = write(tmp_path / "log")
    (folder / name).unlink()
    with pytest.raises(ValueError, match=rf"{name}.* is missing"):
        read_log(folder)


def test_a_missing_folder_a_broken_archive_and_a_double_table(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="is no folder"):
        read_log(tmp_path / "nowhere")
    folder = write(tmp_path / "log")
    (folder / "imu.csv.gz").write_bytes(b"no archive")
    with pytest.raises(ValueError, match="keep one"):
        read_log(folder)
    (folder / "imu.csv").unlink()
    with pytest.raises(ValueError, match=r"imu\.csv\.gz: cannot be read"):
        read_log(folder)


def test_fifty_thousand_lines_are_read(tmp_path: Path) -> None:
    rows = "".join(f"{0.01 * k:.2f},0.001,0.002,0.003,0.1,0.2,9.81,1\n" for k in range(50_000))
    folder = write(tmp_path / "log", imu=IMU.splitlines()[0] + "\n" + rows)
    assert len(read_log(folder).imu_time) == 50_000
