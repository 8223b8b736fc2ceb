"""A log with a mistake works, or the mistake is named: more than a hundred of them, one at a time."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import pytest

from spoofgym.logs.checks.check import all_findings, checked_log
from spoofgym.logs.checks.finding import Finding
from spoofgym.logs.log_warning import LogWarning
from tests.logs.importers.drive import ABSENT, DATA
from tests.logs.mutants import FILTERED, MUTANTS, OK
from tests.logs.spoilt import good

REAL = ("car-comma", "car-kaist", "car-long-loop", "car-loop", "car-phone-raw", "car-rtk", "uav-octa", "uav-thor")


def test_they_are_many() -> None:
    assert len(MUTANTS) + len(FILTERED) >= 80


@pytest.mark.parametrize("name", MUTANTS)
def test_a_mistake_is_named(tmp_path: Path, name: str) -> None:
    change, told = MUTANTS[name]
    files = good()
    change(files)
    found = all_findings(files.write(tmp_path / "log"))
    if told == OK:
        assert [str(finding) for finding in found if finding.severity != "note"] == []
    else:
        assert re.search(told, "\n".join(map(str, found)), re.DOTALL), found


def test_a_good_log_has_no_fault(tmp_path: Path) -> None:
    assert all_findings(good().write(tmp_path / "log")) == []


@pytest.mark.skipif(not DATA.is_dir(), reason=ABSENT)
@pytest.mark.parametrize("name", REAL)
def test_real_logs_have_none(name: str) -> None:
    """Holes are noted, nothing is blamed."""
    assert [str(finding) for finding in all_findings(DATA / name) if finding.severity != "note"] == []


def test_errors_stop_and_warnings_are_told_once(tmp_path: Path) -> None:
    files = good()
    MUTANTS["velocity in knots"][0](files)
    with pytest.raises(ValueError, match=r"log/gnss\.csv, line 1: the velocity is in knots: .* by 0\.5144"):
        checked_log(files.write(tmp_path / "log"))
    files = good()
    MUTANTS["mounting turned by 40"][0](files)
    folder = files.write(tmp_path / "other")
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("default")
        for _ in range(2):
            checked_log(folder)
    assert [warning.category for warning in seen] == [LogWarning]
    assert "turned by" in str(seen[0].message)


def test_a_finding_is_one_line() -> None:
    finding = Finding("error", "gnss.csv", "t_s is in ms", "divide it by 1000", 7)
    assert str(finding) == "gnss.csv, line 7: t_s is in ms; divide it by 1000"
    assert str(Finding("note", "imu.csv", "holes")) == "imu.csv: holes"
