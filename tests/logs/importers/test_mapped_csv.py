"""Any CSV by a mapping: units, axes, clocks, speed and course; a mistake in the mapping is named."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tests.logs.importers.drive import check, drive, imported

MAPPING = """
axes = "flu"
gnss_delay_s = 0.05

[imu]
file = "imu.csv"
t_s = { column = "time", unit = "us" }
gx_radps = { column = "p", unit = "deg/s" }
gy_radps = { column = "q", unit = "deg/s", sign = -1 }
gz_radps = { column = "r", unit = "deg/s" }
ax_mps2 = { column = "fx", unit = "g" }
ay_mps2 = { column = "fy", unit = "g" }
az_mps2 = { column = "fz", unit = "g" }

[gnss]
file = "gps.txt"
delimiter = ";"
header = false
shift_s = -18.0
t_s = { column = 1, unit = "iso8601" }
lat_deg = { column = 2, unit = "rad" }
lon_deg = { column = 3, unit = "1e-7deg" }
h_m = { column = 4, unit = "ft" }
speed_mps = { column = 5, unit = "knots" }
course_deg = { column = 6 }
vu_mps = { column = 7, unit = "km/h" }
sd_h_m = { column = 8, unit = "m^2" }
keep = { column = 9, at_least = 3 }
"""
UNIX = 1_700_000_000.0


def write(folder: Path, mapping: str = MAPPING) -> Path:
    folder.mkdir()
    true = drive()
    rate, force = np.degrees(true.rate) * [1, 1, -1], true.force / 9.80665 * [1, -1, -1]
    values = np.column_stack([np.round((UNIX + true.time) * 1e6), rate, force])
    header = "\ufefftime, p, q,r,fx,fy,fz"
    np.savetxt(folder / "imu.csv", values, delimiter=",", header=header, comments="", fmt="%.12f", encoding="utf-8")
    lines = []
    for k, time in enumerate(true.fix_time):
        moment = np.datetime64(round((UNIX + 18.0 + 0.05 + time) * 1e6), "us")
        latitude, longitude, height = true.place[k].tolist()
        place = f"{math.radians(latitude)!r};{1e7 * longitude!r};{height / 0.3048!r}"
        speed = f"{true.speed[k] * 3600 / 1852:.12f}".replace(".", ",")
        course, up = float(true.course[k]), -3.6 * float(true.velocity[k, 2])
        lines.append(f"{moment}Z;{place};{speed};{course!r};{up!r};2.25;{3 if k % 5 else 0}\r")
    (folder / "gps.txt").write_text("\n".join(lines) + "\n")
    (folder / "mapping.toml").write_text(mapping)
    return folder / "mapping.toml"


def test_a_drive_comes_back(tmp_path: Path) -> None:
    recording, log = imported(write(tmp_path / "raw"), tmp_path / "log")
    kept = np.arange(len(drive().fix_time)) % 5 > 0
    np.testing.assert_allclose(log.imu_time - UNIX, drive().time, atol=2e-6)
    np.testing.assert_allclose(log.angular_rate[:, 2], -drive().rate[:, 2], atol=1e-8)
    np.testing.assert_allclose(log.angular_rate[:, 0], drive().rate[:, 1], atol=1e-8)
    np.testing.assert_allclose(log.specific_force[:, 2], -drive().force[:, 2], atol=1e-7)
    np.testing.assert_allclose(log.fixes.time - UNIX, drive().fix_time[kept], atol=2e-6)
    np.testing.assert_allclose(np.degrees(log.fixes.position[:, :2]), drive().place[kept, :2], atol=1e-9)
    np.testing.assert_allclose(log.fixes.position[:, 2], drive().place[kept, 2], atol=1e-3)
    assert log.fixes.velocity is not None
    np.testing.assert_allclose(log.fixes.velocity[:, 0], drive().velocity[kept, 1], atol=1e-6)
    assert log.fixes.position_sigma is not None
    np.testing.assert_allclose(log.fixes.position_sigma[0, :2], 1.5)
    assert f"{np.count_nonzero(~kept)} of {len(kept)} rows are left out by keep" in recording.problems[0]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('unit = "knots"', 'unit = "kn"', r"unit of speed_mps in \[gnss\] must be one of m/s, .*knots.*got 'kn'"),
        ("gx_radps", "gx_rad", r"unknown key 'gx_rad' in \[imu\]: did you mean 'gx_radps'"),
        ('column = "p"', 'column = "omega"', r"imu\.csv, line 1: column 'omega' is not there; there are: time, p, q"),
        ("column = 9", "column = 10", r"gps\.txt, line 1: column 10 is not there: the line has 9"),
        ('axes = "flu"', 'axes = "fru"', r"axes must be one of frd, flu, rfu, unknown, got 'fru'"),
        ("imu.csv", "none.csv", r"none\.csv: no such file"),
        ("h_m = { column = 4", "h = { column = 4", r"unknown key 'h' in \[gnss\]"),
        ("sign = -1", "sign = 2", r"sign of gy_radps in \[imu\] must be 1 or -1"),
        ("[gnss]", "[gnss", "not valid TOML"),
        ("lat_deg = { column = 2", "lat_deg = { column = 1", "no cell of column 1 is a number"),
    ],
)
def test_a_mistake_in_the_mapping_is_named(tmp_path: Path, old: str, new: str, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        imported(write(tmp_path / "raw", MAPPING.replace(old, new, 1)), tmp_path / "log")
    assert not (tmp_path / "log").exists()


def test_columns_as_they_are(tmp_path: Path) -> None:
    """The names of the log format, by their names alone."""
    true, folder = drive(), tmp_path / "raw"
    folder.mkdir()
    imu = "t_s,gx_radps,gy_radps,gz_radps,ax_mps2,ay_mps2,az_mps2"
    gnss = "t_s,lat_deg,lon_deg,h_m,vn_mps,ve_mps,vd_mps"
    tables = {"imu": (imu, [true.time, true.rate, true.force])}
    tables["gnss"] = (gnss, [true.fix_time, true.place, true.velocity])
    lines = ['axes = "frd"']
    for name, (header, values) in tables.items():
        path = folder / f"{name}.csv"
        np.savetxt(path, np.column_stack(values), delimiter=",", header=header, comments="", fmt="%.12f")
        lines += [f"[{name}]", f'file = "{name}.csv"', *(f'{column} = "{column}"' for column in header.split(","))]
    (folder / "mapping.toml").write_text("\n".join(lines))
    _, log = imported(folder / "mapping.toml", tmp_path / "log")
    check(log, 0.0)
