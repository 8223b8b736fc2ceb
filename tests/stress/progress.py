"""How far a kind of tries has come: in one line of a terminal, or now and then in a line of a pipe or a file."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TextIO

BETWEEN = 30.0
"""Least time between two lines to an output that is no terminal, s."""


class Progress:
    """Tells how many tries of one kind are made."""

    def __init__(self, name: str, total: int, out: TextIO, clock: Callable[[], float] = time.monotonic) -> None:
        """Begin, and say so."""
        self._name, self._total, self._out, self._clock = name, total, out, clock
        self._begun = self._told = clock()
        self._write(f"0 of {total:,} tried")

    def tell(self, made: int) -> None:
        """So many tries are made."""
        now = self._clock()
        if self._out.isatty() or now - self._told >= BETWEEN:
            self._told = now
            self._write(f"{made:,} of {self._total:,} tried ({now - self._begun:.0f} s)")

    def end(self, result: str) -> None:
        """No more tries follow."""
        self._write(f"{result} ({self._clock() - self._begun:.0f} s)")
        if self._out.isatty():
            print(file=self._out, flush=True)

    def _write(self, text: str) -> None:
        """A line of its own, or in a terminal in the place of the one before."""
        line = f"{self._name}: {text}"
        if self._out.isatty():
            print(f"\r{line}\x1b[K", end="", file=self._out, flush=True)
        else:
            print(line, file=self._out, flush=True)
