"""Seeds of one training stand together: their mean, their range, and the best of all other attacks."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from spoofgym.evaluation.matrix_games import Matrix
from spoofgym.evaluation.seeds import seed_rows
from spoofgym.policies.learned import LearnedSpoofer
from spoofgym.scenarios import make_scenario
from spoofgym.studies.matrix_presentation import learned_table

ERRORS = {
    "snapshot:arl0=300": {"none": 0.8, "ramp:1": 3.0, "a-0": 5.0, "a-1": 8.0, "b": 50.0, "c": 60.0, "d": 70.0},
    "mewma:arl0=300": {"none": 0.8, "ramp:1": 2.0, "a-0": 6.0, "a-1": 7.0, "b": 1.5, "c": 0.0, "d": 0.0},
}
TRAINED: dict[str, Any] = {
    "a-0": "snapshot:arl0=300",
    "a-1": "snapshot:arl0=300",
    "b": ["mewma:arl0=300"],
    "c": "snapshot",
    "d": ["snapshot:arl0=300", "mewma:arl0=300"],
}
ROWS = [
    {"detector": detector, "attack": attack, "mean_undetected_error_m": error, "detection_probability": error / 100.0}
    for detector, errors in ERRORS.items()
    for attack, error in errors.items()
]


def policies(names: list[str]) -> list[LearnedSpoofer]:
    nothing: Any = ()
    return [LearnedSpoofer(Path(name), {"detector": TRAINED[name]}, nothing, nothing, nothing) for name in names]


def test_the_mean_and_the_range_are_those_of_the_own_detector() -> None:
    first, second = seed_rows(ROWS, policies(list(TRAINED)))
    assert (first["trained_against"], first["policies"]) == ("snapshot:arl0=300", ["a-0", "a-1"])
    assert (first["mean_undetected_error_m"], first["least_m"], first["most_m"]) == (6.5, 5.0, 8.0)
    # another learned spoofer is no attack that somebody thought of
    assert (first["best_other_attack"], first["best_other_m"]) == ("ramp:1", 3.0)
    assert first["detection"] == {"snapshot:arl0=300": [0.05, 0.08], "mewma:arl0=300": [0.06, 0.07]}
    # what was trained at another rate, or against several at once, was not trained against one of the matrix
    assert (second["trained_against"], second["policies"]) == ("mewma:arl0=300", ["b"])
    assert seed_rows(ROWS, []) == []


def test_a_table_shows_them() -> None:
    names = [{"name": name} for name in ERRORS]
    report = {"arl0": 300.0, "detectors": names, "learned": seed_rows(ROWS, policies(list(TRAINED)))}
    console = Console(width=200)
    with console.capture() as captured:
        console.print(learned_table(report))
    lines = [line.split() for line in captured.get().splitlines() if line.strip()]
    assert lines[1] == ["snapshot", "2", "6.5", "[5.0,", "8.0]", "6.5", "[5.0,", "8.0]", "3.0", "(ramp:1)"]
    assert lines[2] == ["mewma", "1", "1.5", "1.5", "2.0", "(ramp:1)"]


def test_spoofers_of_one_name_are_refused() -> None:
    matrix = Matrix(make_scenario("liu-flight:horizon=20"), "linear", 300.0, 10, 0, 1)
    same = [
        LearnedSpoofer(Path(folder) / "a", {"knowledge": "shadow", "detector": "snapshot"}, (), (), ())
        for folder in ("x", "y")
    ]
    with pytest.raises(ValueError, match="run folders of one name cannot be told apart: a, a"):
        matrix.report(("snapshot",), ("ramp:1",), same)


def test_seeds_have_a_spread() -> None:
    """Of one policy alone the range is a point."""
    (only,) = seed_rows(ROWS, policies(["a-1"]))
    assert np.ptp([only["least_m"], only["most_m"], only["mean_undetected_error_m"]]) == 0.0
