"""Training programs of a checkout are those of the package, and commands that have moved say where."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MOVED = {
    "train.evaluate": "spoofgym.studies.evaluate",
    "train.tune": "spoofgym.studies.tune",
    "train.wrong_shadow": "spoofgym.studies.wrong_shadow",
    "spoofgym.evaluation.acna_study": "spoofgym.studies.acna",
    "spoofgym.evaluation.integrity_study": "spoofgym.studies.integrity",
    "spoofgym.evaluation.patient_spoofer": "spoofgym.studies.patient_spoofer",
    "spoofgym.evaluation.recorded_ranges": "spoofgym.studies.recorded_ranges",
    "spoofgym.evaluation.reproduce": "spoofgym.studies.reproduce",
    "spoofgym.evaluation.self_tuning": "spoofgym.studies.self_tuning",
    "spoofgym.evaluation.thresholds": "spoofgym.studies.thresholds",
}


def run(*command):
    return subprocess.run([sys.executable, "-m", *command], cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("name", ["spoofer", "defender", "league"])
def test_a_face_is_the_program_of_the_package(name):
    face = importlib.import_module(f"train.{name}")
    assert face.main is importlib.import_module(f"spoofgym.learning.{name}").main


@pytest.mark.parametrize(("old", "new"), MOVED.items())
def test_a_moved_command_says_where_it_is(old, new):
    result = run(old, "--scenario", "liu-flight")
    assert (result.returncode, result.stdout) == (2, "")
    assert result.stderr == f"error: this command has moved: python -m {new}\n"
    assert importlib.util.find_spec(new) is not None
