"""Scenarios that were built from their texts, kept as long as their arrays need little memory."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable
from typing import Any

import numpy as np

from spoofgym.scenario import Scenario

LIMIT = 256 * 2**20
"""Bytes of arrays that all kept scenarios have together: some sixty of the flights, or a long log."""


class ScenarioCache:
    """The scenarios that were used last.

    A scenario grows while it is used, since it keeps the models that it has computed. Sizes are therefore measured anew
    whenever a scenario is added.
    """

    def __init__(self, limit: int = LIMIT) -> None:
        """An empty cache.

        Args:
            limit: bytes of arrays from which the scenarios that were used longest ago are dropped; the newest one stays
                whatever its size.
        """
        self._limit = limit
        self._kept: OrderedDict[Hashable, Scenario] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], Scenario]) -> Scenario:
        """The scenario of this key; it is made where there is none."""
        if key not in self._kept:
            made = make()
            self._kept[key] = made
            self._shrink()
            return made
        self._kept.move_to_end(key)
        return self._kept[key]

    def _shrink(self) -> None:
        while len(self._kept) > 1 and array_bytes(self._kept.values()) > self._limit:
            self._kept.popitem(last=False)


def array_bytes(objects: Iterable[object]) -> int:
    """Bytes of all arrays that these objects hold, in their attributes and containers; each array counts once."""
    pending, seen, total = list(objects), set[int](), 0
    while pending:
        item = pending.pop()
        while isinstance(item, np.ndarray) and isinstance(item.base, np.ndarray):
            item = item.base
        if id(item) in seen:
            continue
        seen.add(id(item))
        if isinstance(item, np.ndarray):
            total += item.nbytes
        else:
            pending += _parts(item)
    return total


def _parts(item: Any) -> Iterable[object]:
    if isinstance(item, dict):
        return item.values()
    if isinstance(item, (list, tuple, set, frozenset)):
        return item
    if isinstance(item, type) or callable(item):
        return ()
    return getattr(item, "__dict__", {}).values()
