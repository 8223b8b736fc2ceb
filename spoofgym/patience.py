"""Says on stderr what takes long, after a few seconds: to a person at a terminal, and to whoever runs our programs.

A library that compiles or calibrates for a minute without a word looks broken. Where nobody looks (stderr is no
terminal, and the program is somebody else's) nothing is said, nor with ``SPOOFGYM_QUIET=1``.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

QUIET = "SPOOFGYM_QUIET"
EVERY = 30.0
"""Seconds between two lines about what goes on."""
AFTER = 3.0
"""Seconds of work after which it is named."""


class _Who:
    """Whose program this process is."""

    ours = False


def programs_are_ours() -> None:
    """From now on somebody reads stderr, terminal or not: a program of the package runs."""
    _Who.ours = True


def heard() -> bool:
    """Whether somebody reads what is said."""
    if os.environ.get(QUIET, "") not in ("", "0") or sys.stderr is None:
        return False
    return _Who.ours or sys.stderr.isatty()


@contextmanager
def long_work(what: str) -> Iterator[None]:
    """Name a piece of work that is still going on after `AFTER` seconds.

    Args:
        what: it does, and whether it will be done again.
    """
    if not heard():
        yield
        return
    timer = threading.Timer(AFTER, _say, (what,))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


class Telling:
    """Names the parts of long work, at most one line every `EVERY` seconds: what a spinner is on a terminal."""

    def __init__(self) -> None:
        """The work begins now."""
        self._begun = self._told = time.monotonic()

    @contextmanager
    def part(self, what: str) -> Iterator[None]:
        """A part of the work, as long as the context lasts.

        Args:
            what: is done.
        """
        if not heard():
            yield
            return
        done = threading.Event()
        thread = threading.Thread(target=self._tell, args=(what, done), daemon=True)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()

    def _tell(self, what: str, done: threading.Event) -> None:
        while not done.wait(max(0.0, self._told + EVERY - time.monotonic())):
            self._told = time.monotonic()
            _say(f"{self._told - self._begun:.0f} s so far, now: {what}")


class Compiling:
    """Adds up what is compiled one piece after the other, and says so once when it has taken `AFTER` seconds."""

    def __init__(self, what: str) -> None:
        """Say ``what``."""
        self._what, self._begun, self._spent, self._said = what, 0.0, 0.0, False

    def begin(self) -> None:
        """A piece is compiled from now on; another one may begin within it."""
        self._begun = time.monotonic()
        if not self._said and self._spent > AFTER and heard():
            self._said = True
            _say(self._what)

    def end(self) -> None:
        """The piece has been compiled."""
        if self._begun:
            self._spent += time.monotonic() - self._begun
            self._begun = 0.0


def _say(what: str) -> None:
    print(f"spoofgym: {what}", file=sys.stderr, flush=True)
