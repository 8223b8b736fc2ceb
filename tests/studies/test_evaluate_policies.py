"""`evaluate` takes a policy by its folder or its name, and as the specification of an attack or a defender."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spoofgym.evaluation import defenders
from spoofgym.evaluation.attackers import Evaluation
from spoofgym.policies import published
from spoofgym.policies.classical import ClassicalDefender
from spoofgym.studies.evaluate import defenders as evaluate_defenders
from spoofgym.studies.evaluate import recorded as evaluate_recorded
from spoofgym.studies.evaluate import spoofers as evaluate_spoofers
from tests.run_folders import defender, spoofer
from tests.scenarios.test_recorded import write_log

FLIGHT = "liu-flight:horizon=40"


def report(program: Any, capsys: pytest.CaptureFixture[str], *arguments: str) -> dict:
    assert program.main(["--scenario", FLIGHT, "--episodes", "8", "--json", "-", *arguments]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.fixture
def agents(tmp_path, monkeypatch):
    """The folder of the published agents."""
    folder = tmp_path / "agents"
    folder.mkdir()
    monkeypatch.setattr(published, "agents_folder", lambda: folder)
    return folder


def test_a_spoofer_is_given_by_its_folder_or_its_name(agents, capsys):
    text = spoofer({"scenario": FLIGHT, "knowledge": "shadow"}, agents / "x")
    spelled = ("--attacker", str(agents / "x")), ("--attacker", text), ("--attacker", "x"), ("--attacker", "policy:x")
    rows = [report(evaluate_spoofers, capsys, *arguments)["rows"][-1] for arguments in spelled]
    assert rows[0]["attacker"] == "x"
    assert rows[1:] == rows[:1] * 3


def test_an_attack_tells_what_the_policy_within_it_knows(tmp_path, capsys):
    text = spoofer({"scenario": FLIGHT, "knowledge": "shadow"}, tmp_path / "x")
    row = report(evaluate_spoofers, capsys, "--attack", f"tracking-error:{text}")["rows"][-1]
    assert (row["attacker"], row["knowledge"]) == (f"tracking-error:{text}", "shadow")


def test_a_defender_is_given_by_its_folder_or_its_name_or_as_a_response(agents, capsys, monkeypatch):
    monkeypatch.setattr(defenders, "WORLD_DETECTORS", ("snapshot",))
    monkeypatch.setattr(defenders, "PUBLISHED", ())
    monkeypatch.setattr(defenders, "tuned_for", lambda scenario: [ClassicalDefender("t", "snapshot", "exclude", True)])
    text = defender({"scenario": FLIGHT, "attacks": "none", "detectors": ["snapshot"]}, agents / "d")
    as_response = f"snapshot > {text}"
    pool = "snapshot > pool:exclude+latch"
    found = []
    for given in (str(agents / "d"), text, "d", "policy:d"):
        asked = [part for each in (given, as_response, pool) for part in ("--defender", each)]
        all_rows = report(evaluate_defenders, capsys, *asked, "--population", "training")["rows"]
        rows = {name: [row for row in all_rows if row["defender"] == name] for name in ("d", as_response, pool)}
        found.append(rows["d"])
        assert rows[pool]
        assert [{**row, "defender": "d"} for row in rows[as_response]] == rows["d"]
    assert found[1:] == found[:1] * 3


def test_what_is_no_defender_is_told(tmp_path: Path, capsys):
    for given in ("nowhere", "policy:nowhere"):
        assert evaluate_defenders.main(["--defender", given]) == 2
        error = capsys.readouterr().err
        assert f"--defender '{given}' is neither a run folder nor detector/response: 'nowhere' is no run f" in error


def test_a_policy_attacks_a_recorded_log_that_shows_what_it_was_trained_to_see(tmp_path, capsys):
    """A blind spoofer knows no filter; one with a shadow filter needs a linear model, which a log has not."""
    log = f"{write_log(tmp_path / 'log', velocity=False)},horizon=30"
    blind, seeing = (
        spoofer({"scenario": FLIGHT, "knowledge": knowledge}, tmp_path / knowledge) for knowledge in ("blind", "shadow")
    )
    assert evaluate_recorded.main([log, "--attack", blind, "--attack", "none", "--json", "-"]) == 0
    pulled, clean = json.loads(capsys.readouterr().out)["rows"]
    assert pulled["attack"] == blind
    assert pulled["max_error_m"] > clean["max_error_m"]
    assert evaluate_recorded.main([log, "--attack", seeing]) == 2
    assert "cannot play on scenario" in capsys.readouterr().err


def test_seeds_of_one_training_are_taken_together_and_every_game_is_written(tmp_path, capsys):
    for name in ("s0", "s1"):
        spoofer({"scenario": FLIGHT, "knowledge": "shadow"}, tmp_path / name)
    both = [part for name in ("s0", "s1") for part in ("--attacker", str(tmp_path / name))]
    found = report(evaluate_spoofers, capsys, *both, "--games", str(tmp_path / "games.npz"))
    rows = {row["attacker"]: row for row in found["rows"]}
    (together,) = found["aggregates"]
    assert together["runs"] == ["s0", "s1"]
    assert together["mean_m"] == pytest.approx(np.mean([rows[n]["mean_undetected_error_m"] for n in ("s0", "s1")]))
    with np.load(tmp_path / "games.npz") as games:
        players = games["players"].tolist()
        assert games["undetected_error_m"].shape == (len(players), 8)
        for name in ("s0", "none", "optimum"):
            mean = games["undetected_error_m"][players.index(name)].mean()
            assert mean == pytest.approx(rows[name]["mean_undetected_error_m"])


def test_one_defender_meets_one_attack_alone(capsys, tmp_path):
    parts = ["--defender", "snapshot/exclude", "--only", "--attack", "ramp:2", "--games", str(tmp_path / "games.npz")]
    found = report(evaluate_defenders, capsys, *parts)
    assert found["kinds"] == {"snapshot > exclude": "given"}
    assert {row["attack"] for row in found["rows"]} <= {"all-games", "none", "ramp:2"}
    assert found["attack"] == "ramp:2"
    with np.load(tmp_path / "games.npz") as games:
        (pooled,) = [row for row in found["rows"] if row["attack"] == "all-games"]
        assert games["ramp:2.mean_error_m"].mean() == pytest.approx(pooled["mean_error_m"])
        assert set(games["ramp:2.attack"][0]) <= {"none", "ramp:2"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--only"], "--only leaves everybody out but the defenders that --defender names"),
        (["--only", "--defender", "snapshot/exclude", "--attack", "rmap:1"], "unknown attack 'rmap': did you mean"),
        (["--games", "x.csv"], "a file of games ends in .npz, got 'x.csv'"),
        (["--attack", "ramp:1", "--population", "training"], "not allowed with argument --attack"),
    ],
)
def test_what_does_not_fit_is_told_before_anything_is_played(arguments, words, capsys):
    try:
        status = evaluate_defenders.main(arguments)
    except SystemExit as ended:
        status = ended.code
    assert status == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line


def test_what_was_played_is_shown_after_ctrl_c(monkeypatch, capsys):
    def interrupted(self, attack, name=""):
        if name == "random":
            raise KeyboardInterrupt
        return played(self, attack, name)

    played = Evaluation._score
    monkeypatch.setattr(Evaluation, "_score", interrupted)
    assert evaluate_spoofers.main(["--scenario", FLIGHT, "--episodes", "8"]) == 130
    printed = capsys.readouterr()
    assert "none" in printed.out
    assert "closed-form" not in printed.out
    assert printed.err == "interrupted\n"
