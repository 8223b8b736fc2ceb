"""What the programs that evaluate do with a report: table, JSON and figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console, RenderableType

from spoofgym.command_line import STDOUT
from spoofgym.console import show
from spoofgym.policies.learned import LearnedSpoofer
from spoofgym.policies.published import policy_folder
from spoofgym.program import do_all, give_json

Output = tuple[str, Path | None, Callable[[Path], object]]
"""What it shows, the file that was asked for, and what writes it."""


def give(
    report: dict[str, Any], table: RenderableType, json: str | Path | None, terminal: Console, outputs: Sequence[Output]
) -> None:
    """Give a report: the table, then JSON and figures where they are asked for; if one fails, the others are given.

    Args:
        report: the JSON content.
        table: for the terminal.
        json: file, ``-`` for stdout, or None.
        terminal: where the table and the names of the files go.
        outputs: other files that the program can write.
    """
    asked = [(what, path, write) for what, path, write in outputs if path is not None]
    do_all(
        lambda: show(terminal, table),
        lambda: give_json(report, json),
        *(partial(write, path) for _, path, write in asked),
    )
    for what, path in (("rows", json), *((what, path) for what, path, _ in asked)):
        if path is not None and path != STDOUT:
            terminal.print(f"{what} in {path}", soft_wrap=True)


def spoofers(given: Sequence[str], shadow: str | None) -> list[LearnedSpoofer]:
    """The learned spoofers that ``--attacker`` names, with the shadow filter that ``--shadow`` names.

    Raises:
        ValueError: a policy that is unknown or no spoofer, or a shadow for nobody.
        FileNotFoundError: a folder that holds no policy.
    """
    if shadow is not None and not given:
        raise ValueError("--shadow replaces the shadow filter of learned spoofers: it goes with --attacker")
    policies = [LearnedSpoofer.load(policy_folder(text)) for text in given]
    return policies if shadow is None else [policy.with_shadow(shadow) for policy in policies]
