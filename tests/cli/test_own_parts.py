"""Parts of one's own, registered by a module that `--import` names, stand beside ours in every program."""

import json

import pytest

from spoofgym import own_parts
from spoofgym.attacks import ATTACKS
from spoofgym.cli.main import main
from spoofgym.detectors import DETECTORS
from spoofgym.evaluation.engine import Processes, Task
from spoofgym.evaluation.matrix_games import Matrix
from spoofgym.policies.classical import grid, own_defenders
from spoofgym.responses import RESPONSES
from spoofgym.scenarios import SCENARIOS, make_scenario

MODULE = """
import numpy as np
from spoofgym.attacks import ATTACKS
from spoofgym.attacks.profiles import Ramp
from spoofgym.detectors import DETECTORS
from spoofgym.detectors.base import Detector
from spoofgym.responses import RESPONSES
from spoofgym.responses.exclude import Exclude
from spoofgym.scenarios import SCENARIOS, make_scenario


class Largest(Detector):
    "Alarm when any whitened innovation is large."
    name, threshold = "largest", 4.9

    def update(self, epoch):
        return np.abs(epoch.innovation.whitened).max(axis=1)


class Mine(Exclude):
    "As exclude."
    name = "mine"


class Climb(Ramp):
    "A ramp of 0.7 m/s."
    name = "climb"

    def __init__(self):
        super().__init__(0.7)


def my_flight():
    "A short flight."
    return make_scenario("liu-flight:horizon=15")


DETECTORS["largest"], RESPONSES["mine"], ATTACKS["climb"], SCENARIOS["my-flight"] = Largest, Mine, Climb, my_flight
"""


@pytest.fixture
def module(tmp_path, monkeypatch):
    """The path of the module; what it registers is forgotten afterwards."""
    path = tmp_path / "parts_for_programs.py"
    path.write_text(MODULE)
    monkeypatch.setattr(own_parts, "_TAKEN", [])
    monkeypatch.syspath_prepend(str(tmp_path))
    yield str(path)
    for registry, name in ((DETECTORS, "largest"), (RESPONSES, "mine"), (ATTACKS, "climb"), (SCENARIOS, "my-flight")):
        registry.pop(name, None)


@pytest.fixture
def registered(module, monkeypatch):
    import sys

    monkeypatch.delitem(sys.modules, "parts_for_programs", raising=False)
    own_parts.take(module)


def test_a_matrix_of_ones_own_parts_alone(registered, capsys):
    parts = ["--scenario", "my-flight", "--detector", "largest", "--attack", "climb", "--episodes", "20"]
    assert main(["matrix", *parts, "--threads", "1", "--json", "-"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert {row["detector"] for row in report["rows"]} == {"largest"}
    assert [curve["attack"] for curve in report["curves"]] == ["climb"]


def test_own_parts_stand_in_what_is_played_where_nobody_names_any(registered):
    matrix = Matrix(make_scenario("my-flight"), "linear", 300.0, 1, 0, 1)
    assert "climb" in matrix.names((), ())
    names = {defender.name for defender in grid()}
    assert {"largest > exclude", "largest > mine", "windowed:n=20 > mine", "largest > onset-depth"} <= names
    assert [defender.name for defender in own_defenders()] == ["largest > exclude", "windowed:n=20 > mine"]


def test_without_them_nothing_changes():
    assert own_defenders() == []
    assert all(part.response != "mine" for part in grid())


def test_spoofers_of_ones_own_are_rows_of_the_table(registered, capsys):
    assert main(["evaluate", "spoofers", "--scenario", "my-flight", "--episodes", "20", "--json", "-"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert "climb" in [row["attacker"] for row in rows]


def test_processes_know_them_too(registered):
    assert Processes(2).run([Task("one", _known), Task("two", _known)], lambda _: None) == [True, True]


def _known() -> bool:
    return "largest" in DETECTORS and "my-flight" in SCENARIOS
