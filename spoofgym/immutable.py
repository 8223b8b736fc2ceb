"""What is built once and never changed: copies of the objects that hold it share it."""

from __future__ import annotations

from typing import Any


class Immutable:
    """A scenario or a model: large, and never written after it was built.

    A deep copy of an environment holds the same ones as the environment, so that it is cheap, and what is remembered of
    a scenario by its identity (its models, thresholds calibrated on it) stays known. A pickle holds all of it.
    """

    def __deepcopy__(self, memo: dict[int, Any]) -> Immutable:
        """Itself."""
        return self
