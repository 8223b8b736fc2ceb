"""A memory for a player that has none: the observations of the last epochs beside that of the present one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spoofgym.arrays import Runs
from spoofgym.envs.observation import Field


def stacked_fields(fields: tuple[Field, ...], frames: int) -> tuple[Field, ...]:
    """The entries of ``frames`` observations, the most recent first.

    Args:
        fields: of one observation.
        frames: epochs seen, the present one included.
    """
    return tuple(replace(field, name=field.name + _age(epochs)) for epochs in range(frames) for field in fields)


def _age(epochs: int) -> str:
    """How a field's name ends; that of the present epoch is the plain one."""
    if epochs == 0:
        return ""
    return f", {epochs} epoch{'s' if epochs > 1 else ''} ago"


class FrameStack:
    """The last observations of N lanes; before the first epoch of a game that of the first one is repeated."""

    def __init__(self, num_lanes: int, frames: int, entries: int) -> None:
        """Allocate room for ``frames`` observations of D ``entries`` in each lane."""
        self._frames = np.zeros((num_lanes, frames, entries), dtype=np.float32)

    def begin(self, lanes: Runs, present: NDArray[np.float32]) -> None:
        """Start new games in some lanes.

        Args:
            lanes: indices.
            present: observations of their first epoch, (len(lanes), D).
        """
        self._frames[lanes] = present[:, None]

    def push(self, present: NDArray[np.float32]) -> None:
        """Go on to the next epoch in every lane; ``present`` are its observations, (N, D)."""
        self._frames[:, 1:] = self._frames[:, :-1]
        self._frames[:, 0] = present

    def observation(self) -> NDArray[np.float32]:
        """What the player of each lane sees, (N, frames * D), most recent first."""
        return self._frames.reshape(len(self._frames), -1).copy()
