"""The noises that are estimated on a log, as logarithms within bounds."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.log_noise import LogNoise
from spoofgym.scenarios.recorded_loose import RecordedFixes

MOST = 1000.0
"""Largest noise of the IMU over its data sheet."""
SCALES = (0.02, 50.0)
"""On stated sigmas."""
FLOORS = {"position_floor": (1e-3, 100.0), "velocity_floor": (1e-3, 10.0)}
"""m and m/s."""
WALKS = (1e-3, 10.0)
"""Of the slow error of the fixes, m/√s."""
VARIED = 2.0
"""A floor is told from a scale where the stated sigmas vary by this factor (5 % to 95 %); else it stays zero."""
AXES = ("east", "north", "up")
UNITS = {
    "gyro_noise": "rad/√s",
    "accelerometer_noise": "m/s/√s",
    "gyro_walk": "rad/s/√s",
    "accelerometer_walk": "m/s²/√s",
    "position_walk": "m/√s",
    "position_scale": "× stated",
    "position_floor": "m",
    "velocity_scale": "× stated",
    "velocity_floor": "m/s",
}


@dataclass(frozen=True)
class Parameter:
    """One number of a `LogNoise`.

    Attributes:
        field: its name there.
        axis: 0, 1, 2; None = it belongs to all axes.
        least: bound.
        most: bound.
    """

    field: str
    axis: int | None
    least: float
    most: float

    @property
    def name(self) -> str:
        """For people."""
        words = self.field.replace("_", " ")
        return words if self.axis is None else f"{words}, {AXES[self.axis]}"

    def of(self, noise: LogNoise) -> float:
        """Its value in a noise."""
        value = getattr(noise, self.field)
        return float(value if self.axis is None else value[self.axis])


def parameters(log: RecordedFixes, stretch: slice) -> list[Parameter]:
    """What can be estimated on a stretch of a log.

    The noises of the IMU are never below its data sheet: some clean minutes cannot show that a sensor is better, and
    the filter must hold for longer than they lasted.

    Args:
        log: of fixes.
        stretch: of its epochs.
    """
    sheet = np.sqrt(replace(log.tuning, process_noise_scale=1.0).noise_density(log.grade))
    inertial = {"gyro_noise": 0, "accelerometer_noise": 3, "gyro_walk": 9, "accelerometer_walk": 12}
    found = [
        Parameter(name, None, float(sheet[place]), MOST * float(sheet[place]))
        for name, place in inertial.items()
        if sheet[place] > 0.0
    ]
    found += [Parameter("position_walk", axis, *WALKS) for axis in range(3)]
    stated, measured = log.stated_sigma[stretch], log.measured[stretch]
    for column in range(log.dimension):
        kind, axis = ("position", "velocity")[column // 3], column % 3
        sigma = stated[measured[:, column], column]
        if len(sigma) == 0:
            continue
        found.append(Parameter(f"{kind}_scale", axis, *SCALES))
        low, high = np.percentile(sigma, [5.0, 95.0])
        if high > VARIED * low:
            found.append(Parameter(f"{kind}_floor", axis, *FLOORS[f"{kind}_floor"]))
    return found


def first_guess(log: RecordedFixes, asked: list[Parameter]) -> Floats:
    """Logarithms from which the search starts: what the filter believes without any estimate, within the bounds."""
    density = np.sqrt(log.tuning.noise_density(log.grade))
    walk = (float(density[6]),) * 3
    floor = {name: (0.3 * log.sigma_floor,) * 3 for name in FLOORS}
    guess = LogNoise(
        gyro_noise=float(density[0]),
        accelerometer_noise=float(density[3]),
        gyro_walk=float(density[9]),
        accelerometer_walk=float(density[12]),
        position_walk=walk,
        **floor,
    )
    return np.log([min(max(each.of(guess), 1.01 * each.least), 0.99 * each.most) for each in asked])


def noise_of(log: RecordedFixes, asked: list[Parameter], logarithms: Floats) -> LogNoise:
    """The noise with these values; what is not asked for is that of the data sheet, of stated sigmas, or none."""
    sheet = np.sqrt(log.tuning.noise_density(log.grade))
    values = {item.name: [0.0] * 3 for item in fields(LogNoise)}
    values |= {"position_scale": [1.0] * 3, "velocity_scale": [1.0] * 3}
    single = {"gyro_noise": sheet[0], "accelerometer_noise": sheet[3], "gyro_walk": sheet[9]}
    single |= {"accelerometer_walk": sheet[12]}
    for each, value in zip(asked, np.exp(logarithms).tolist(), strict=True):
        if each.axis is None:
            single[each.field] = value
        else:
            values[each.field][each.axis] = value
    triples = {name: tuple(value) for name, value in values.items() if name not in single}
    return LogNoise(**triples, **{name: float(value) for name, value in single.items()})  # type: ignore[arg-type]
