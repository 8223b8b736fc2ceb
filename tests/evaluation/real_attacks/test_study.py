"""The study on small logs with known attacks, and on the real ones where they are present."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.detectors import make_detector
from spoofgym.evaluation.real_attacks.injected import INJECTED, words_of
from spoofgym.evaluation.real_attacks.records import folders_of, records
from spoofgym.evaluation.real_attacks.study import Asked, real_attacks
from spoofgym.evaluation.recorded_matrix import play
from spoofgym.program import last_of
from tests.attacks.test_recorded import BEGIN, END, attacked_log
from tests.logs.resting import INTERVAL, pull, write_resting
from tests.logs.test_ranges_log import FIRST

DATA = Path(__file__).parents[4] / "shared" / "data"
GAMES = 6
SHARE = 0.05
EFFECT = 300


def study(*logs: object, detectors: tuple[str, ...] | None = None, **asked: Any) -> dict[str, Any]:
    given = None if detectors is None else [make_detector(name) for name in detectors]
    options = {"probability": SHARE, "games": GAMES, **asked}
    words = words_of(options.pop("attacks", None))
    return last_of(real_attacks(records([str(log) for log in logs]), Asked(words, given, **options)))


def row(report: dict[str, Any], detector: str, attack: str, log: str | None = None) -> dict[str, Any]:
    (found,) = [
        each
        for each in report["rows"]
        if (each["detector"], each["attack"]) == (detector, attack) and log in (None, each["log"])
    ]
    return found


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fixes of 0.5 m at 1 Hz for 115 s; those of the victim are pulled 30 m to the north from 60 s to 80 s."""
    return attacked_log(tmp_path_factory.mktemp("logs") / "drive")


@pytest.fixture(scope="module")
def report(drive: Path) -> dict[str, Any]:
    names = ("snapshot", "windowed:n=5", "px4-gate", "relative-motion:k=5", "ensemble:snapshot+windowed:n=5", "raim")
    return study(drive, detectors=names, probability=0.02)


def test_what_the_record_supports(report: dict[str, Any]) -> None:
    (log,) = report["logs"]
    assert log["supported"]
    assert log["alarms_set"] == int(0.02 * log["clean_epochs"]) == 1
    assert log["set_ci95"][0] < 0.02 < log["set_ci95"][1]
    assert log["least_probability"] == pytest.approx(1.0 / log["clean_epochs"])
    json.dumps(report, allow_nan=False)


def test_the_real_attack_is_found_at_its_first_fix(report: dict[str, Any]) -> None:
    found = row(report, "snapshot", "recorded")
    assert (found["found"], found["games"], found["real"]) == (1, 1, True)
    assert found["delay_s"] == pytest.approx(1.0)  # from the last clean fix
    assert found["lasts_s"] == pytest.approx(END - BEGIN + 1.0)
    assert 20.0 < found["largest_error_m"] < 40.0
    assert found["undetected_m"] == pytest.approx(found["error_at_alarm_m"])
    assert found["undetected_m"] < found["largest_error_m"]
    assert 0.0 < found["recovery_s"] < 30.0


def test_a_step_is_found_at_once_in_all_games(report: dict[str, Any]) -> None:
    found = row(report, "snapshot", "step")
    assert (found["found"], found["games"]) == (GAMES, GAMES)
    assert found["found_ci95"] == pytest.approx([0.025 ** (1.0 / GAMES), 1.0])  # Clopper-Pearson of n of n
    assert found["delay_s"] == 1.0
    assert found["largest_offset_m"] == pytest.approx(20.0)
    assert found["undetected_m"] < 20.0


def test_all_detectors_meet_the_same_onsets(report: dict[str, Any]) -> None:
    injected = [each for each in report["rows"] if not each["real"]]
    assert {each["attack"] for each in injected} == set(INJECTED) - {"time"}
    assert len({tuple(each["onsets_s"]) for each in injected}) == 1
    assert len(injected[0]["onsets_s"]) == GAMES


