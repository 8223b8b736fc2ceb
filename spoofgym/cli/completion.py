"""Tab completion of the command ``spoofgym``, where argcomplete is installed (extra ``spoofgym[completion]``).

A shell asks, with ``eval "$(register-python-argcomplete spoofgym)"`` in its start file. Commands are told from their
list. The options of a command and the names of parts need modules, which are imported for that command alone.
"""

from __future__ import annotations

import argparse
import os
import shlex
from collections.abc import Sequence
from contextlib import suppress

from spoofgym.cli.commands import COMMANDS, Command, find, groups

ASKED = "_ARGCOMPLETE"
"""A variable that the shell sets when it asks."""
KINDS = {"detector": "detectors", "attack": "attacks", "scenario": "scenarios", "response": "responses"}
"""The options that take a part, and what `spoofgym.cli.parts` calls these parts."""


def answer() -> None:
    """Tell the shell what may follow, and end the process; nothing where argcomplete is not installed."""
    with suppress(ImportError):
        import argcomplete

        argcomplete.autocomplete(tree(_words(os.environ.get("COMP_LINE", ""))))


def tree(words: Sequence[str]) -> argparse.ArgumentParser:
    """A parser of all commands; the one that the words name has its options, the others have none.

    Args:
        words: of the command line, after the name of the program.
    """
    found = find(words)
    asked = None if found is None else found[0]
    result = argparse.ArgumentParser(prog="spoofgym")
    result.add_argument("--version", action="store_true")
    firsts = result.add_subparsers()
    listed = groups()
    for command in COMMANDS:
        if " " not in command.words:
            _add(firsts, command.words, command, asked)
    for first, commands in listed.items():
        seconds = firsts.add_parser(first).add_subparsers()
        for command in commands:
            _add(seconds, command.words.split()[1], command, asked)
    return result


def _add(where: argparse._SubParsersAction, name: str, command: Command, asked: Command | None) -> None:
    where.add_parser(name)
    if command is asked:
        where.choices[name] = _with_names(command.parser())


def _with_names(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """The parser, whose options that take a part complete its name."""
    from spoofgym.cli.parts import REGISTRIES

    for action in parser._actions:
        if action.dest in KINDS:
            names = tuple(REGISTRIES[KINDS[action.dest]])
            action.completer = lambda names=names, **_: names  # type: ignore[attr-defined]
    return parser


def _words(line: str) -> list[str]:
    try:
        return shlex.split(line)[1:]
    except ValueError:  # a quotation that is still open
        return line.split()[1:]
