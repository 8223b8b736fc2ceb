"""Ranges with a mistake: units, the sign of the range rates, and steps of the receiver's clock."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from spoofgym.logs.checks.ranges import check_ranges
from spoofgym.logs.log_files import EPHEMERIS
from tests.logs.importers.drive import ABSENT, DATA
from tests.logs.range_drive import Clock, write_drive

SVID, TIME, RANGE, RATE, CN0 = range(5)
STEADY = Clock()
WAVELENGTH = 299_792_458.0 / 1_575.42e6


def spoilt(folder: Path, change: Callable[[np.ndarray], None], clock: Clock = STEADY) -> Path:
    write_drive(folder, turns=2, clock=clock)
    path = folder / "ranges.csv"
    header = path.read_text().partition("\n")[0]
    values = np.loadtxt(path, delimiter=",", skiprows=1)
    change(values)
    np.savetxt(path, values, delimiter=",", header=header, comments="", fmt="%.12g")
    return folder


def times(column: int, factor: float) -> Callable[[np.ndarray], None]:
    def change(values: np.ndarray) -> None:
        values[:, column] *= factor

    return change


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (times(RATE, 1.0), None),
        (times(RATE, -1.0), "opposite sign of the differences of the ranges; .* are Dopplers: multiply them by -1"),
        (times(RATE, -1.0 / WAVELENGTH), "are Dopplers, and are in Hz: multiply them by -0.1903"),
        (times(RATE, 1.0 / WAVELENGTH), "they are in Hz: multiply them by 0.19"),
        (times(RATE, 1e-3), "they are in km/s: multiply them by 1"),
        (times(RANGE, 1e-3), "pseudorange_m is in kilometres; multiply it by 1000"),
        (times(RANGE, 1.0 / 299_792_458.0), "pseudorange_m is in seconds; multiply it by 299792458"),
        (times(RANGE, 1e3 / 299_792_458.0), "pseudorange_m is in milliseconds; multiply it by 299792.458"),
    ],
)
def test_units_and_signs(tmp_path: Path, change: Callable[[np.ndarray], None], told: str | None) -> None:
    found = [str(finding) for finding in check_ranges(spoilt(tmp_path / "log", change))]
    if told is None:
        assert found == []
    else:
        (text,) = found
        assert re.search(told, text), text


def test_rates_of_other_satellites_are_told(tmp_path: Path) -> None:
    def shuffled(values: np.ndarray) -> None:
        values[:, RATE] = np.random.default_rng(1).permutation(values[:, RATE])

    (finding,) = check_ranges(spoilt(tmp_path / "log", shuffled))
    assert finding.severity == "warning"
    assert "disagree" in finding.text


def test_steps_of_whole_milliseconds_are_noted(tmp_path: Path) -> None:
    clock = Clock(steps=((20, -1e-3), (40, -1e-3)))
    (finding,) = check_ranges(spoilt(tmp_path / "log", times(RATE, 1.0), clock))
    assert (finding.severity, finding.text) == ("note", "the receiver's clock steps by whole milliseconds 2 times")


def test_a_missing_ephemeris_is_noted(tmp_path: Path) -> None:
    folder = spoilt(tmp_path / "log", times(RATE, 1.0))
    (folder / EPHEMERIS).unlink()
    (finding,) = check_ranges(folder)
    assert finding.severity == "note"
    assert list(check_ranges(tmp_path)) == []


@pytest.mark.skipif(not DATA.is_dir(), reason=ABSENT)
@pytest.mark.parametrize("name", ["car-phone-raw", "car-comma", "texbat-clean", "texbat-ds2", "texbat-ds3"])
def test_real_ranges_have_no_fault(name: str) -> None:
    assert [finding for finding in check_ranges(DATA / name) if finding.severity != "note"] == []
