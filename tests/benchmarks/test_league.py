"""The benchmark of a league prints every table, and its forecast adds up what the others measured."""

import json
from pathlib import Path

import pytest

from benchmarks import league
from spoofgym.envs.duel_config import DuelConfig
from spoofgym.learning.double_oracle import MORE_GAMES

SHORT = "foi-drive:horizon=30"


def test_its_forecast_is_the_sum_of_what_was_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rates = {"PPO spoofer": 1000.0, "PPO defender": 500.0, "teachers compared": 100.0}
    row = {"scenario": SHORT, "steps": 1, "seconds": 60.0}
    learned = [{**row, "what": what, "rate": rate} for what, rate in rates.items()]
    cell = {"scenario": SHORT, "spoofer": "a", "defender": "b", "setting_up_seconds": 0.5}
    played = {**cell, "games_per_second": 250.0, "steps_per_second": 1.0}
    monkeypatch.setattr(league, "learners", lambda *_: learned)
    monkeypatch.setattr(league, "cells", lambda *_: [played, played])
    for name in ("views", "engines", "solving"):
        monkeypatch.setattr(league, name, lambda *_: [])
    monkeypatch.setattr(league, "disk", lambda *_: {"per_cell": 1, "per_game": 2, "spoofer": 3, "defender": 4})
    assert league.main(["--scenario", SHORT, "--json", str(tmp_path / "cost.json")]) == 0
    assert "10 rounds" in capsys.readouterr().out
    none, one, *_ = json.loads((tmp_path / "cost.json").read_text())["leagues"]
    assert none["games_hours"] == pytest.approx(none["cells"] * (0.5 + 500 / 250.0) / 3600.0)
    assert none["most_games_hours"] == pytest.approx(none["cells"] * (0.5 + MORE_GAMES * 500 / 250.0) / 3600.0)
    assert none["trainings_hours"] == 0.0
    assert one["trainings_hours"] == pytest.approx((1_600_000 / 1000.0 + 800_000 / 500.0 + 60.0) / 3600.0)


def test_bytes_on_disk_are_those_of_the_files(tmp_path: Path) -> None:
    for side in ("spoofer", "defender"):
        (tmp_path / side).mkdir()
        (tmp_path / side / "policy.npz").write_bytes(b"1234567")
    found = league.disk(DuelConfig(scenario=SHORT, detectors=("snapshot",)), tmp_path)
    assert (found["spoofer"], found["defender"]) == (7, 7)
    assert found["per_game"] == 9  # a number of double precision, and whether it was clean
    (cell,) = (tmp_path / "cells").iterdir()
    assert cell.stat().st_size == found["per_cell"] + 200 * found["per_game"]
