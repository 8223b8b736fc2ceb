"""Rows of attacks on a recorded log."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from spoofgym.attacks import make_attack
from spoofgym.detectors import make_detector
from spoofgym.evaluation.recorded import evaluate_recorded, held_out_errors
from spoofgym.geodesy import displace
from spoofgym.scenarios.recorded import recorded
from spoofgym.trajectory import Accelerate, Straight, Turn, fly

KEYS = [
    "attack",
    "clean_error_median_m",
    "clean_error_p95_m",
    "mean_nis",
    "false_alarms",
    "clean_epochs",
    "detected",
    "time_to_detect_s",
    "alarms_before_onset",
    "alarm_after_pull_s",
    "error_at_detection_m",
    "max_error_m",
    "error_epochs",
    "alarms_after_end",
    "recovery_s",
]
DATA = Path(__file__).parents[3] / "shared" / "data"
CLEAN_BOUNDS = {"car-rtk": 0.15, "car-loop": 0.8, "car-long-loop": 0.8, "uav-thor": 1.0}


def write_log(folder: Path, *, reference: bool = True) -> Path:
    """100 s, fixes at 2 Hz with 0.3 m noise, a perfect sensor in forward, right, down; true reference at 10 Hz."""
    turn = math.radians(90.0)
    truth = fly(
        [Straight(30.0), Turn(turn, 10.0), Accelerate(5.0, 10.0), Straight(20.0), Turn(-turn, 10.0), Straight(20.0)],
        position=(0.8, 0.1, 50.0),
        speed=10.0,
        heading=2.0,
        rate=50,
    )
    frd = [1, 0, 2]
    sign = np.array([1.0, 1.0, -1.0])
    imu = np.column_stack(
        [truth.time[:-1] + 0.01, truth.angular_rate[:, frd] * sign, truth.specific_force[:, frd] * sign]
    )

    def fixes(index: np.ndarray, noise: np.ndarray) -> np.ndarray:
        position = displace(truth.position[index], noise)
        degrees = np.degrees(position[:, :2])
        return np.column_stack([truth.time[index], degrees, position[:, 2], truth.velocity[index][:, frd] * sign])

    folder.mkdir()
    (folder / "log.toml").write_text("imu_to_body_frd = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nstart_s = 2.0\n")
    tables = {"imu": ("t_s,gx_radps,gy_radps,gz_radps,ax_mps2,ay_mps2,az_mps2", imu)}
    header = "t_s,lat_deg,lon_deg,h_m,vn_mps,ve_mps,vd_mps"
    index = np.arange(0, 5000, 25)
    tables["gnss"] = (header, fixes(index, 0.3 * np.random.default_rng(1).standard_normal((len(index), 3))))
    if reference:
        index = np.arange(0, 5000, 5)
        tables["reference"] = (header, fixes(index, np.zeros((len(index), 3))))
    for name, (columns, values) in tables.items():
        np.savetxt(folder / f"{name}.csv", values, delimiter=",", header=columns, comments="", fmt="%.12f")
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_log(tmp_path_factory.mktemp("logs") / "drive")


def test_rows_of_a_clean_a_slow_and_a_rough_attack(folder: Path) -> None:
    attacks = [make_attack(text) for text in ("none", "ramp:0.5,onset=50", "jump-ramp:0,jump=100,onset=60")]
    rows = evaluate_recorded(recorded(str(folder)), attacks, [make_detector("snapshot"), make_detector("snapshot:1e6")])
    assert [list(row) for row in rows] == [KEYS] * 3
    json.dumps(rows, allow_nan=False)
    clean, slow, rough = rows
    assert clean["clean_error_median_m"] < 0.6
    assert clean["clean_error_median_m"] < clean["clean_error_p95_m"] < 1.5
    assert 0.0 < clean["mean_nis"] < 9.0
    assert clean["false_alarms"] == 0
    assert 120 <= clean["clean_epochs"] <= 140
    assert clean["detected"] is False
    assert clean["max_error_m"] < 2.0
    assert slow["detected"] is False
    assert slow["time_to_detect_s"] is None
    assert slow["max_error_m"] == pytest.approx(0.5 * (99.5 - 50.0), abs=2.0)
    assert rough["detected"] is True
    assert rough["time_to_detect_s"] == pytest.approx(0.5)
    assert rough["error_at_detection_m"] < 2.0
    assert rough["max_error_m"] > 50.0


def test_no_reference_no_clean_error(tmp_path: Path) -> None:
    scenario = recorded(str(write_log(tmp_path / "log", reference=False)))
    (row,) = evaluate_recorded(scenario, [make_attack("ramp:0.5")], [make_detector("snapshot")])
    assert row["clean_error_median_m"] is None
    assert row["clean_error_p95_m"] is None
    assert row["max_error_m"] > 25.0


def test_the_error_between_fixes_continues_that_at_the_fixes(folder: Path) -> None:
    scenario = recorded(str(folder))
    assert scenario.family.log.reference is not None
    errors = held_out_errors(scenario, 40.0)
    assert errors is not None
    assert len(errors) == 476  # 10 Hz without every fifth, from 40 s to before the last fix
    assert np.abs(np.diff(errors)).max() < 0.5


def test_false_alarms_are_counted_and_do_not_hide_an_attack(folder: Path) -> None:
    """A third of the clean epochs alarms; of the same alarms in a game without an attack none is a detection."""
    attacks, detector = [make_attack("ramp:0.5"), make_attack("ramp:1e-9")], make_detector("snapshot:0.03")
    spoofed, harmless = evaluate_recorded(recorded(str(folder)), attacks, [detector])
    assert 0.1 * spoofed["clean_epochs"] < spoofed["false_alarms"] < 0.9 * spoofed["clean_epochs"]
    assert spoofed["detected"]
    assert not harmless["detected"]
    assert harmless["time_to_detect_s"] is None


def test_a_log_too_short_for_clean_figures(folder: Path) -> None:
    scenario = recorded(str(folder))
    with pytest.raises(ValueError, match="clean figures need"):
        evaluate_recorded(scenario, [make_attack("none")], [make_detector("windowed:n=500,p_fa=1e-5")])


@pytest.mark.parametrize("name", CLEAN_BOUNDS)
@pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data, real logs for tests, is absent")
def test_real_logs(name: str) -> None:
    scenario = recorded(str(DATA / name))
    (row,) = evaluate_recorded(scenario, [make_attack("ramp:0.5")], [make_detector("snapshot")])
    assert row["clean_error_median_m"] < CLEAN_BOUNDS[name]
    assert row["false_alarms"] <= 0.01 * row["clean_epochs"]
    spoofed = 0.5 * (scenario.times(0)[-1] - scenario.timeline.start)
    assert row["max_error_m"] == pytest.approx(spoofed, rel=0.05)
