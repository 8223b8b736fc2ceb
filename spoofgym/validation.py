"""Checks of arguments, with one form of message: who, which argument, what is valid, what came."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from spoofgym.arrays import Floats


def finite(owner: str, name: str, value: Any) -> float:
    """The value as a finite number.

    Raises:
        ValueError: it is not a finite number.
    """
    return _real(owner, name, value, "a finite number", -math.inf)


def non_negative(owner: str, name: str, value: Any) -> float:
    """The value as a finite number of zero or more.

    Raises:
        ValueError: it is negative or not a finite number.
    """
    number = _real(owner, name, value, "a finite number, 0 or more", -math.inf)
    if number < 0.0:
        raise ValueError(_message(owner, name, "a finite number, 0 or more", value))
    return number


def non_negatives(owner: str, name: str, values: Any) -> Floats:
    """The values, of any shape, as numbers of zero or more.

    Raises:
        ValueError: one is negative or no number.
    """
    numbers = np.asarray(values, dtype=np.float64)
    if not np.all(numbers >= 0.0):
        raise ValueError(_message(owner, name, "numbers, 0 or more", float(np.min(numbers))))
    return numbers


def above(owner: str, name: str, value: Any, bound: float = 0.0) -> float:
    """The value as a finite number greater than ``bound``.

    Raises:
        ValueError: it is ``bound`` or less, or not a finite number.
    """
    return _real(owner, name, value, f"a finite number greater than {bound:g}", bound)


def probability(owner: str, name: str, value: Any) -> float:
    """The value as a number strictly between 0 and 1.

    Raises:
        ValueError: it is not.
    """
    number = _real(owner, name, value, "greater than 0 and less than 1", 0.0)
    if number >= 1.0:
        raise ValueError(_message(owner, name, "greater than 0 and less than 1", value))
    return number


def share(owner: str, name: str, value: Any) -> float:
    """The value as a number from 0 to 1.

    Raises:
        ValueError: it is not.
    """
    number = _real(owner, name, value, "a share from 0 to 1", -math.inf)
    if not 0.0 <= number <= 1.0:
        raise ValueError(_message(owner, name, "a share from 0 to 1", value))
    return number


def whole(owner: str, name: str, value: Any, least: int) -> int:
    """The value as a whole number of ``least`` or more.

    Raises:
        ValueError: it is less, or not a whole number.
    """
    number = _real(owner, name, value, f"a whole number, {least} or more", -math.inf)
    if number != int(number) or number < least:
        raise ValueError(_message(owner, name, f"a whole number, {least} or more", value))
    return int(number)


def one_of(owner: str, name: str, value: Any, valid: tuple[str, ...]) -> str:
    """The value, which is one of the valid names.

    Raises:
        ValueError: it is not.
    """
    if value not in valid:
        raise ValueError(_message(owner, name, f"one of {', '.join(valid)}", value))
    return str(value)


def at_most_one(owner: str, **options: object) -> None:
    """Of options that exclude each other, no more than one is given (is not None).

    Raises:
        ValueError: two or more are given.
    """
    given = [name for name, value in options.items() if value is not None]
    if len(given) > 1:
        raise ValueError(f"{owner}: give at most one of {', '.join(options)}; got {' and '.join(given)}")


def _real(owner: str, name: str, value: Any, wanted: str, bound: float) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if isinstance(value, (str, bool)) or not math.isfinite(number) or number <= bound:
        raise ValueError(_message(owner, name, wanted, value))
    return number


def _message(owner: str, name: str, wanted: str, value: object) -> str:
    return f"{owner}: {name} must be {wanted}, got {value!r}"
