"""A policy that plays what it was not trained on is told on one line of stderr, once, and plays."""

import json
from pathlib import Path

import numpy as np
import pytest

from spoofgym.detectors import make_detector
from spoofgym.envs.observation import spoofer_fields
from spoofgym.evaluation import wrong_shadow as shadows
from spoofgym.evaluation.trained_on import what_is_new
from spoofgym.policies.learned import CONFIG_FILE, LearnedDefender, LearnedSpoofer
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.imu import GRADES
from spoofgym.studies import wrong_shadow
from spoofgym.studies.evaluate import defenders as evaluate_defenders
from spoofgym.studies.evaluate import matrix
from spoofgym.studies.evaluate import spoofers as evaluate_spoofers

SCENARIO = "liu-flight:horizon=12"


@pytest.fixture
def folder(tmp_path):
    """A run folder whose policy stays where it is, with a name that is markup and mathematics elsewhere."""
    path = tmp_path / "x[" / "y][b] $a^^$ :bomb:"
    path.mkdir(parents=True)
    layout = tuple(field.name for field in spoofer_fields("shadow", 3, ("snapshot",)))
    zeros = np.zeros((3, len(layout)), dtype=np.float32)
    LearnedSpoofer(path, {"knowledge": "shadow"}, layout, (zeros,), (zeros[:, 0],)).save(path)
    (path / CONFIG_FILE).write_text(json.dumps({"environment": {"scenario": SCENARIO, "knowledge": "shadow"}}))
    return path


def notes(text):
    return [line for line in text.splitlines() if line.startswith("note: ")]


def test_what_is_trained_on_is_not_told(folder, capsys):
    assert evaluate_spoofers.main(["--scenario", SCENARIO, "--attacker", str(folder), "--episodes", "4"]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--scenario", "liu-flight:horizon=13"], "scenario liu-flight:horizon=13 (trained: liu-flight:horizon=12)"),
        (["--scenario", SCENARIO, "--detector", "snapshot:threshold=20"], "(trained: snapshot)"),
        (["--scenario", SCENARIO, "--fidelity", "strapdown"], "fidelity strapdown (trained: linear)"),
    ],
)
def test_what_is_new_is_told_once(folder, options, words, capsys):
    assert evaluate_spoofers.main([*options, "--attacker", str(folder), "--episodes", "4", "--json", "-"]) == 0
    printed = capsys.readouterr()
    json.loads(printed.out)
    (note,) = notes(printed.err)
    assert note.startswith(f"note: policy {folder.name!r} plays what it was not trained on: ")
    assert note.endswith(words)


def test_the_matrix_tells_what_is_new(folder, capsys):
    options = ["--scenario", "liu-flight:horizon=13", "--detector", "snapshot", "--attack", "ramp:1"]
    assert matrix.main([*options, "--attacker", str(folder), "--episodes", "4", "--json", "-"]) == 0
    (note,) = notes(capsys.readouterr().err)
    assert note.endswith("scenario liu-flight:horizon=13 (trained: liu-flight:horizon=12)")


def test_a_wrong_shadow_is_new_by_design_but_another_victim_is_not(folder, capsys, monkeypatch):
    # each shadow takes an optimum of its own
    monkeypatch.setattr(shadows, "SIGMA_FACTORS", (2.0,))
    grades = {name: GRADES[name] for name in ("tactical", "navigation")}
    monkeypatch.setattr(shadows, "GRADES", grades)
    assert wrong_shadow.main(["--scenario", SCENARIO, "--attacker", str(folder), "--episodes", "4"]) == 0
    assert notes(capsys.readouterr().err) == []
    other = ["--scenario", "liu-flight:horizon=13", "--attacker", str(folder), "--episodes", "4", "--json", "-"]
    assert wrong_shadow.main(other) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["kind"] == "wrong-shadow"
    assert len(notes(printed.err)) == 1


def test_specifications_of_one_game_are_no_difference():
    configuration = {"knowledge": "shadow", "scenario": "liu-flight:horizon=12,onset=800", "detector": ["snapshot"]}
    policy = LearnedSpoofer(Path("x"), configuration, (), (), ())
    assert what_is_new(policy, make_scenario(SCENARIO), "linear", [make_detector("snapshot")]) == []


def test_a_defender_is_told_by_scenario_and_fidelity():
    policy = LearnedDefender(Path("x"), {"attacks": "training", "scenario": "foi-drive:horizon=60"}, (), (), ())
    new = what_is_new(policy, make_scenario("foi-drive:horizon=40"), "strapdown", None)
    assert new == [
        "scenario foi-drive:horizon=40 (trained: foi-drive:horizon=60)", "fidelity strapdown (trained: linear)"
    ]


def test_a_log_that_is_not_here_is_told_by_its_specification():
    policy = LearnedSpoofer(Path("x"), {"knowledge": "shadow", "scenario": "recorded:/nowhere"}, (), (), ())
    new = what_is_new(policy, make_scenario(SCENARIO), "linear", [make_detector("snapshot")])
    assert new == [f"scenario {SCENARIO} (trained: recorded:/nowhere)"]


def test_a_name_is_no_markup_in_tables_and_figures(folder, tmp_path, capsys):
    figure = tmp_path / "out.svg"
    arguments = ["--scenario", SCENARIO, "--attacker", str(folder), "--episodes", "4", "--figure", str(figure)]
    assert evaluate_spoofers.main(arguments) == 0
    assert folder.name in capsys.readouterr().out
    assert figure.is_file()


def test_players_are_not_taken_for_each_other(folder, capsys):
    assert evaluate_defenders.main(["--scenario", "foi-drive:horizon=40", "--defender", str(folder)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f"error: {folder} is the run folder of a spoofer, not of a defender"
    (folder / CONFIG_FILE).write_text(json.dumps({"environment": {"attacks": "training", "detectors": ["snapshot"]}}))
    for program in (evaluate_spoofers, wrong_shadow):
        assert program.main(["--scenario", SCENARIO, "--attacker", str(folder)]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line == f"error: {folder} is the run folder of a defender, not of a spoofer"
