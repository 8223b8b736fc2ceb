"""Checks of single numbers.

Every number has a least and a largest value. Far beyond anything that navigates, they keep squares and sums finite and
memories in bounds.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from spoofgym.validation.messages import limit, message

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
        raise ValueError(message(owner, name, wanted, value))
    return _within(owner, name, wanted, number, 0.0, largest)


def zero_or_above(owner: str, name: str, value: Any, largest: float = LARGEST) -> float:
    """The value as zero, or as a finite number of `SMALLEST` or more: one that divides where it is not zero.

    Raises:
        ValueError: it is not.
    """
    number = non_negative(owner, name, value, largest)
    return above(owner, name, number, largest=largest) if number else 0.0


def above(owner: str, name: str, value: Any, bound: float = 0.0, largest: float = LARGEST) -> float:
    """The value as a finite number greater than ``bound``, by `SMALLEST` at least.

    Raises:
        ValueError: it is ``bound`` or less, not a finite number, or greater than ``largest``.
    """
    wanted = f"a finite number greater than {limit(bound)}"
    number = _real(owner, name, value, wanted)
    if number <= bound:
        raise ValueError(message(owner, name, wanted, value))
    return _within(owner, name, wanted, number, bound + SMALLEST, largest)


def between(owner: str, name: str, value: Any, least: float, largest: float) -> float:
    """The value as a number from ``least`` to ``largest``.

    Raises:
        ValueError: it is not.
    """
    wanted = f"a finite number{' greater than 0' if least > 0.0 else ''}"
    number = _real(owner, name, value, wanted)
    if least > 0.0 >= number:
        raise ValueError(message(owner, name, wanted, value))
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
        raise ValueError(message(owner, name, wanted, value))
    return _within(owner, name, wanted, number, LEAST_PROBABILITY, 1.0)


def share(owner: str, name: str, value: Any) -> float:
    """The value as a number from 0 to 1.

    Raises:
        ValueError: it is not.
    """
    number = _real(owner, name, value, "a share from 0 to 1")
    if not 0.0 <= number <= 1.0:
        raise ValueError(message(owner, name, "a share from 0 to 1", value))
    return number


def whole(owner: str, name: str, value: Any, least: int, most: int = int(LARGEST)) -> int:
    """The value as a whole number from ``least`` to ``most``.

    Raises:
        ValueError: it is less or more, or not a whole number.
    """
    wanted = f"a whole number, {least} or more"
    number = _real(owner, name, value, wanted)
    if number != int(number) or number < least:
        raise ValueError(message(owner, name, wanted, value))
    if number > most:
        raise ValueError(message(owner, name, f"{wanted}, {most} at most", value))
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
    raise ValueError(message(owner, name, "a non-negative integer or None", value))


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
        raise ValueError(message(owner, name, wanted, given))
    return number


def _within(owner: str, name: str, wanted: str, number: float, least: float, largest: float) -> float:
    """The number, if it lies within the limits that every number has."""
    if not least <= number <= largest:
        raise ValueError(message(owner, name, f"{wanted}, from {limit(least)} to {limit(largest)}", number))
    return number
