"""What messages about arguments say: who, which argument, what is valid, what came."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

MOST_LETTERS = 100
"""Of a value in a message."""


def written(number: float) -> str:
    """A number for a message, with all its digits but those of binary rounding: 1732876800.25, 0.3, 120."""
    return f"{number:.15g}"


def shown(value: object) -> str:
    """A value for a message, cut where it is long."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # an integer of thousands of digits has no text, nor has a list within itself
        text = f"a {type(value).__name__} too long to show"
    text = " ".join(text.split())  # a table of numbers takes one line, too
    return text if len(text) <= MOST_LETTERS else f"{text[:MOST_LETTERS]}..."


def nearest(given: str, valid: Iterable[str]) -> str:
    """The end of a message about a name that is unknown: the valid one that is spelled most like it, if any is.

    Args:
        given: the unknown name.
        valid: the names that there are.

    Returns:
        ``": did you mean 'NAME'?"``, or nothing.
    """
    import difflib  # only where a name is wrong

    found = difflib.get_close_matches(given, list(valid), 1)
    return f": did you mean {found[0]!r}?" if found else ""


def limit(number: float) -> str:
    """A limit: round ones as a power of ten."""
    return f"{number:g}" if float(f"{number:g}") == number else written(number)


def message(owner: str, name: str, wanted: str, value: object) -> str:
    """That a value is not what is wanted."""
    return f"{owner}: {name} must be {wanted}, got {shown(value)}"


@contextmanager
def argument(owner: str, name: str) -> Iterator[None]:
    """Put owner and argument before the message of what the argument's parts refuse.

    Raises:
        ValueError: what was refused.
        TypeError: what was refused.
    """
    try:
        yield
    except (ValueError, TypeError) as error:
        kind = ValueError if isinstance(error, ValueError) else TypeError
        raise kind(f"{owner}: {name}: {error}") from error
