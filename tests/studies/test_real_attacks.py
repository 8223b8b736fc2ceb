"""The program of the study: tables, JSON, figure, page, and parts of one's own."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from spoofgym.cli.main import main
from spoofgym.studies.real_attacks_presentation import rounded_up
from tests.attacks.test_recorded import attacked_log

PART = """
from spoofgym.detectors import DETECTORS
from spoofgym.detectors.chi_square import Snapshot


class Mine(Snapshot):
    @property
    def name(self):
        return "mine"


DETECTORS["mine"] = Mine
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return attacked_log(tmp_path_factory.mktemp("log") / "my-drive")


def asked(folder: Path, *more: str) -> list[str]:
    few = [word for name in ("snapshot", "px4-gate") for word in ("--detector", name)]
    return ["study", "real-attacks", str(folder), "--p-fa", "0.05", "--runs", "2", *few, *more]


@pytest.mark.parametrize("width", [80, 40])
def test_tables(folder: Path, width: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    assert main(asked(folder)) == 0
    said = capsys.readouterr().out
    for words in ("Clean records at 5 %", "Injected attacks by log", "All detectors", "my-drive: the real attack"):
        assert words in " ".join(said.split())
    assert any(line.startswith("my-drive ") for line in said.splitlines())
    assert max(map(len, said.splitlines())) <= 80


def test_json_figure_and_page(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(asked(folder, "--json", "-", "--figure", str(tmp_path / "a.png"))) == 0
    said = capsys.readouterr()
    report = json.loads(said.out)
    assert (report["kind"], report["games"], report["false_alarm_probability"]) == ("real-attacks", 2, 0.05)
    assert "Clean records" in said.err
    assert (tmp_path / "a.png").stat().st_size > 10_000
    (tmp_path / "a.json").write_text(said.out)
    assert main(["report", str(tmp_path / "a.json"), "-o", str(tmp_path / "a.html")]) == 0
    assert "Every detector on every attack" in (tmp_path / "a.html").read_text()


def test_a_rate_that_is_not_supported_is_said_plainly(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*asked(folder), "--p-fa", "0.001"]) == 0
    said = capsys.readouterr().out
    assert "not supported" in " ".join(said.split())
    assert "clean epochs need --p-fa 0.012 or more" in " ".join(said.split())


def test_a_detector_of_ones_own_takes_part(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "my_test_of_real_attacks.py").write_text(PART)
    monkeypatch.chdir(tmp_path)
    given = ["study", "real-attacks", str(folder), "--import", "my_test_of_real_attacks", "--runs", "2"]
    try:
        assert main([*given, "--p-fa", "0.1", "--attack", "ramp:0.5", "--detector", "mine", "--json", "-"]) == 0
    finally:
        from spoofgym.detectors import DETECTORS

        DETECTORS.pop("mine", None)
    assert {row["detector"] for row in json.loads(capsys.readouterr().out)["rows"]} == {"mine"}


def test_without_logs_it_says_what_to_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["study", "real-attacks"]) == 2
    assert "no logs: ../shared/data holds none; name a folder" in capsys.readouterr().err


def test_a_share_is_rounded_up() -> None:
    assert rounded_up(1.0 / 270.0) == pytest.approx(0.0038)
    assert rounded_up(0.0025) == pytest.approx(0.0025)
    assert rounded_up(1.0 / 141.0) == pytest.approx(0.0071)
