"""The direction in which a vehicle travels, and what lies across it."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Floats

SIDES = ("left", "right")
MOVING = 0.1
"""Horizontal speed below which a vehicle has no direction of travel, m/s; it keeps the last one then."""


def lateral(velocity: Floats, side: str) -> Floats:
    """Horizontal unit vectors at right angles to the direction of travel, (M+1, 3), ENU.

    Args:
        velocity: at consecutive moments, (M+1, 3), ENU, m/s.
        side: "left" or "right" of the direction of travel. A vehicle that stands keeps its last direction, before it
            first moves the one in which it will.

    Raises:
        ValueError: the vehicle never moves.
    """
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    moving = np.flatnonzero(speed > MOVING)
    if len(moving) == 0:
        raise ValueError(f"a vehicle that never moves faster than {MOVING:g} m/s has no lateral direction")
    place = np.searchsorted(moving, np.arange(len(speed)), side="right") - 1
    epoch = moving[np.maximum(place, 0)]
    east, north = velocity[epoch, 0] / speed[epoch], velocity[epoch, 1] / speed[epoch]
    right = np.stack([north, -east, np.zeros_like(east)], axis=1)
    return right if side == "right" else -right
