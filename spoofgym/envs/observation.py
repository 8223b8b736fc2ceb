"""What the spoofer sees, by its knowledge of the victim: the fields, their order and their scale.

Every entry is squashed smoothly into (-1, 1) by x / (1 + |x|), x being the quantity over its scale, except the elapsed
fraction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from spoofgym.arrays import Floats
from spoofgym.geodesy import AXES
from spoofgym.kernels import njit


@dataclass(frozen=True)
class Field:
    """One entry of an observation.

    Attributes:
        name: what it is.
        unit: of the quantity.
        scale: the value at which the entry is a half; 0 = not squashed, in [0, 1].
    """

    name: str
    unit: str
    scale: float


def spoofer_fields(
    knowledge: str, dimension: int, detectors: tuple[str, ...], clock: bool = False
) -> tuple[Field, ...]:
    """The entries of the spoofer's observation, in order.

    Args:
        knowledge: "blind", "shadow" or "full".
        dimension: m, of the fix; 3 where ranges are turned into a position.
        detectors: their names, for "full".
        clock: whether the spoofer pulls the receiver's clock, too.
    """
    axes = [f"{kind}{axis}" for kind in ("", "velocity ")[: dimension // 3] for axis in AXES]
    result = [Field(f"offset {axis}", "m", 10.0) for axis in AXES]
    if clock:
        result.append(Field("offset of the clock", "m", 10.0))
    result.append(Field("elapsed fraction of the game", "1", 0.0))
    result += [Field(f"tracked velocity {axis}", "m/s", 100.0) for axis in AXES]
    result.append(Field("tracking sigma", "m", 1.0))
    if knowledge in ("shadow", "full"):
        result += [Field(f"mean whitened innovation, last, {axis}", "sigma", 2.0) for axis in axes]
        result += [Field(f"mean whitened innovation, coming, offset held, {axis}", "sigma", 2.0) for axis in axes]
        result += [Field(f"mean position error {axis}", "m", 10.0) for axis in AXES]
        result += [Field(f"mean velocity error {axis}", "m/s", 1.0) for axis in AXES]
        if clock:
            result.append(Field("mean clock error", "m", 10.0))
    if knowledge == "full":
        result += [Field(f"whitened innovation, last, {axis}", "sigma", 2.0) for axis in axes]
        for name in detectors:
            result.append(Field(f"statistic of {name} over its threshold", "1", 1.0))
            result.append(Field(f"threshold of {name}", "1", 25.0))
    return tuple(result)


def observation_space(fields: tuple[Field, ...]) -> spaces.Box:
    """The box of the squashed entries, float32."""
    low = np.array([0.0 if field.scale == 0 else -1.0 for field in fields], dtype=np.float32)
    return spaces.Box(low, np.ones(len(fields), dtype=np.float32), dtype=np.float32)


class Squash:
    """Scales and squashes the raw entries of N observations."""

    def __init__(self, fields: tuple[Field, ...]) -> None:
        """Keep the scales."""
        self._inverse = np.array([0.0 if field.scale == 0 else 1.0 / field.scale for field in fields])

    def __call__(self, raw: Floats) -> NDArray[np.float32]:
        """x / (1 + |x|), (N, D)."""
        squashed = np.empty(raw.shape, dtype=np.float32)
        _squash(raw, self._inverse, squashed)
        return squashed


@njit(cache=True, nogil=True)
def _squash(raw: Floats, inverse: Floats, squashed: NDArray[np.float32]) -> None:
    """Squash entries of raw (N, D) by the inverse of their scales (D,); an inverse of 0 leaves an entry as it is."""
    for lane in range(raw.shape[0]):
        for i in range(raw.shape[1]):
            if inverse[i] == 0.0:
                squashed[lane, i] = raw[lane, i]
            else:
                scaled = raw[lane, i] * inverse[i]
                squashed[lane, i] = scaled / (1.0 + abs(scaled))
