"""Tab completion, asked as a shell asks."""

import os
import subprocess
import sys

import pytest

from spoofgym.cli.commands import COMMANDS

pytest.importorskip("argcomplete")


def completions(line, tmp_path):
    answer = tmp_path / "answer"
    asked = {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)), "_ARGCOMPLETE_IFS": "\n"}
    asked |= {"_ARGCOMPLETE_STDOUT_FILENAME": str(answer), "COMP_TYPE": "9", "_ARGCOMPLETE_SHELL": "bash"}
    command = [sys.executable, "-m", "spoofgym"]
    subprocess.run(command, env={**os.environ, **asked}, capture_output=True, text=True, check=False)
    return [word.strip() for word in answer.read_text().split("\n")]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("spoofgym ev", ["evaluate"]),
        ("spoofgym evaluate ", ["spoofers", "defenders", "recorded"]),
        ("spoofgym tune --sc", ["--scenario"]),
        ("spoofgym thresholds --detector whit", ["whiteness"]),
    ],
)
def test_what_may_follow(line, words, tmp_path):
    assert set(completions(line, tmp_path)) - {"--help", "-h"} == set(words)


def test_every_command_is_offered(tmp_path):
    assert {command.words.split()[0] for command in COMMANDS} <= set(completions("spoofgym ", tmp_path))
