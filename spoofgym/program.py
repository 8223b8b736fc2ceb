"""What every program does alike: how it ends, and how it says why.

A mistake of the user or a failure is told in one line on stderr. The exit status is 0, 2 where the arguments are wrong
or ask for a filter that diverges, 1 where the work failed, and 130 after Ctrl-C. The library itself never calls this.

Long work is a series of reports, each with more in it than the one before. Ctrl-C ends the series: what was there then
is shown and written all the same, marked as incomplete (`last_of`, `end`). Work that keeps its parts in a folder says
so instead, and the same command goes on there (`goes_on`).
"""

from __future__ import annotations

import functools
import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, TypeVar

from spoofgym import files
from spoofgym.patience import programs_are_ours

FAILURE, USAGE, INTERRUPTED, CLOSED_PIPE = 1, 2, 130, 141
COMPLETE = "complete"
"""The key that a report has, with ``false``, where Ctrl-C came before its end."""
Report = TypeVar("Report")


class Program(Protocol):
    """A program that can be called with a command line; None = that of the process."""

    def __call__(self, arguments: Sequence[str] | None = None) -> int:
        """Run it; returns its exit status."""


def program(main: Callable[[Sequence[str] | None], int | None]) -> Program:
    """Make a function of a command line a program: exceptions become one line and an exit status.

    An error of another kind than those below is a fault of the program and keeps its traceback.
    """

    @functools.wraps(main)
    def entry(arguments: Sequence[str] | None = None) -> int:
        _print_everything()
        programs_are_ours()
        try:
            try:
                return main(arguments) or 0
            finally:
                if sys.stdout is not None:
                    sys.stdout.flush()  # a full disk or a closed pipe shows here, not when the interpreter ends
        except KeyboardInterrupt:
            say("interrupted")
            return INTERRUPTED
        except BrokenPipeError:
            _leave_stdout()
            return CLOSED_PIPE
        except (ValueError, ArithmeticError, FileNotFoundError) as error:
            say(f"error: {_words(error)}")
            return USAGE
        except OSError as error:
            _leave_stdout()
            say(f"error: {_words(error)}")
            return FAILURE
        except (RuntimeError, ImportError, MemoryError) as error:
            say(f"error: {_words(error)}")
            return FAILURE

    return entry


def quiet_start() -> None:
    """Let Ctrl-C end a program in one line, even while it is still importing.

    For packages of programs. It acts only while Python looks for the module of ``python -m``: the first argument of the
    process shows that.
    """
    if sys.argv[:1] == ["-m"]:
        sys.excepthook = _end_of_start


def _end_of_start(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    if not issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, error, trace)
        return
    say("interrupted")
    os._exit(INTERRUPTED)  # the interpreter would kill itself by the signal and give another status


def moved(new: str) -> int:
    """Say where a command has gone; returns the exit status.

    Args:
        new: how it is called now.
    """
    say(f"error: this command has moved: {new}")
    return USAGE


def say(text: str) -> None:
    """One line to stderr, however many the text has."""
    print(" ".join(text.split()), file=sys.stderr, flush=True)


def incomplete(report: Mapping[str, Any]) -> dict[str, Any]:
    """The report of work that was stopped."""
    return {**report, COMPLETE: False}


def last_of(reports: Iterable[Report], stopped: Callable[[Any], Any] = incomplete) -> Report:
    """The last of a series of reports; where Ctrl-C ends the series, the last that was there, marked as incomplete.

    Args:
        reports: each has more in it than the one before; at least one.
        stopped: marks a report as incomplete.

    Raises:
        KeyboardInterrupt: before there was any.
    """
    series, found = iter(reports), []
    try:
        for report in series:
            found = [report]
    except KeyboardInterrupt:
        if not found:
            raise
        return stopped(found[0])
    return found[0]


def is_complete(report: Mapping[str, Any]) -> bool:
    """Whether a report holds all that was asked for."""
    return report.get(COMPLETE) is not False


@contextmanager
def goes_on(folder: str | Path) -> Iterator[None]:
    """Say after Ctrl-C that what is finished is kept in a folder, from which the same command goes on.

    Raises:
        KeyboardInterrupt: as it came.
    """
    try:
        yield
    except KeyboardInterrupt:
        say(f"what is finished is kept in {folder}: the same command goes on")
        raise


def do_all(*steps: Callable[[], object]) -> None:
    """Take every step, though one fails: a full disk or a closed pipe must not cost what goes elsewhere.

    Raises:
        Exception: the first failure, when all steps are done.
    """
    failures = []
    for step in steps:
        try:
            step()
        except Exception as error:
            failures.append(error)
    if failures:
        raise failures[0]


def give_json(report: Any, destination: str | Path | None) -> None:
    """Give a report as JSON: to stdout where the destination is ``-``, else to a file; None = nowhere.

    Raises:
        ValueError: a number that is not finite.
        OSError: the file cannot be written.
    """
    if destination is None:
        return
    if str(destination) == "-":
        print(json.dumps(report, allow_nan=False), flush=True)
    else:
        files.write_json(destination, report)


def _words(error: BaseException) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename is not None else error.strerror
    return str(error) or type(error).__name__


def _print_everything() -> None:
    """A character that the terminal does not have is printed as a question mark, and no error."""
    reconfigure = getattr(sys.stdout, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(errors="replace")


def _leave_stdout() -> None:
    """Write nothing more to a stdout that fails: the interpreter would try again when it ends."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