def test_a_game_is_that_of_the_attack_alone(drive: Path, report: dict[str, Any]) -> None:
    """Threshold, statistic and error of the study against a simulation of one run with the same attack."""
    found = row(report, "windowed:n=5", "ramp")
    record = records([str(drive)])[0]
    threshold = next(each["threshold"] for each in report["false_alarms"] if each["detector"] == "windowed:n=5")
    onset, last = found["onsets_s"][2], found["onsets_s"][2] + found["lasts_s"]
    detector = make_detector("windowed:n=5")
    detector.set_threshold(1e9)
    start = record.scenario().changed(onset=report_start(report), horizon=None)
    ramp, clean = (play(start, attack, [detector]) for attack in (make_attack(f"ramp:0.5,onset={onset:.17g}"), None))
    during = (ramp.time > onset + 1e-6) & (ramp.time <= last + 1e-6)
    alarm = during & (ramp.statistic[0] > threshold) & ~(clean.statistic[0] > threshold)
    expected = float(ramp.time[alarm.argmax()]) - onset if alarm.any() else None
    assert found["delays_s"][2] == (expected if expected is None else pytest.approx(expected))
    stop = alarm.argmax() + 1 if alarm.any() else len(during)
    assert found["undetected_by_game_m"][2] == pytest.approx(ramp.error[:stop][during[:stop]].max())


def report_start(report: dict[str, Any]) -> float:
    """When games of the record begin: the last epoch before the first that counts."""
    (log,) = report["logs"]
    return float(115.0 - log["clean_s"])


def test_what_cannot_watch_is_left_out_with_the_reason(report: dict[str, Any]) -> None:
    reasons = {entry["part"]: entry["reason"] for entry in report["left_out"]}
    assert reasons["raim"] == "needs ranges to satellites"
    assert reasons["time"] == "needs ranges to satellites"


def test_a_rate_that_the_record_cannot_show_is_not_supported(drive: Path) -> None:
    report = study(drive, detectors=("snapshot",), probability=0.001)
    (log,) = report["logs"]
    assert (log["supported"], log["alarms_set"], log["set_ci95"]) == (False, 0, None)
    assert report["rows"] == []


def test_attacks_of_ones_own_choice_are_named_by_their_specification(drive: Path) -> None:
    report = study(drive, detectors=("snapshot",), attacks=["ramp:0.5", "jump:30"], games=2)
    assert {each["attack"] for each in report["rows"]} == {"recorded", "ramp", "jump:30"}


