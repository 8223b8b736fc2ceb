"""Series of numbers as plain values of JSON, rounded, and back; what is read may be a stranger's.

JSON has no infinity: it is written as the text ``"inf"``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.validation import shown

INFINITE = "inf"
MOST = 1_000_000
"""Epochs of a series that is read."""


def decimals(values: Floats, digits: int = 3) -> list[Any]:
    """The values of a series (T,), rounded to so many decimals."""
    return [INFINITE if math.isinf(value) else round(value, digits) + 0.0 for value in values.tolist()]


def significant(values: Floats, digits: int = 6) -> list[Any]:
    """The values of a series (T,), rounded to so many significant digits."""
    return [INFINITE if math.isinf(value) else float(f"{value:.{digits}g}") for value in values.tolist()]


class PlainReader:
    """Reads the members of an object that JSON has given, and refuses what is not what it should be."""

    def __init__(self, owner: str, content: object) -> None:
        """Read ``content``; ``owner`` begins every message.

        Raises:
            ValueError: it is no object.
        """
        if not isinstance(content, Mapping):
            raise ValueError(f"{owner} must be a JSON object, got {shown(content)}")
        self.owner, self._content = owner, content

    def has(self, name: str) -> bool:
        """Whether there is such a member."""
        return name in self._content

    def member(self, name: str) -> Any:
        """A member as it is.

        Raises:
            ValueError: there is none.
        """
        if name not in self._content:
            raise ValueError(f"{self.owner}: {name!r} is missing")
        return self._content[name]

    def part(self, name: str) -> PlainReader:
        """A member that is an object."""
        return PlainReader(f"{self.owner}: {name!r}", self.member(name))

    def parts(self, name: str) -> list[PlainReader]:
        """A member that is a list of objects."""
        found = self.member(name)
        if not isinstance(found, list):
            raise self.wrong(name, "a list")
        return [PlainReader(f"{self.owner}: {name!r} {place}", each) for place, each in enumerate(found)]

    def text(self, name: str) -> str:
        """A member that is a text."""
        return validation.text(self.owner, name, self.member(name))

    def text_or_none(self, name: str) -> str | None:
        """A member that is a text or null."""
        return None if self.member(name) is None else self.text(name)

    def number(self, name: str) -> float:
        """A member that is a finite number."""
        return float(validation.finite(self.owner, name, self.member(name)))

    def number_or_none(self, name: str) -> float | None:
        """A member that is a finite number or null."""
        return None if self.member(name) is None else self.number(name)

    def whole(self, name: str) -> int:
        """A member that is a whole number, 0 or more."""
        return validation.whole(self.owner, name, self.member(name), 0, 2**62)

    def flag(self, name: str) -> bool:
        """A member that is true or false."""
        return validation.boolean(self.owner, name, self.member(name))

    def floats(self, name: str, length: int | None = None) -> Floats:
        """A member that is a list of numbers, (T,); infinity is allowed. ``length``: of the list; None = any."""
        found = self.member(name)
        if not isinstance(found, list) or not 0 < len(found) <= MOST or length not in (None, len(found)):
            wanted = "numbers" if length is None else f"{length} numbers"
            raise self.wrong(name, f"a list of {wanted}")
        for value in found:
            if value != INFINITE and (isinstance(value, bool) or not isinstance(value, int | float)):
                raise ValueError(f"{self.owner}: {name!r} must hold numbers, got {shown(value)}")
        values = np.array([math.inf if value == INFINITE else value for value in found], dtype=np.float64)
        if np.isnan(values).any():
            raise ValueError(f"{self.owner}: {name!r} must hold numbers, got nan")
        return values

    def counts(self, name: str, length: int) -> Runs:
        """A member that is a list of whole numbers, 0 or more, (T,)."""
        values = self.floats(name, length)
        if not np.all((values >= 0) & (values == np.floor(values)) & (values < 2**31)):
            raise ValueError(f"{self.owner}: {name!r} must hold whole numbers, 0 or more")
        return values.astype(np.int64)

    def flags(self, name: str, length: int) -> Flags:
        """A member that is a list of 0 and 1, (T,)."""
        values = self.counts(name, length)
        if values.max() > 1:
            raise ValueError(f"{self.owner}: {name!r} must hold 0 and 1")
        return values.astype(np.bool_)

    def wrong(self, name: str, wanted: str) -> ValueError:
        """That a member is not what is wanted."""
        return ValueError(f"{self.owner}: {name!r} must be {wanted}, got {shown(self.member(name))}")
