"""The programs as a user runs them: a short training, its evaluation, interruption and resumption, bad input."""

import contextlib
import io
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from spoofgym.learning import spoofer
from spoofgym.policies import baselines
from spoofgym.policies.learned import CONFIG_FILE, POLICY_FILE, LearnedSpoofer
from spoofgym.studies.evaluate import spoofers as evaluate_spoofers

ROW_KEYS = {
    "attacker",
    "knowledge",
    "episodes",
    "mean_undetected_error_m",
    "ci95_m",
    "exact_undetected_error_m",
    "detection_probability",
    "median_time_to_detect_s",
    "error_at_detection_m",
    "fraction_of_optimum",
}
BASELINES = ["none", "random", "best-ramp", "closed-form", "optimum", "upper-bound"]
ROOT = Path(__file__).parents[2]
SHORT = ["--scenario", "liu-flight:horizon=20", "--threads", "1"]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "short"
    assert spoofer.main([*SHORT, "--steps", "6000", "--out", str(folder)]) == 0
    return folder


def test_training_leaves_a_policy_and_says_how(run):
    config = json.loads((run / CONFIG_FILE).read_text())
    assert config["environment"]["scenario"] == "liu-flight:horizon=20"
    assert config["environment"]["on_alarm"] == "end"
    assert config["learner"]["lanes"] == 256
    assert LearnedSpoofer.load(run).act(np.zeros((2, 20), dtype=np.float32)).shape == (2, 3)
    assert list((run / "tensorboard").rglob("events.*"))


def test_a_run_folder_is_not_overwritten(run, capsys):
    before = (run / POLICY_FILE).read_bytes()
    assert spoofer.main([*SHORT, "--out", str(run)]) == 2
    assert "already holds a run" in " ".join(capsys.readouterr().err.split())
    assert (run / POLICY_FILE).read_bytes() == before


@pytest.fixture(scope="module")
def report(run):
    """What an evaluation writes to standard output, where nothing else may stand."""
    arguments = ["--attacker", str(run), "--episodes", "2000", "--json", "-", "--attack", "ramp:0.2"]
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert evaluate_spoofers.main([*SHORT, *arguments]) == 0
    return json.loads(out.getvalue())


def test_json_alone_on_stdout(report):
    assert (report["schema_version"], report["kind"]) == (1, "attackers")
    assert report["detector"]["name"] == "snapshot"
    assert report["detector"]["threshold"] == 25.9
    assert report["detector"]["arl0"] == pytest.approx(1e5, rel=0.01)
    assert [row["attacker"] for row in report["rows"]] == [*BASELINES, "ramp:0.2", "short"]
    rows = {row["attacker"]: row for row in report["rows"]}
    assert all(set(row) == ROW_KEYS for row in report["rows"])
    assert rows["optimum"]["fraction_of_optimum"] == 1.0
    assert rows["upper-bound"]["fraction_of_optimum"] >= 1.0
    assert rows["upper-bound"]["mean_undetected_error_m"] is None
    assert rows["best-ramp"]["exact_undetected_error_m"] < rows["closed-form"]["exact_undetected_error_m"]
    assert rows["short"]["knowledge"] == "shadow"
    assert 0 <= rows["short"]["fraction_of_optimum"] <= 1


def test_exact_score_of_a_policy_agrees_with_simulation(report):
    """6 sigma of 2000 games: false failure below 1e-8; the filter's noise in the norm adds up to its own size."""
    row = report["rows"][-1]
    standard_error = (row["ci95_m"][1] - row["ci95_m"][0]) / (2 * 1.96)
    assert abs(row["mean_undetected_error_m"] - row["exact_undetected_error_m"]) < 6 * standard_error + 1.0


def test_figure_and_table(run, tmp_path, capsys):
    figure = tmp_path / "sub" / "out.png"
    assert evaluate_spoofers.main([*SHORT, "--attacker", str(run), "--episodes", "50", "--figure", str(figure)]) == 0
    assert figure.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    table = capsys.readouterr().out
    assert all(name in table for name in [*BASELINES, "short"])


def test_another_detector_has_no_optimum(capsys, monkeypatch):
    monkeypatch.setattr(baselines, "SEARCH_EPISODES", 50)
    monkeypatch.setattr(baselines, "SEARCH_ROUNDS", 1)
    arguments = ["--scenario", "liu-flight:horizon=8", "--threads", "1", "--detector", "windowed:n=5,threshold=45"]
    assert evaluate_spoofers.main([*arguments, "--episodes", "100", "--json", "-"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["detector"]["arl0"] is None
    assert [row["attacker"] for row in report["rows"]] == BASELINES
    assert all(row["fraction_of_optimum"] is None for row in report["rows"])


def test_a_run_can_be_resumed(run, tmp_path):
    folder = tmp_path / "resumed"
    assert spoofer.main([*SHORT, "--steps", "5000", "--out", str(folder)]) == 0
    first = (folder / POLICY_FILE).read_bytes()
    assert spoofer.main([*SHORT, "--steps", "20000", "--out", str(folder), "--resume"]) == 0
    assert (folder / POLICY_FILE).read_bytes() != first


@pytest.mark.slow
def test_interruption_leaves_a_usable_policy(tmp_path, child):
    """Of the program as a checkout starts it."""
    folder = tmp_path / "interrupted"
    command = [sys.executable, "-m", "train.spoofer", *SHORT, "--steps", "100000000", "--out", str(folder)]
    process = child(command, stderr=subprocess.PIPE, cwd=ROOT)
    deadline = time.monotonic() + 600
    while not list(folder.rglob("events.*")) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "--resume" in errors
    LearnedSpoofer.load(folder)
    (line,) = errors.splitlines()
    assert line.startswith("interrupted after")


@pytest.mark.parametrize(
    ("program", "arguments", "message"),
    [
        (spoofer, ["--scenario", "moon"], "unknown scenario 'moon'; valid names: foi-drive, kujur-flight, liu-flight"),
        (spoofer, ["--detector", "oracle"], "unknown detector 'oracle'; valid names: acceleration, acna"),
        (spoofer, ["--knowledge", "blind", "--action", "innovation"], "knowledge must be 'shadow' or 'full'"),
        (evaluate_spoofers, ["--scenario", "liu-flight:horizon=0"], "horizon must be a whole number, 1 or more, got 0"),
        (evaluate_spoofers, ["--attack", "ramp:-1"], "rate must be a finite number, 0 or more"),
        (evaluate_spoofers, ["--attack", "ramp:1,onset=5000"], "lies outside the game"),
        (evaluate_spoofers, ["--attacker", "nowhere"], "is no run folder"),
    ],
)
def test_bad_input_is_told_and_nothing_is_written(program, arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert program.main(arguments) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert list(tmp_path.rglob("*.npz")) == []


@pytest.mark.parametrize(
    ("program", "option", "value"),
    [
        (spoofer, "--steps", "0"),
        (spoofer, "--steps", "many"),
        (spoofer, "--seed", "-1"),
        (evaluate_spoofers, "--figure", "out.gif"),
    ],
)
def test_arguments_are_checked_at_once(program, option, value, capsys):
    with pytest.raises(SystemExit):
        program.main([option, value])
    assert value in capsys.readouterr().err
