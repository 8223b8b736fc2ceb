"""The program that imports: what it tells, and what it leaves where it fails."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from spoofgym.logs.importers import writer
from spoofgym.logs.log import read_log
from spoofgym.studies.import_log import main
from tests.logs.importers.test_dataflash import binary, rows


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "flight.bin"
    path.write_bytes(binary(rows()))
    return path


def test_it_tells_what_it_found(source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(source), "-o", str(tmp_path / "a" / "log")]) == 0
    told = capsys.readouterr().out

    found = ("imu: ", "gnss: 98 rows, 5 Hz", "gnss_delay_s = 0.12", "(median): sd_n_m 0.9", "axes of the IMU: frd")
    for words in found:
        assert words in told
    assert read_log(tmp_path / "a" / "log").name == "log"


def test_a_span_is_cut_out(source: Path, tmp_path: Path) -> None:
    log = tmp_path / "log"
    assert main([str(source), "-o", str(log), "--begin", "205", "--end", "210", "--name", "five"]) == 0
    read = read_log(log)
    assert read.name == "five"
    assert 205.0 <= read.imu_time[0] <= read.imu_time[-1] <= 210.0


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--begin", "5000"], "0 inertial samples found in this span of time"),
        (["--begin", "soon"], "expected a finite number of seconds, got 'soon'"),
        (["--format", "ulog"], "no ULog header"),
        (["--axes", "lfu"], "invalid choice: 'lfu'"),
    ],
)
def test_a_mistake_is_told_and_leaves_nothing(
    source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], told: str
) -> None:
    try:
        status = main([str(source), "-o", str(tmp_path / "log"), *arguments])
    except SystemExit as end:
        status = int(str(end.code))
    assert status == 2
    assert told in capsys.readouterr().err
    assert os.listdir(tmp_path) == ["flight.bin"]


def test_nothing_is_overwritten(source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "log").mkdir()
    (tmp_path / "log" / "mine.txt").write_text("mine")
    assert main([str(source), "-o", str(tmp_path / "log")]) == 2
    assert "is not empty" in capsys.readouterr().err
    assert main([str(source), "-o", str(source)]) == 2
    assert (tmp_path / "log" / "mine.txt").read_text() == "mine"


def test_nothing_half_written_is_left(source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(writer, "_format", interrupted)
    assert main([str(source), "-o", str(tmp_path / "log")]) == 130
    assert os.listdir(tmp_path) == ["flight.bin"]


def test_what_is_no_log_is_told_with_the_formats(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "picture.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    assert main([str(path), "-o", str(tmp_path / "log")]) == 2
    assert "no format is recognised; known are ulog: PX4 ULog" in capsys.readouterr().err
    assert main([str(tmp_path / "none"), "-o", str(tmp_path / "log")]) == 2
    assert "no such file or folder" in capsys.readouterr().err
