"""The noises of a log as estimated: what its filter may believe in place of a data sheet and stated sigmas."""

from __future__ import annotations

import sys
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

LARGEST = 1e6
"""Of any noise."""
FOUND = "found"
"""The table of the file about how the figures were found, which no filter reads."""

Triple = tuple[float, float, float]
ONES, NONE = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class LogNoise:
    """White noises of the IMU and random walks, each as the standard deviation of its density, and the noise of fixes.

    The white error of a fix has, on each axis, the variance (scale x stated sigma)² + floor².

    Attributes:
        gyro_noise: angular random walk, rad/√s.
        accelerometer_noise: velocity random walk, m/s/√s.
        gyro_walk: of the gyro biases, rad/s/√s.
        accelerometer_walk: of the accelerometer biases, m/s²/√s.
        position_walk: of the slow error of the fixes, E, N, U, m/√s.
        position_scale: on the stated sigma of a position, E, N, U.
        position_floor: E, N, U, m.
        velocity_scale: on the stated sigma of a velocity, E, N, U.
        velocity_floor: E, N, U, m/s.
    """

    gyro_noise: float
    accelerometer_noise: float
    gyro_walk: float
    accelerometer_walk: float
    position_walk: Triple
    position_scale: Triple = ONES
    position_floor: Triple = NONE
    velocity_scale: Triple = ONES
    velocity_floor: Triple = NONE

    def __post_init__(self) -> None:
        for name in ("gyro_noise", "accelerometer_noise", "gyro_walk", "accelerometer_walk"):
            validation.non_negative("noise", name, getattr(self, name), LARGEST)
        for name in ("position_walk", "position_scale", "position_floor", "velocity_scale", "velocity_floor"):
            values = validation.triple("noise", name, getattr(self, name))
            for value in values:
                validation.non_negative("noise", name, value, LARGEST)
            object.__setattr__(self, name, values)
        for kind in ("position", "velocity"):
            if not all(map(max, getattr(self, f"{kind}_scale"), getattr(self, f"{kind}_floor"))):
                raise ValueError(f"noise: {kind}_scale or {kind}_floor must be above 0 on every axis")

    @property
    def density(self) -> Floats:
        """Process noise of the 15 inertial states, (15,), unit²/s."""
        white = np.repeat([self.gyro_noise, self.accelerometer_noise], 3)
        walks = np.repeat([self.gyro_walk, self.accelerometer_walk], 3)
        return np.asarray(np.concatenate([white, self.position_walk, walks]) ** 2)

    def fix_sigma(self, stated: Floats) -> Floats:
        """1 sigma of the white error of fixes, (n, m), m and m/s.

        Args:
            stated: sigmas of the fixes, (n, m), m = 3 or 6, m and m/s.
        """
        scale, floor = (*self.position_scale, *self.velocity_scale), (*self.position_floor, *self.velocity_floor)
        columns = stated.shape[1]
        return np.asarray(np.hypot(stated * scale[:columns], floor[:columns]))


def write_noise(noise: LogNoise, found: dict[str, str | float]) -> str:
    """The content of a ``noise.toml``.

    Args:
        noise: what is believed.
        found: how it was found: texts and numbers by key.
    """
    lines = [f"{item.name} = {_written(getattr(noise, item.name))}" for item in fields(noise)]
    return "\n".join([*lines, "", f"[{FOUND}]", *(f"{key} = {_written(value)}" for key, value in found.items())]) + "\n"


def _written(value: Any) -> str:
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, tuple):
        return f"[{', '.join(map(_written, value))}]"
    return f"{float(value):.6g}"


def read_noise(path: str | Path) -> LogNoise:
    """Read a ``noise.toml``.

    Raises:
        ValueError: it is missing or no TOML, a key is unknown or missing, or a value is out of range.
    """
    path = Path(path)
    if not path.is_file():
        raise ValueError(f"{path} is missing; spoofgym estimate-noise FOLDER -o {path} writes it")
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except ValueError as error:
        raise ValueError(f"{path}: not valid TOML: {error}") from None
    values.pop(FOUND, None)
    names = [item.name for item in fields(LogNoise)]
    for key in values:
        if key not in names:
            raise ValueError(f"{path}: unknown key {key!r}; valid are {', '.join(names)}, and a table [{FOUND}]")
    try:
        return LogNoise(**values)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path}: {_reason(error)}") from None


def _reason(error: Exception) -> str:
    """A missing key in words of the file."""
    text = str(error)
    return f"missing: {text.partition('argument')[2].lstrip('s: ')}" if isinstance(error, TypeError) else text
