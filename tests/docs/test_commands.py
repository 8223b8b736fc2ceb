"""Commands that a page tells a reader to copy: they are run, one after the other, in an empty folder for each page.

Those that take minutes, or that need something of the reader's, are only read by the parser of their program
(`test_pages.py`). The lists here say which and why.
"""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from spoofgym.cli.commands import find
from spoofgym.cli.main import main
from tests.docs.pages import commands, name, pages

MINUTES = "it plays for minutes"
TRAINS = "it trains"
ONLY_PARSED = {
    **dict.fromkeys(("train spoofer", "train defender", "train league", "exploit"), TRAINS),
    **dict.fromkeys(("benchmark", "bound bayes", "bound duel", "integrity", "matrix", "thresholds"), MINUTES),
    **dict.fromkeys(("reproduce", "study acna", "study aids", "study self-tuning", "study patient-spoofer"), MINUTES),
    **dict.fromkeys(("study fidelity-of-thresholds", "study recorded-ranges", "study delay"), MINUTES),
    **dict.fromkeys(("evaluate defenders", "study real-attacks"), MINUTES),
    "study noise": MINUTES,
}
"""Programs that no page runs in a few seconds."""
MANY_GAMES = re.compile(r"^spoofgym evaluate spoofers (?!.*--episodes \d{1,3}\b|.*--episodes 1000\b)")
"""An evaluation of spoofers that does not ask for a thousand games or less; without a word it plays 20,000."""
CALIBRATED_FOR = ("foi-drive:horizon=60,imu=tactical", "liu-flight:aids=barometer")
"""Scenarios of which a command needs thresholds that no other test does; to find them takes 20 s."""
OF_THE_READER = ("runs/", "FOLDER", "my-flight", "my_drones", ".ulg", ".zip")
"""In commands that take a training, a log or a module of the reader's."""


def can_be_run(line: str) -> bool:
    """Whether a command is cheap and needs nothing but what the page has made before."""
    if not line.startswith("spoofgym ") or any(part in line for part in (*OF_THE_READER, *CALIBRATED_FOR)):
        return False
    found = find(shlex.split(line)[1:])
    return found is not None and found[0].words not in ONLY_PARSED and not MANY_GAMES.search(line)


RUN = {path: [line for line in commands(path) if can_be_run(line)] for path in pages()}


@pytest.mark.parametrize("path", [path for path in pages() if RUN[path]], ids=name)
def test_commands_of_a_page_run(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for line in RUN[path]:
        words = shlex.split(line, comments=True)[1:]
        status = main(words)
        said = capsys.readouterr()
        assert status == 0, f"{line}: {said.err}"
        assert said.out.strip() or said.err.strip(), line
        for place, word in enumerate(words[:-1]):
            if word in ("--json", "--page", "--figure", "-o"):
                assert (tmp_path / words[place + 1]).stat().st_size > 0, line


def test_most_commands_that_could_be_run_are() -> None:
    """What is only parsed is the exception that the lists name; each entry of them is still needed."""
    lines = [line for path in pages() for line in commands(path)]
    assert sum(map(len, RUN.values())) > 25
    assert all(any(line.startswith(f"spoofgym {words}") for line in lines) for words in ONLY_PARSED)
    assert all(any(part in line for line in lines) for part in (*OF_THE_READER, *CALIBRATED_FOR))
