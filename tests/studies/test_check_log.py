"""The program that checks a log: its status, its lines, and what only the filter shows."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from spoofgym.studies.check_log import main
from tests.logs.mutants import FILTERED, MUTANTS
from tests.logs.spoilt import good


def write(folder: Path, name: str | None = None) -> Path:
    files = good()
    if name is not None:
        (MUTANTS | FILTERED)[name][0](files)
    return files.write(folder / "log")


def test_a_good_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write(tmp_path)
    assert main([str(folder), "--json", str(tmp_path / "report.json")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("alignment: course, at 100")
    assert lines[1].startswith("clean run: ")
    assert lines[2] == f"{folder}: nothing contradicts it"
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["findings"] == []
    assert 0.0 < report["clean"]["nis_per_degree"] < 1.5


def test_an_error_is_the_status(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write(tmp_path, "gyro in degrees")
    assert main([str(folder), "--json", "-"]) == 2
    said = capsys.readouterr()
    (row,) = json.loads(said.out)["findings"]
    assert (row["severity"], row["file"], row["line"]) == ("error", "imu.csv", 1)
    assert row["advice"] == "divide gx_radps, gy_radps and gz_radps by 57.29578"
    assert f"{folder}: 1 error, 0 warnings" in said.err


@pytest.mark.parametrize("name", FILTERED)
def test_what_only_the_filter_shows(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    main([str(write(tmp_path, name))])
    assert re.search(FILTERED[name][1], capsys.readouterr().out)


def test_a_folder_that_is_no_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "none")]) == 2
    assert "is no folder; a log is a folder with log.toml" in capsys.readouterr().out
