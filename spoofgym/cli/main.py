# PYTHON_ARGCOMPLETE_OK
"""The command ``spoofgym``: finds the command that is called and lets it do its work.

spoofgym --help
spoofgym COMMAND --help
spoofgym evaluate spoofers --attacker runs/x
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from shutil import get_terminal_size

import spoofgym
from spoofgym.cli.commands import COMMANDS, SECTIONS, Command, find, groups
from spoofgym.cli.completion import ASKED, answer
from spoofgym.program import USAGE, program, say
from spoofgym.validation import nearest

NAME = "spoofgym"
VERSION = "--version"
HELP = ("-h", "--help", "help")
EXAMPLES = (
    "spoofgym list attacks",
    "spoofgym play --scenario foi-drive --attack ramp:0.5 --response exclude",
    "spoofgym evaluate spoofers --attack ramp:0.2 --episodes 2000",
)
STUDY = "study"
WIDTH = max(len(command.words) for command in COMMANDS if not command.words.startswith(STUDY))
GAP = 2
"""Blanks between a name and what is told of it."""
MOST_COLUMNS = 100
LEAST_TOLD = 24
"""Columns: where a terminal leaves less for what is told, that goes into the next line."""


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command ``spoofgym``; returns its exit status."""
    if ASKED in os.environ:
        answer()
    given = list(sys.argv[1:] if arguments is None else arguments)
    found = find(given)
    if found is not None:
        command, length = found
        return command.main(given[length:])
    first = given[0] if given else ""
    if first in ("", *HELP):
        print(overview())
        return 0
    if first == VERSION:
        print(f"{NAME} {spoofgym.__version__}")
        return 0
    group = groups().get(first)
    if group is None:
        return _refuse(first, [*(command.words.split()[0] for command in COMMANDS), VERSION], NAME)
    if len(given) > 1 and given[1] in HELP:
        print(overview_of(first, group))
        return 0
    seconds = [command.words.split()[1] for command in group]
    return _refuse(given[1] if len(given) > 1 else "", seconds, f"{NAME} {first}")


def _refuse(given: str, valid: Sequence[str], before: str) -> int:
    """Tell in one line that no command is called so."""
    names = list(dict.fromkeys(valid))
    if given:
        say(f"error: {before}: no command {given!r}{nearest(given, names) or ';'} there are: {', '.join(names)}")
    else:
        say(f"error: {before} needs one more word: {', '.join(names)}")
    return USAGE


def overview() -> str:
    """The help text of the whole: all commands by their sections."""
    lines = [f"usage: {NAME} COMMAND [OPTIONS]", "", *_folded("GNSS spoofing as a game on a real INS/GNSS filter.", 0)]
    for title, commands in SECTIONS.items():
        lines += ["", f"{title}:", *(line for words, told in _listed(commands) for line in _row(words, told, WIDTH))]
    lines += ["", "options:", *_row(VERSION, "the version", WIDTH)]
    lines += _row("COMMAND --help", "options of a command, with examples", WIDTH)
    return "\n".join([*lines, "", "examples:", *(f"  {line}" for line in EXAMPLES)])


def overview_of(first: str, commands: Sequence[Command]) -> str:
    """The help text of the commands that begin with one word."""
    width = max(len(command.words) for command in commands)
    rows = [line for command in commands for line in _row(command.words, command.told, width)]
    example = f"  {NAME} {commands[0].words} --help"
    return "\n".join([f"usage: {NAME} {first} COMMAND [OPTIONS]", "", *rows, "", "examples:", example])


def _listed(commands: Sequence[Command]) -> list[tuple[str, str]]:
    """The rows of a section; all studies share one."""
    rows = {command.words: command.told for command in commands if not command.words.startswith(f"{STUDY} ")}
    if len(rows) < len(commands):
        rows[f"{STUDY} NAME"] = f"smaller studies; {NAME} {STUDY} --help lists them"
    return list(rows.items())


def _row(name: str, told: str, width: int) -> list[str]:
    """A name and what is told of it, side by side where the terminal is wide enough."""
    place = 2 + width + GAP
    if _columns() - place < LEAST_TOLD:
        return [f"  {name}", *_folded(told, 6)]
    first, *rest = _folded(told, place)
    return [f"  {name:<{width}}{' ' * GAP}{first.lstrip()}", *rest]


def _folded(text: str, indent: int) -> list[str]:
    import textwrap

    blanks = " " * indent
    return textwrap.wrap(text, _columns(), initial_indent=blanks, subsequent_indent=blanks)


def _columns() -> int:
    return min(get_terminal_size().columns, MOST_COLUMNS)
