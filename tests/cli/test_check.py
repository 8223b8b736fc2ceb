"""`spoofgym check` tells what a bug report needs, and fails where a game cannot be played."""

import json

import spoofgym
from spoofgym.cli import check


def test_everything_that_is_needed_is_found(capsys):
    assert check.main([]) == 0
    text = capsys.readouterr().out
    assert spoofgym.__version__ in text
    assert text.rstrip().endswith("All that a game needs works.")
    assert max(map(len, text.splitlines())) < 200


def test_json_alone_on_stdout(capsys):
    assert check.main(["--json", "-"]) == 0
    found = {each["name"]: each for each in json.loads(capsys.readouterr().out)["findings"]}
    assert found["numba"]["state"] == "ok"
    assert found["a game is played"]["state"] == "ok"


def test_what_fails_is_told_with_its_reason_and_a_status(monkeypatch, capsys):
    def broken():
        raise OSError("no space")

    monkeypatch.setattr(check, "_play", broken)
    monkeypatch.setattr(check, "NEEDED", ("numpy", "no-such-package"))
    assert check.main([]) == 1
    text = capsys.readouterr().out
    assert "OSError: no space" in text
    assert text.rstrip().endswith("does not work: no-such-package, a game is played")
