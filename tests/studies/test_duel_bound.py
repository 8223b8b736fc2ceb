"""The program that bounds the duel from below."""

import json

import pytest

from spoofgym.studies import duel_bound

SHORT = "liu-flight:horizon=20"


def test_it_tells_both_payoffs(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(duel_bound, "DRIFTS", (2.0,))
    monkeypatch.setattr(duel_bound, "UNSEEN", (3.0,))
    file = tmp_path / "bound.json"
    arguments = ["--scenario", SHORT, "--payoff", "error", "--payoff", "beyond:2", "--games", "8", "--json", str(file)]
    assert duel_bound.main(arguments) == 0
    report = json.loads(file.read_text())
    assert [row["payoff"] for row in report["rows"]] == ["error", "beyond:2"]
    for row in report["rows"]:
        assert row["ci95"][0] < row["value"] < row["ci95"][1]
        assert sum(row["shares"].values()) == pytest.approx(1.0)
    shown = capsys.readouterr().out
    assert "no defender keeps the mean payoff below" in shown
    assert "beyond:2" in shown


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--payoff", "speed"], "speed"),
        (["--payoff", "beyond"], "limit"),
        (["--payoff", "error:-1"], "cap must be"),
        (["--scenario", "song-robot"], "needs inertial solution"),
    ],
)
def test_bad_input_is_one_line(arguments, message, capsys):
    assert duel_bound.main(["--games", "4", *arguments]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert message in lines[0]
