"""Checks of several numbers at once."""

from __future__ import annotations

from typing import Any

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.validation.messages import message
from spoofgym.validation.numbers import above, finite


def floats(owner: str, name: str, values: Any) -> Floats:
    """The values, of any shape, as finite numbers.

    Raises:
        ValueError: one is no finite number.
    """
    array = real_array(values)
    if array is None or not np.all(np.isfinite(array)):
        raise ValueError(message(owner, name, "finite numbers", values))
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


def non_negatives(owner: str, name: str, values: Any) -> Floats:
    """The values, of any shape, as finite numbers of zero or more.

    Raises:
        ValueError: one is negative or no finite number.
    """
    array = floats(owner, name, values)
    if not np.all(array >= 0.0):
        raise ValueError(message(owner, name, "numbers, 0 or more", float(np.min(array))))
    return array


def triple(owner: str, name: str, values: Any, axes: str = "E, N, U") -> tuple[float, float, float]:
    """The values as three finite numbers, one for each axis.

    Raises:
        ValueError: they are not.
    """
    wanted = f"three numbers ({axes})"
    array = real_array(values)
    if array is None or array.shape != (3,):
        raise ValueError(message(owner, name, wanted, values))
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
        raise ValueError(message(owner, name, f"finite numbers of shape {shapes}", values))
    if not np.isfinite(array).all():
        raise ValueError(message(owner, name, "finite numbers", values))
    return array.astype(np.float64, copy=False)


def span(owner: str, name: str, values: Any) -> tuple[float, float]:
    """The values as two finite numbers greater than zero, the least first.

    Raises:
        ValueError: they are not.
    """
    wanted = "two positive numbers, least first"
    array = real_array(values)
    if array is None or array.shape != (2,):
        raise ValueError(message(owner, name, wanted, values))
    low, high = (above(owner, name, value) for value in array.tolist())
    if high < low:
        raise ValueError(message(owner, name, wanted, values))
    return low, high
