"""Checks of what is no number: truth values, texts, names, objects, and options that exclude each other."""

from __future__ import annotations

from typing import Any

import numpy as np

from spoofgym.validation.messages import message, nearest


def boolean(owner: str, name: str, value: Any) -> bool:
    """The value as True or False.

    Raises:
        ValueError: it is something else, though it be 0 or 1.
    """
    if not isinstance(value, bool | np.bool_):
        raise ValueError(message(owner, name, "True or False", value))
    return bool(value)


def text(owner: str, name: str, value: Any) -> str:
    """The value, which is a text of at least one letter.

    Raises:
        ValueError: it is not.
    """
    if not isinstance(value, str) or not value:
        raise ValueError(message(owner, name, "a text that is not empty", value))
    return value


def one_of(owner: str, name: str, value: Any, valid: tuple[str, ...]) -> str:
    """The value, which is one of the valid names.

    Raises:
        ValueError: it is not.
    """
    if not isinstance(value, str) or value not in valid:
        close = nearest(value, valid) if isinstance(value, str) else ""
        raise ValueError(message(owner, name, f"one of {', '.join(valid)}", value) + close)
    return str(value)


def instance(owner: str, name: str, value: Any, kind: type, wanted: str) -> None:
    """Refuse a value that is no object of a class.

    Raises:
        TypeError: it is not; the message says what is ``wanted``.
    """
    if not isinstance(value, kind):
        raise TypeError(message(owner, name, wanted, value))


def at_most_one(owner: str, **options: object) -> None:
    """Of options that exclude each other, no more than one is given (is not None).

    Raises:
        ValueError: two or more are given.
    """
    given = [name for name, value in options.items() if value is not None]
    if len(given) > 1:
        raise ValueError(f"{owner}: give at most one of {', '.join(options)}; got {' and '.join(given)}")
