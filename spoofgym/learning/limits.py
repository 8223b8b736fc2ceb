"""Limits of a learner's settings: a number beyond them is a slip, or a damaged file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

MOST_LANES = 65_536
SWITCH = (bool, 0.0, 1.0)


def whole(least: int, most: int) -> tuple[type[int], float, float]:
    """A whole number from ``least`` to ``most``."""
    return int, least, most


def real(least: float, most: float) -> tuple[type[float], float, float]:
    """A number from ``least`` to ``most``."""
    return float, least, most


PPO = {
    "lanes": whole(1, MOST_LANES),
    "minibatches": whole(1, 10_000),
    "epochs": whole(1, 1000),
    "learning_rate": real(0.0, 1.0),
    "gae_lambda": real(0.0, 1.0),
    "clip_range": real(0.0, 10.0),
    "hidden": whole(1, 4096),
}
"""Of what every PPO learner has."""


def check(settings: Any, limits: Mapping[str, tuple[type, float, float]]) -> None:
    """Refuse settings out of their limits.

    Args:
        settings: a data class.
        limits: of its attributes, by name.

    Raises:
        ValueError: naming the setting, the value and what is valid.
    """
    for name, (kind, least, most) in limits.items():
        value = getattr(settings, name)
        if kind is bool:
            if not isinstance(value, bool):
                raise ValueError(f"learner: {name} must be true or false, got {value!r}")
            continue
        number = isinstance(value, int | kind) and not isinstance(value, bool)
        if not number or not math.isfinite(value) or not least <= value <= most:
            wanted = "a whole number" if kind is int else "a number"
            raise ValueError(f"learner: {name} must be {wanted} from {least:g} to {most:g}, got {value!r}")
