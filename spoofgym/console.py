"""Where programs print: tables as wide as they are, unless a terminal is narrower."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager, nullcontext
from copy import copy

from rich.console import Console, Group, RenderableType
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from spoofgym.patience import Telling

UNLIMITED = 10_000
"""Columns of an output that is no terminal: nothing is wrapped or cut, unless ``COLUMNS`` says how wide it is."""

NARROW_NAME = 14
"""Columns to which the names of a table are folded where the table is too wide for the terminal."""


class PlainConsole(Console):
    """A console that leaves text as it is, and a closed pipe to the program."""

    _told: Telling | None = None

    def progress(self, text: str) -> AbstractContextManager[object]:
        """Tell on stderr what goes on while the context lasts: a spinner on a terminal, else a line now and then."""
        if self.quiet:
            return nullcontext()
        terminal = Console(stderr=True)
        if terminal.is_terminal:
            return terminal.status(Text(text))
        self._told = self._told or Telling()
        return self._told.part(text)

    def on_broken_pipe(self) -> None:
        """The program ends as any other whose reader has gone.

        Raises:
            BrokenPipeError: always.
        """
        raise BrokenPipeError


def console(stderr: bool = False) -> PlainConsole:
    """A console on stdout or stderr on which brackets in names are no markup."""
    result = PlainConsole(stderr=stderr, markup=False, highlight=False, emoji=False)
    if not result.is_terminal and not os.environ.get("COLUMNS", "").isdigit():
        result.width = UNLIMITED
    return result


def show(terminal: Console, what: RenderableType) -> None:
    """Print a table, a text or a group of them, and leave nothing out.

    A table that is too wide for the terminal has the names in its first column folded. If it is still too wide, its
    lines go on in the next line of the terminal: a figure is never cut. On an output that is no terminal, the title and
    the caption of a table take one line each.
    """
    for part in what.renderables if isinstance(what, Group) else [what]:
        if isinstance(part, Table):
            _show_table(terminal, part)
        else:
            terminal.print(part, soft_wrap=isinstance(part, str))  # a line of text is copied as one line


def _show_table(terminal: Console, table: Table) -> None:
    if terminal.is_terminal:
        _show_rows(terminal, table)
        return
    rows = copy(table)  # a table folds its title and caption to its own width
    rows.title = rows.caption = None
    if table.title is not None:
        terminal.print(table.title)
    _show_rows(terminal, rows)
    if table.caption is not None:
        terminal.print(table.caption)


def _show_rows(terminal: Console, table: Table) -> None:
    given = terminal.width
    if _natural_width(terminal, table) > given:
        table.columns[0].max_width, table.columns[0].no_wrap = NARROW_NAME, False
        table.columns[0].overflow = "fold"
    terminal.width = max(given, _natural_width(terminal, table))
    try:
        terminal.print(table)
    finally:
        terminal.width = given


def _natural_width(terminal: Console, table: Table) -> int:
    return Measurement.get(terminal, terminal.options.update(max_width=UNLIMITED), table).maximum
