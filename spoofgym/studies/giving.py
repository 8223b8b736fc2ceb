"""What programs do with a report: table, JSON and figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console, RenderableType

from spoofgym.command_line import STDOUT
from spoofgym.console import show
from spoofgym.program import do_all, give_json, is_complete

Output = tuple[str, Path | None, Callable[[Path], object]]
"""What it shows, the file that was asked for, and what writes it."""
STOPPED = "STOPPED before its end. What was finished until then:"


def give(
    report: dict[str, Any],
    table: RenderableType,
    json: str | Path | None,
    terminal: Console,
    outputs: Sequence[Output] = (),
) -> None:
    """Give a report: the table, then JSON and figures where they are asked for; if one fails, the others are given.

    A report that is incomplete is given as table and JSON, which say so, and the program ends as after Ctrl-C.

    Args:
        report: the JSON content.
        table: for the terminal.
        json: file, ``-`` for stdout, or None.
        terminal: where the table and the names of the files go.
        outputs: other files that the program can write.

    Raises:
        KeyboardInterrupt: the report is incomplete, and has been given.
    """
    whole = is_complete(report)
    if not whole:
        terminal.print(STOPPED, soft_wrap=True)
    asked = [(what, path, write) for what, path, write in outputs if path is not None]
    written = asked if whole else []
    do_all(
        lambda: show(terminal, table),
        lambda: give_json(report, json),
        *(partial(write, path) for _, path, write in written),
    )
    for what, path in (("rows", json), *((what, path) for what, path, _ in written)):
        if path is not None and path != STDOUT:
            terminal.print(f"{what} in {path}{'' if whole else ', marked as incomplete'}", soft_wrap=True)
    if not whole:
        for what, path, _ in asked:
            terminal.print(f"no {what} in {path}: it would not show everything", soft_wrap=True)
        raise KeyboardInterrupt
