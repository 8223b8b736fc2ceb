"""Long work is named to whoever reads it, once, and to nobody else."""

import time

import pytest

from spoofgym import patience
from spoofgym.patience import Compiling, long_work


@pytest.fixture(autouse=True)
def heard(monkeypatch):
    monkeypatch.setenv("SPOOFGYM_QUIET", "")
    monkeypatch.setattr(patience, "AFTER", 0.0)
    monkeypatch.setattr(patience._Who, "ours", True)


def wait_for(capsys, words, patient=10.0):
    said, end = "", time.monotonic() + patient
    while words not in said and time.monotonic() < end:
        time.sleep(0.01)
        said += capsys.readouterr().err
    return said


def test_work_that_takes_long_is_named_while_it_goes_on(capsys):
    with long_work("calibrating"):
        assert wait_for(capsys, "calibrating") == "spoofgym: calibrating\n"


def test_work_that_ends_soon_is_not_named(monkeypatch, capsys):
    monkeypatch.setattr(patience, "AFTER", 3600.0)
    with long_work("calibrating"):
        pass
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("quiet", "ours"), [("1", True), ("", False)])
def test_nobody_hears_what_nobody_reads(quiet, ours, monkeypatch, capsys):
    monkeypatch.setenv("SPOOFGYM_QUIET", quiet)
    monkeypatch.setattr(patience._Who, "ours", ours)
    assert not patience.heard()
    with long_work("calibrating"):
        time.sleep(0.05)
    assert capsys.readouterr().err == ""


def test_pieces_are_added_up_and_named_once(monkeypatch, capsys):
    monkeypatch.setattr(patience, "AFTER", 0.02)
    compiling = Compiling("compiling")
    for _ in range(4):
        compiling.begin()
        time.sleep(0.015)
        compiling.end()
    assert capsys.readouterr().err == "spoofgym: compiling\n"
