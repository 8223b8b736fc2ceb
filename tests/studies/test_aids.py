"""`spoofgym study aids` on few games: its rows, and that they say what its page says."""

import json

import pytest

from spoofgym.calibration import thresholds
from spoofgym.policies.scripted import OffsetSequence
from spoofgym.scenarios import make_scenario
from spoofgym.studies import aids
from tests.run_folders import spoofer


def test_a_climbing_spoofer_is_held_and_found():
    """A pull of the height alone: the barometer takes a part of what it reaches, and its test sees it."""
    horizon = 100
    climb = [[0.0, 0.0, 1.5 * k] for k in range(1, horizon + 1)]
    rows = [
        aids.fly(make_scenario(f"liu-flight:horizon={horizon}{barometer}"), OffsetSequence("climb", climb), 20, 1)
        for barometer in ("", ",aids=barometer")
    ]
    assert rows[1].height_m < 0.8 * rows[0].height_m
    assert rows[0].found_by_aids is None
    assert rows[0].unseen_m is None
    assert rows[1].found_by_aids == 1.0
    assert rows[1].unseen_m == 0.0
    assert rows[1].undetected_m > 0.0


def test_wheels_hold_a_drive_without_gnss():
    plain, aided = (aids.drive("tactical", kind, 20, 0) for kind in ("", "wheel-speed"))
    assert aided.coasting_m[-1] < 0.2 * plain.coasting_m[-1]
    assert aided.optimum_m < 0.5 * plain.optimum_m
    assert aided.ramp_m < aided.optimum_m


def test_the_program_prints_both_tables(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(thresholds, "SIMULATED_FIRST_ALARMS", 10)  # nothing here depends on how often detectors alarm
    monkeypatch.setattr(aids, "FLIGHTS", ("liu-flight:horizon=10", "liu-flight:horizon=10,aids=barometer"))
    monkeypatch.setattr(aids, "IMUS", ("fog",))
    monkeypatch.setattr(aids, "WHEELS", ("wheel-speed",))
    configuration = {"scenario": "liu-flight:horizon=10", "detector": "snapshot", "knowledge": "shadow"}
    folder = spoofer(configuration, tmp_path / "run").removeprefix("policy:")
    assert aids.main(["--runs", "3", "--spoofer", folder, "--json", str(tmp_path / "rows.json")]) == 0
    told = capsys.readouterr().out
    assert "| `liu-flight:horizon=10` |" in told
    assert "| fog | wheel-speed |" in told
    report = json.loads((tmp_path / "rows.json").read_text())
    assert (report["kind"], len(report["flights"]), len(report["drives"])) == ("aids", 2, 1)
    with pytest.raises(SystemExit):
        aids.main(["--runs", "0"])
