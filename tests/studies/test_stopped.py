"""Ctrl-C in every program that plays for long: what was played until then is shown and written, and marked."""

import json
from contextlib import contextmanager

import pytest

from spoofgym.console import PlainConsole
from spoofgym.evaluation import tuning
from spoofgym.policies.classical import ClassicalDefender
from spoofgym.program import INTERRUPTED, incomplete, last_of
from spoofgym.report.page import write_page
from spoofgym.studies import (
    acna,
    agents,
    bayesian_bound,
    benchmark,
    duel_bound,
    fidelity_of_thresholds,
    integrity,
    patient_spoofer,
    self_tuning,
    thresholds,
    tune,
    wrong_shadow,
)
from spoofgym.studies.evaluate import defenders, matrix, spoofers
from spoofgym.studies.giving import STOPPED
from spoofgym.studies.reproduce import __main__ as reproduce
from spoofgym.studies.reproduce import liu_2018
from spoofgym.studies.reproduce.rows import Listing, Row

FLIGHT = ("--scenario", "liu-flight:horizon=12", "--threads", "1")
AGENTS = ("liu-flight-snapshot-spoofer", "drive-tuned-onset-spoofer")
WINDOWED = "windowed:n=5,threshold=35"
GIVEN = ("--defender", "snapshot/exclude", "--defender", "snapshot/px4-auto")


@pytest.fixture
def stop_at(monkeypatch):
    """Makes Ctrl-C come when the program begins a part of its work."""

    def at(part):
        begun = []

        @contextmanager
        def progress(self, text):
            begun.append(text)
            if len(begun) == part:
                raise KeyboardInterrupt
            yield

        monkeypatch.setattr(PlainConsole, "progress", progress)

    return at


@pytest.fixture
def small(monkeypatch):
    """Little to play where a command line cannot ask for little."""
    grid = (ClassicalDefender("a", WINDOWED, "exclude"), ClassicalDefender("b", WINDOWED, "px4-auto"))
    monkeypatch.setattr(tuning, "grid", lambda: grid)
    monkeypatch.setattr(tuning, "common_detectors", lambda scenario: ())
    monkeypatch.setattr(duel_bound, "DRIFTS", (2.0,))
    monkeypatch.setattr(duel_bound, "UNSEEN", (3.0,))
    monkeypatch.setattr(acna, "EPOCHS", acna.EPOCHS[:20:5])
    monkeypatch.setattr(acna, "WINDOWS", (1, 2))
    monkeypatch.setattr(acna, "THRESHOLDS", {"jump": acna.THRESHOLDS["jump"][:2], "slow": acna.THRESHOLDS["slow"][:2]})
    row = Row("item", 1.0, 1.0, None, "reproduced", "Reason.")
    monkeypatch.setattr(liu_2018, "groups", lambda *_: iter([Listing("first", (row,)), Listing("second", (row,))]))


PROGRAMS = {
    "evaluate spoofers": (spoofers, (*FLIGHT, "--episodes", "20"), 4),
    "evaluate defenders": (defenders, (*FLIGHT, "--episodes", "8", "--only", *GIVEN, "--attack", "ramp:1"), 3),
    "matrix": (matrix, (*FLIGHT, "--episodes", "8", "--detector", "snapshot", "--attack", "ramp:1"), 4),
    "tune": (tune, ("--scenario", "liu-flight:horizon=30", "--threads", "1", "--episodes", "8"), 2),
    "thresholds": (thresholds, ("--detector", "snapshot", "--arl0", "1e3", "1e4"), 2),
    "integrity": (integrity, (*FLIGHT, "--runs", "3"), 2),
    "bound duel": (duel_bound, ("--games", "4", "--payoff", "error", "--payoff", "beyond:50"), 2),
    "study wrong-shadow": (wrong_shadow, (*FLIGHT, "--episodes", "8"), 2),
    "study acna": (acna, ("--runs", "1"), 2),
    "study self-tuning": (self_tuning, ("--runs", "2", "--guards", "all"), 2),
    "study patient-spoofer": (patient_spoofer, ("--runs", "2"), 2),
    "study fidelity-of-thresholds": (
        fidelity_of_thresholds,
        (*FLIGHT, "--detector", "snapshot", "--detector", WINDOWED, "--arl0", "30", "--epochs", "500"),
        2,
    ),
    "agents": (agents, (*AGENTS, "--check", "--games", "4"), 2),
    "reproduce": (reproduce, ("liu-2018", "--quick"), 2),
}
"""The module of each, its arguments, and the part of its work in which Ctrl-C comes."""


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("name", PROGRAMS)
def test_what_was_played_is_shown_and_written(name, stop_at, tmp_path, capsys):
    module, arguments, part = PROGRAMS[name]
    stop_at(part)
    file = tmp_path / "out.json"
    assert module.main([*arguments, "--json", str(file)]) == INTERRUPTED
    said = capsys.readouterr()
    assert said.err.splitlines()[-1] == "interrupted"
    assert STOPPED in said.out
    assert f"rows in {file}, marked as incomplete" in said.out.replace("\n", " ")
    report = json.loads(file.read_text())
    assert report["complete"] is False
    assert report["rows"]
    write_page(tmp_path / "page.html", [file])
    assert "its program was stopped before its end" in (tmp_path / "page.html").read_text()


def test_a_figure_of_a_part_is_not_drawn(stop_at, tmp_path, capsys):
    stop_at(2)
    figure = tmp_path / "figure.png"
    assert patient_spoofer.main(["--runs", "2", "--figure", str(figure)]) == INTERRUPTED
    assert f"no figure in {figure}: it would not show everything" in capsys.readouterr().out.replace("\n", " ")
    assert not figure.exists()


def test_a_program_that_had_nothing_yet_only_ends(stop_at, tmp_path, capsys):
    stop_at(1)
    file = tmp_path / "out.json"
    assert patient_spoofer.main(["--runs", "2", "--json", str(file)]) == INTERRUPTED
    assert capsys.readouterr() == ("", "interrupted\n")
    assert not file.exists()


@pytest.mark.parametrize(
    ("module", "work", "arguments"),
    [
        (bayesian_bound, "bound_games", ()),
        (benchmark, "measure", ("attack", "ramp:1")),
        (benchmark, "references", ("references", "attack")),
    ],
)
def test_games_that_are_kept_in_a_folder_are_told(module, work, arguments, tmp_path, monkeypatch, capsys):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(module, work, stopped)
    assert module.main([*arguments, "--out", str(tmp_path)]) == INTERRUPTED
    said = capsys.readouterr().err.splitlines()
    assert said == [f"what is finished is kept in {tmp_path}: the same command goes on", "interrupted"]


def test_a_whole_report_has_no_mark():
    assert last_of(iter([{"rows": [1]}, {"rows": [1, 2]}])) == {"rows": [1, 2]}
    assert incomplete({"rows": [1]}) == {"rows": [1], "complete": False}