@pytest.mark.parametrize(
    ("options", "words"),
    [(",attack=recorded", "attack is chosen by the study"), (",horizon=3", "horizon is chosen by the study")],
)
def test_options_of_the_game_are_refused(drive: Path, options: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        records([f"{drive}{options}"])


def test_folders_need_names_of_their_own(drive: Path) -> None:
    with pytest.raises(ValueError, match="two logs are named 'drive'"):
        records([str(drive), str(drive)])
    with pytest.raises(ValueError, match="is no folder"):
        records([str(drive / "nowhere")])


@pytest.fixture(scope="module")
def antenna(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clean scene, and one whose clock is pulled with 0.5 m/s² for 20 s, then at 10 m/s."""
    folder = tmp_path_factory.mktemp("antenna")
    clock = pull(500, EFFECT, 0.5, EFFECT + 100)
    begin = FIRST + INTERVAL * EFFECT
    write_resting(folder / "scene", noise=0.2)
    lines = f"first_effect_s = {begin}\npull_start_s = {begin}\n"
    write_resting(folder / "spoofed", noise=0.2, seed=1, clock=clock, lines=lines)
    return folder


def test_ranges_that_are_spoofed_find_their_clean_scene(antenna: Path) -> None:
    report = study(*folders_of(antenna), detectors=("px4-gate", "clock-drift"), games=2)
    scene, spoofed = report["logs"]
    assert (scene["clean"], spoofed["clean"]) == ("its own", "scene")
    assert {log["simulated_imu"] for log in report["logs"]} == {"tactical"}
    assert spoofed["clean_epochs"] == scene["clean_epochs"]
    found = row(report, "clock-drift", "recorded")
    assert found["log"] == "spoofed"
    assert found["found"] == 1
    assert found["delay_s"] < 5.0
    assert found["after_pull_s"] is not None
    assert found["recovery_s"] is None  # it lasts to the end
    assert row(report, "clock-drift", "time", "scene")["found"] == 2
    reasons = {entry["part"]: entry["reason"] for entry in report["left_out"]}
    assert reasons["frozen"] == "moves the fix by less than 0.5 m here"


def test_without_a_scene_the_record_before_the_attack_is_the_clean_one(antenna: Path) -> None:
    report = study(antenna / "spoofed", detectors=("clock-drift",), games=2)
    (log,) = report["logs"]
    assert log["clean"] == "before the attack"
    assert log["clean_epochs"] < EFFECT
    assert row(report, "clock-drift", "recorded")["delay_s"] < 5.0


def test_a_detector_that_remembers_too_much_is_left_out(drive: Path) -> None:
    """The real attack begins after 55 epochs: who remembers more would not see it come."""
    reasons = {each["part"]: each["reason"] for each in study(drive, detectors=("windowed:n=60",), games=2)["left_out"]}
    assert reasons["windowed:n=60"] == "remembers 59 epochs, for which the log is too short"


def test_an_ensemble_weighs_its_members_by_their_own_thresholds(report: dict[str, Any]) -> None:
    """Each member alarms once in the record; the union with a factor near 1 does so, too, and finds the step."""
    (name,) = {each["detector"] for each in report["rows"] if each["detector"].startswith("ensemble")}
    threshold = next(each["threshold"] for each in report["false_alarms"] if each["detector"] == name)
    assert 0.5 < threshold < 2.0
    assert row(report, name, "step")["found"] == GAMES


def test_a_log_that_cannot_be_used_stops_the_study_or_is_left_out(drive: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "log.toml").write_text("imu_to_body_frd = []\nstart_s = 0\n")
    given = records([str(tmp_path / "empty"), str(drive)])
    asked = Asked(words_of(["ramp:0.5"]), [make_detector("snapshot")], SHARE, 2)
    with pytest.raises(ValueError, match=r"imu\.csv"):
        last_of(real_attacks(given, asked))
    report = last_of(real_attacks(given, asked, lenient=True))
    assert [log["log"] for log in report["logs"]] == ["drive"]
    assert "empty" in {entry["log"] for entry in report["left_out"]}


@pytest.mark.skipif(not (DATA / "uav-octa").is_dir(), reason="no recorded flight beside the checkout")
def test_the_octocopter_is_found_by_all_gates_at_once() -> None:
    report = study(DATA / "uav-octa", detectors=("px4-gate", "ardupilot-gate", "snapshot"), games=2, probability=0.01)
    assert report["logs"][0]["alarms_set"] == 1
    for name in ("px4-gate", "ardupilot-gate", "snapshot"):
        found = row(report, name, "recorded")
        assert found["delay_s"] == pytest.approx(0.2, abs=0.01)  # its first spoofed fix lies 5.9 m off
        assert found["alarms_before"] == 0
        assert 30.0 < found["largest_error_m"] < 40.0


@pytest.mark.skipif(not (DATA / "texbat-ds2").is_dir(), reason="no recordings of TEXBAT beside the checkout")
def test_on_texbat_the_clock_tells_the_pull_that_no_position_shows() -> None:
    report = study(
        *(DATA / name for name in ("texbat-clean", "texbat-ds2")), detectors=("clock-drift", "raim"), games=1,
        probability=0.002, attacks=["time-only"],
    )  # fmt: skip
    clock = row(report, "clock-drift", "recorded")
    assert clock["alarms_before"] == 0
    assert clock["after_pull_s"] < 3.0
    assert clock["largest_error_m"] < 5.0
    assert np.isclose(clock["lasts_s"], 203.2, atol=0.5)
    assert row(report, "clock-drift", "time")["found"] == 1
    assert row(report, "raim", "time")["found"] == 0  # all ranges move alike
