"""What an evaluation tells while it runs: the name of each part of the work, as long as it lasts."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

Progress = Callable[[str], AbstractContextManager[object]]
"""Shows a text as long as the context lasts, as `rich.console.Console.status` does."""


def silent(text: str) -> AbstractContextManager[None]:
    """Show nothing."""
    return nullcontext()
