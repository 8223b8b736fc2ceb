"""Navigation files of RINEX 2 and 3, written here."""

import sys

import numpy as np
import pytest

from spoofgym.sensors.ephemeris import COLUMNS
from spoofgym.sensors.rinex import read_rinex

WEEK = 2133  # it began on 22 November 2020
ROWS = (
    ("af0", "af1", "af2"),
    ("iode", "crs", "delta_n", "m0"),
    ("cuc", "e", "cus", "sqrt_a"),
    ("toe", "cic", "omega0", "cis"),
    ("i0", "crc", "omega", "omega_dot"),
    ("idot", "codes", "week", "flag"),
    ("accuracy", "health", "tgd", "iodc"),
    ("sent", "fit"),
)
HEADERS = {2: "     2.11           N: GPS NAV DATA", 3: "     3.04           N: GNSS NAV DATA    G: GPS"}


def message(satellite, hour, health=0.0):
    """Values of one set: 22 November 2020, a Sunday, so that the hour is that of the week, too."""
    rng = np.random.default_rng([satellite, hour])
    values = {name: float(f"{rng.uniform(-1e-6, 1e-6):.12e}") for row in ROWS for name in row}
    values |= {"e": 0.0112, "sqrt_a": 5153.625, "toe": 3_600.0 * hour, "week": WEEK, "health": health, "fit": 4.0}
    values |= {"iode": 17.0, "iodc": 17.0, "accuracy": 2.0, "sent": 3_600.0 * hour - 30.0, "codes": 1.0, "flag": 0.0}
    return {"satellite": satellite, "hour": hour, "toc": 3_600.0 * hour, **values}


def text(version, messages):
    lines = [HEADERS[version].ljust(60) + "RINEX VERSION / TYPE", " " * 60 + "END OF HEADER"]
    margin = " " * (3 if version == 2 else 4)
    for values in messages:
        hour = values["hour"]
        if version == 2:
            start = f"{values['satellite']:2d} 20 11 22 {hour:2d}  0  0.0"
        else:
            start = f"G{values['satellite']:02d} 2020 11 22 {hour:02d} 00 00"
        for row in ROWS:
            lines.append(start + "".join(f"{values[name]:19.12E}" for name in row))
            start = margin
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("version", [2, 3])
def test_of_every_satellite_the_nearest_healthy_set(tmp_path, version):
    pytest.importorskip("pyrtklib")
    sets = [message(12, 2), message(5, 2), message(5, 4), message(5, 6, health=1.0), message(7, 4, health=63.0)]
    file = tmp_path / "brdc3270.20n"
    file.write_text(text(version, sets))
    ephemeris = read_rinex(file, 3_600.0 * 5.5)
    np.testing.assert_array_equal(ephemeris.satellites, [5, 12])
    for name in COLUMNS:
        expected = [values[name] for values in (sets[2], sets[0])]
        np.testing.assert_allclose(getattr(ephemeris, name), expected, rtol=1e-15, atol=0.0, err_msg=name)
    assert read_rinex(file, 0.0).toe.tolist() == [7_200.0, 7_200.0]


def test_files_of_other_satellites_are_refused(tmp_path):
    pytest.importorskip("pyrtklib")
    file = tmp_path / "ill.20n"
    file.write_text(text(3, [message(7, 4, health=63.0)]))
    with pytest.raises(ValueError, match="no healthy GPS satellite"):
        read_rinex(file, 0.0)
    with pytest.raises(FileNotFoundError, match=r"no file .*absent\.20n"):
        read_rinex(tmp_path / "absent.20n", 0.0)


def test_without_pyrtklib_it_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyrtklib", None)
    with pytest.raises(ImportError, match=r'pip install "spoofgym\[logs\]"'):
        read_rinex(tmp_path / "brdc3270.20n", 0.0)
