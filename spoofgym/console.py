"""Where programs print: tables as wide as they are, unless a terminal is narrower."""

from __future__ import annotations

import os
from typing import Any

from rich.console import Console, RenderableType
from rich.status import Status
from rich.text import Text

UNLIMITED = 10_000
"""Columns of an output that is no terminal: nothing is wrapped or cut, unless ``COLUMNS`` says how wide it is."""


class PlainConsole(Console):
    """A console that leaves text as it is, and a closed pipe to the program."""

    def status(self, status: RenderableType, **options: Any) -> Status:
        """A spinner beside a text."""
        return super().status(Text(status) if isinstance(status, str) else status, **options)

    def on_broken_pipe(self) -> None:
        """The program ends as any other whose reader has gone.

        Raises:
            BrokenPipeError: always.
        """
        raise BrokenPipeError


def console(stderr: bool = False) -> Console:
    """A console on stdout or stderr on which brackets in names are no markup."""
    result = PlainConsole(stderr=stderr, markup=False, highlight=False, emoji=False)
    if not result.is_terminal and not os.environ.get("COLUMNS", "").isdigit():
        result.width = UNLIMITED
    return result
