"""Checks of arguments, with one form of message: who, which argument, what is valid, what came.

Every number has a least and a largest value. Far beyond anything that navigates, they keep squares and sums finite and
memories in bounds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from spoofgym.arrays import Floats

LARGEST = 1e9
"""Of a quantity, in its unit: metres, metres per second, seconds, sigma."""
SMALLEST = 1e-9
"""Of a quantity that must be greater than zero, in its unit."""
LATEST = 1e12
"""Of a time on a clock, s; Unix times are 1.7e9."""
LONGEST = 10_000
"""Of a memory of past epochs; half an hour at 5 Hz."""
LONGEST_TABLE = 1_000
"""Of a memory whose epochs each take a table of the scenario's length, or a filter's covariance."""
MOST_RUNS = 1_000_000
LONGEST_ARL0 = 1e15
LEAST_PROBABILITY = 1e-300
MOST_LETTERS = 100
"""Of a value in a message."""


# --- numbers ----------------------------------------------------------------------------------------------------------


def finite(owner: str, name: str, value: Any, largest: float = LARGEST) -> float:
    """The value as a finite number of at most ``largest``, of either sign.

    Raises:
        ValueError: it is not.
    """
    return _within(owner, name, "a finite number", _real(owner, name, value, "a finite number"), -largest, largest)


def time(owner: str, name: str, value: Any) -> float:
    """The value as a time on a clock, s.

    Raises:
        ValueError: it is not a finite number of at most `LATEST`.
    """
    return finite(owner, name, value, LATEST)


def non_negative(owner: str, name: str, value: Any, largest: float = LARGEST) -> float:
    """The value as a finite number of zero or more.

    Raises:
        ValueError: it is negative, not a finite number, or greater than ``largest``.
    """
    wanted = "a finite number, 0 or more"
    number = _real(owner, name, value, wanted)
    if number < 0.0:
        raise ValueError(_message(owner, name, wanted, value))
    return _within(owner, name, wanted, number, 0.0, largest)


def zero_or_above(owner: str, name: str, value: Any, largest: float = LARGEST) -> float:
    """The value as zero, or as a finite number of `SMALLEST` or more: one that divides where it is not zero.

    Raises:
        ValueError: it is not.
    """
    number = non_negative(owner, name, value, largest)
    return above(owner, name, number, largest=largest) if number else 0.0


def non_negatives(owner: str, name: str, values: Any) -> Floats:
    """The values, of any shape, as finite numbers of zero or more.

    Raises:
        ValueError: one is negative or no finite number.
    """
    array = floats(owner, name, values)
    if not np.all(array >= 0.0):
        raise ValueError(_message(owner, name, "numbers, 0 or more", float(np.min(array))))
    return array


def above(owner: str, name: str, value: Any, bound: float = 0.0, largest: float = LARGEST) -> float:
    """The value as a finite number greater than ``bound``, by `SMALLEST` at least.

    Raises:
        ValueError: it is ``bound`` or less, not a finite number, or greater than ``largest``.
    """
    wanted = f"a finite number greater than {_bound(bound)}"
    number = _real(owner, name, value, wanted)
    if number <= bound:
        raise ValueError(_message(owner, name, wanted, value))
    return _within(owner, name, wanted, number, bound + SMALLEST, largest)


def between(owner: str, name: str, value: Any, least: float, largest: float) -> float:
    """The value as a number from ``least`` to ``largest``.

    Raises:
        ValueError: it is not.
    """
    wanted = f"a finite number{' greater than 0' if least > 0.0 else ''}"
    number = _real(owner, name, value, wanted)
    if least > 0.0 >= number:
        raise ValueError(_message(owner, name, wanted, value))
    return _within(owner, name, wanted, number, least, largest)


def hour(owner: str, name: str, value: Any) -> float:
    """The value as an hour of a day, from 0 to 24.

    Raises:
        ValueError: it is not.
    """
    return between(owner, name, value, 0.0, 24.0)


def average_run_length(owner: str, name: str, value: Any) -> float:
    """The value as an ARL0, greater than 1 epoch.

    Raises:
        ValueError: it is not.
    """
    return above(owner, name, value, 1.0, LONGEST_ARL0)


def probability(owner: str, name: str, value: Any) -> float:
    """The value as a number strictly between 0 and 1.

    Raises:
        ValueError: it is not.
    """
    wanted = "greater than 0 and less than 1"
    number = _real(owner, name, value, wanted)
    if not 0.0 < number < 1.0:
        raise ValueError(_message(owner, name, wanted, value))
    return _within(owner, name, wanted, number, LEAST_PROBABILITY, 1.0)


def share(owner: str, name: str, value: Any) -> float:
    """The value as a number from 0 to 1.

    Raises:
        ValueError: it is not.
    """
    number = _real(owner, name, value, "a share from 0 to 1")
    if not 0.0 <= number <= 1.0:
        raise ValueError(_message(owner, name, "a share from 0 to 1", value))
    return number


def whole(owner: str, name: str, value: Any, least: int, most: int = int(LARGEST)) -> int:
    """The value as a whole number from ``least`` to ``most``.

    Raises:
        ValueError: it is less or more, or not a whole number.
    """
    wanted = f"a whole number, {least} or more"
    number = _real(owner, name, value, wanted)
    if number != int(number) or number < least:
        raise ValueError(_message(owner, name, wanted, value))
    if number > most:
        raise ValueError(_message(owner, name, f"{wanted}, {most} at most", value))
    return int(number)


def epochs(owner: str, name: str, value: Any, least: int = 1, most: int = LONGEST) -> int:
    """The value as the length of a memory of past epochs.

    Raises:
        ValueError: it is not a whole number from ``least`` to ``most``.
    """
    return whole(owner, name, value, least, most)


def runs(owner: str, name: str, value: Any) -> int:
    """The value as a number of runs, at least one.

    Raises:
        ValueError: it is not a whole number from 1 to `MOST_RUNS`.
    """
    return whole(owner, name, value, 1, MOST_RUNS)


def threads(owner: str, value: Any) -> int:
    """The value as a number of threads.

    Raises:
        ValueError: it is not a whole number from 1 to 1024.
    """
    return whole(owner, "threads", value, 1, 1024)


def seed(owner: str, value: Any, name: str = "seed") -> int | None:
    """The value as a seed: a whole number of any size, 0 or more, or None for fresh entropy.

    Raises:
        ValueError: it is negative, or no integer.
    """
    if value is None:
        return None
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        number = int(value)
        if number >= 0:
            return number
    raise ValueError(_message(owner, name, "a non-negative integer or None", value))


# --- other values -----------------------------------------------------------------------------------------------------


def floats(owner: str, name: str, values: Any) -> Floats:
    """The values, of any shape, as finite numbers.

    Raises:
        ValueError: one is no finite number.
    """
    array = real_array(values)
    if array is None or not np.all(np.isfinite(array)):
        raise ValueError(_message(owner, name, "finite numbers", values))
    return array.astype(np.float64, copy=False)


def real_array(values: Any) -> np.ndarray | None:
    """The values as an array of real numbers as they are; None where they are no such array.

    Text, truth values, complex numbers, objects and masked numbers are no real numbers.
    """
    if type(values) is np.ndarray and values.dtype.kind == "f":
        return values
    if np.ma.is_masked(values):
        return None
    try:
        array = np.asarray(values)
    except (TypeError, ValueError, OverflowError, RuntimeError):
        return None
    return array if array.dtype.kind in "fiu" else None


def triple(owner: str, name: str, values: Any, axes: str = "E, N, U") -> tuple[float, float, float]:
    """The values as three finite numbers, one for each axis.

    Raises:
        ValueError: they are not.
    """
    wanted = f"three numbers ({axes})"
    array = real_array(values)
    if array is None or array.shape != (3,):
        raise ValueError(_message(owner, name, wanted, values))
    first, second, third = (finite(owner, name, value) for value in array.tolist())
    return first, second, third


def rows(owner: str, name: str, values: Any, count: int, widths: tuple[int, ...]) -> Floats:
    """The values as finite numbers, a row for each run; cheap enough for every step.

    Args:
        owner: whose argument.
        name: of the argument.
        values: that were given.
        count: rows there must be.
        widths: numbers that a row may hold.

    Raises:
        ValueError: they are not.
    """
    array = real_array(values)
    if array is None or array.ndim != 2 or len(array) != count or array.shape[1] not in widths:
        shapes = " or ".join(f"({count}, {width})" for width in widths)
        raise ValueError(_message(owner, name, f"finite numbers of shape {shapes}", values))
    if not np.isfinite(array).all():
        raise ValueError(_message(owner, name, "finite numbers", values))
    return array.astype(np.float64, copy=False)


def span(owner: str, name: str, values: Any) -> tuple[float, float]:
    """The values as two finite numbers greater than zero, the least first.

    Raises:
        ValueError: they are not.
    """
    wanted = "two positive numbers, least first"
    array = real_array(values)
    if array is None or array.shape != (2,):
        raise ValueError(_message(owner, name, wanted, values))
    low, high = (above(owner, name, value) for value in array.tolist())
    if high < low:
        raise ValueError(_message(owner, name, wanted, values))
    return low, high


def boolean(owner: str, name: str, value: Any) -> bool:
    """The value as True or False.

    Raises:
        ValueError: it is something else, though it be 0 or 1.
    """
    if not isinstance(value, bool | np.bool_):
        raise ValueError(_message(owner, name, "True or False", value))
    return bool(value)


def text(owner: str, name: str, value: Any) -> str:
    """The value, which is a text of at least one letter.

    Raises:
        ValueError: it is not.
    """
    if not isinstance(value, str) or not value:
        raise ValueError(_message(owner, name, "a text that is not empty", value))
    return value


def one_of(owner: str, name: str, value: Any, valid: tuple[str, ...]) -> str:
    """The value, which is one of the valid names.

    Raises:
        ValueError: it is not.
    """
    if not isinstance(value, str) or value not in valid:
        raise ValueError(_message(owner, name, f"one of {', '.join(valid)}", value))
    return str(value)


def instance(owner: str, name: str, value: Any, kind: type, wanted: str) -> None:
    """Refuse a value that is no object of a class.

    Raises:
        TypeError: it is not; the message says what is ``wanted``.
    """
    if not isinstance(value, kind):
        raise TypeError(_message(owner, name, wanted, value))


def at_most_one(owner: str, **options: object) -> None:
    """Of options that exclude each other, no more than one is given (is not None).

    Raises:
        ValueError: two or more are given.
    """
    given = [name for name, value in options.items() if value is not None]
    if len(given) > 1:
        raise ValueError(f"{owner}: give at most one of {', '.join(options)}; got {' and '.join(given)}")


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


# --- messages ---------------------------------------------------------------------------------------------------------


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


def _real(owner: str, name: str, value: Any, wanted: str) -> float:
    given = value
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    number = math.nan
    if isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:  # an integer of hundreds of digits
            number = math.inf
    if not math.isfinite(number):
        raise ValueError(_message(owner, name, wanted, given))
    return number


def _within(owner: str, name: str, wanted: str, number: float, least: float, largest: float) -> float:
    """The number, if it lies within the limits that every number has."""
    if not least <= number <= largest:
        raise ValueError(_message(owner, name, f"{wanted}, from {_bound(least)} to {_bound(largest)}", number))
    return number


def _bound(number: float) -> str:
    """A limit: round ones as a power of ten."""
    return f"{number:g}" if float(f"{number:g}") == number else written(number)


def _message(owner: str, name: str, wanted: str, value: object) -> str:
    return f"{owner}: {name} must be {wanted}, got {shown(value)}"
