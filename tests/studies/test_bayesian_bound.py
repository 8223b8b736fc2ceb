"""The program of the Bayesian bound: its table, its report, and how it goes on."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from spoofgym.evaluation import bayesian_bound as library
from spoofgym.studies import bayesian_bound

SHORT = ("--scenario", "foi-drive:horizon=30", "--games", "3", "--resolution", "coarse", "--workers", "1")
ALONE = ("--detector", "snapshot")


def test_report_and_resumption(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    both = ("--population", "training", "--population", "held-out")
    arguments = [*SHORT, *ALONE, *both, "--defender", "always-use", "--out", str(tmp_path), "--json", "-"]
    assert bayesian_bound.main(arguments) == 0
    report = json.loads(capsys.readouterr().out)
    row, other = report["rows"]
    assert (report["kind"], report["games"], row["population"]) == ("bayesian-bound", 3, "training")
    assert other["population"] == "held-out"
    assert other["bayesian"] != row["bayesian"]
    bayesian, (defender,) = row["bayesian"], row["defenders"]
    assert 0.0 < bayesian["harm"] <= bayesian["harm_ci95"][1]
    assert defender["above_bound"] == pytest.approx(defender["harm"] - bayesian["harm"])
    assert bayesian["surprise"] == pytest.approx(bayesian["harm"] - bayesian["expected"])
    for name in ("choosing", "taking_back"):
        assert row[name]["above_bound"] == pytest.approx(row[name]["harm"] - bayesian["harm"])
    assert "hindsight" not in row

    def play_again(*_: object) -> None:
        raise AssertionError("games that are on disk are not played again")

    monkeypatch.setattr(library, "play_block", play_again)
    assert bayesian_bound.main(arguments) == 0
    assert json.loads(capsys.readouterr().out) == report


def test_a_short_game_is_told_in_hindsight(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    short = ("--scenario", "liu-flight:horizon=9,rate=0.4,imu=industrial", "--games", "2", "--workers", "1")
    arguments = [*short, *ALONE, "--defender", "always-use", "--out", str(tmp_path)]
    assert bayesian_bound.main([*arguments, "--json", str(tmp_path / "out.json")]) == 0
    table = capsys.readouterr().out
    (row,) = json.loads((tmp_path / "out.json").read_text())["rows"]
    assert 0.0 <= row["hindsight"]["above_bound"] <= row["choosing_expected"]["above_bound"]
    for name in ("choosing", "taking_back", "hindsight", "choosing_expected"):
        assert bayesian_bound.CHOOSERS[name].strip() in table


def test_a_damaged_block_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [*SHORT, *ALONE, "--defender", "always-use", "--out", str(tmp_path)]
    assert bayesian_bound.main(arguments) == 0
    (block,) = (tmp_path / "bayesian").iterdir()
    block.write_bytes(b"no archive")
    capsys.readouterr()
    assert bayesian_bound.main(arguments) == 2
    assert capsys.readouterr().err.startswith(f"error: {block}")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--scenario", "song-robot"), "Bayesian bound: scenario 'song-robot' has"),
        (("--scenario", "foi-drive:horizon=10"), "Bayesian bound: an attack needs a game of more than 20 s"),
        (("--defender", "drill > exclude"), "unknown detector 'drill'"),
    ],
)
def test_bad_input_is_one_line(
    given: tuple[str, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert bayesian_bound.main([*SHORT, *ALONE, *given, "--out", str(tmp_path)]) == 2
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert said in last
