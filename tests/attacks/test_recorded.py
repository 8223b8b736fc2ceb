"""A real attack that a log holds: the victim gets the fixes that were recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spoofgym.detectors import make_detector
from spoofgym.envs.opponents import make_spoofer
from spoofgym.evaluation.recorded import evaluate_recorded
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from tests.scenarios.test_recorded import write_log

DATA = Path(__file__).parents[3] / "shared" / "data"
BEGIN, END = 60.0, 80.0
NORTH = 30.0
"""Of the spoofed fixes, m."""


def attacked_log(folder: Path, lines: str = f"attack_start_s = {BEGIN}\nattack_end_s = {END}\n") -> Path:
    """A log whose fixes are pulled 30 m to the north, at 2 m/s, from 60 s to 80 s; outside they are wild."""
    write_log(folder)
    header, *rows = (folder / "gnss.csv").read_text().splitlines()
    spoofed = []
    for row in rows:
        cells = row.split(",")
        inside = BEGIN <= float(cells[0]) <= END
        cells[1] = f"{float(cells[1]) + np.degrees((NORTH if inside else 500.0) / 6.3674e6):.12g}"
        cells[4] = f"{float(cells[4]) + 2.0:.12g}"
        spoofed.append(",".join(cells))
    (folder / "gnss_spoofed.csv").write_text("\n".join([header, *spoofed]) + "\n")
    (folder / "log.toml").write_text((folder / "log.toml").read_text() + lines)
    return folder


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Scenario:
    return make_scenario(f"recorded:{attacked_log(tmp_path_factory.mktemp('attacked'))},onset=50")


def test_the_victim_gets_the_fixes_that_were_recorded(scenario: Scenario) -> None:
    simulation = Simulation(scenario, make_spoofer("recorded"), [], num_runs=2, seed=0, fidelity="strapdown")
    simulation.reset()
    clean = Simulation(scenario, None, [], num_runs=2, seed=0, fidelity="strapdown")
    clean.reset()
    for _ in range(scenario.timeline.num_epochs):
        for each in (simulation, clean):
            each.resolve()
            each.observe()
        time = float(simulation.epoch.time[0])
        inside = BEGIN <= time <= END
        np.testing.assert_allclose(simulation.offset, np.tile([0.0, NORTH if inside else 0.0, 0.0], (2, 1)), atol=0.05)
        if time == BEGIN:  # until then both filters are one: residuals (solution less fix) differ by what is spoofed
            difference = clean.epoch.innovation.residual - simulation.epoch.innovation.residual
            np.testing.assert_allclose(difference[0], [0.0, NORTH, 0.0, 0.0, 2.0, 0.0], atol=0.05)


def test_detection_and_recovery_are_told(scenario: Scenario) -> None:
    snapshot = make_detector("snapshot:threshold=40")
    attacks = [make_spoofer("recorded"), make_spoofer("ramp:2")]
    row, lasting = evaluate_recorded(scenario, attacks, [snapshot])
    assert row["detected"]
    assert row["time_to_detect_s"] == pytest.approx(1.0)  # from the last clean fix, at 59 s
    assert 20.0 < row["max_error_m"] < 40.0
    assert row["alarms_after_end"] >= 1  # the step back is a jump, too
    assert 0.0 < row["recovery_s"] < 30.0
    assert (lasting["alarms_after_end"], lasting["recovery_s"]) == (None, None)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("", "log.toml must state attack_start_s and attack_end_s"),
        ("attack_start_s = 60\n", "attack_end_s is missing"),
        ("attack_start_s = 60\nattack_end_s = 50\n", "attack_end_s = 50 lies before attack_start_s = 60"),
        ("attack_start_s = 1000\nattack_end_s = 1001\n", "no fix lies between attack_start_s and attack_end_s"),
    ],
)
def test_an_attack_that_is_not_stated_is_refused(lines: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=message):
        Simulation(make_scenario(f"recorded:{attacked_log(tmp_path, lines)}"), make_spoofer("recorded"), [], None, 1, 0,
                   fidelity="strapdown")


def test_a_game_that_begins_too_late_is_refused(scenario: Scenario) -> None:
    with pytest.raises(ValueError, match="it begins at 60 s, the game lasts from 70 to"):
        Simulation(scenario.changed(onset=70.0), make_spoofer("recorded"), [], None, 1, 0, fidelity="strapdown")


def test_only_a_log_holds_one(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"attack 'recorded' needs a recorded log .*; scenario 'foi-drive' is none"):
        Simulation(make_scenario("foi-drive"), make_spoofer("recorded"), [], None, 1, 0)
    with pytest.raises(ValueError, match=r"gnss_spoofed\.csv .* is missing"):
        Simulation(make_scenario(f"recorded:{write_log(tmp_path)}"), make_spoofer("recorded"), [], None, 1, 0,
                   fidelity="strapdown")


def test_a_row_that_is_missing_is_named(tmp_path: Path) -> None:
    folder = attacked_log(tmp_path)
    rows = (folder / "gnss_spoofed.csv").read_text().splitlines()
    (folder / "gnss_spoofed.csv").write_text("\n".join(row for row in rows if not row.startswith("70,")) + "\n")
    with pytest.raises(ValueError, match=r"gnss_spoofed\.csv has no row for the fix at 70 s"):
        Simulation(make_scenario(f"recorded:{folder}"), make_spoofer("recorded"), [], None, 1, 0, fidelity="strapdown")


def test_the_octocopter_that_was_spoofed_in_flight() -> None:
    """Its position froze 5.9 m to the east, and it flew off: the true distance of its last spoofed fix is 38.8 m."""
    if not (DATA / "uav-octa").is_dir():
        pytest.skip("the recorded logs are not at hand")
    scenario = make_scenario(f"recorded:{DATA / 'uav-octa'}")
    (row,) = evaluate_recorded(scenario, [make_spoofer("recorded")], [make_detector("snapshot")])
    assert row["false_alarms"] == 0
    assert row["time_to_detect_s"] == pytest.approx(0.2, abs=0.01)
    assert 30.0 < row["max_error_m"] < 38.8
    assert 1.0 < row["recovery_s"] < 15.0
