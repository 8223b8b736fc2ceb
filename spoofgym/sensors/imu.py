"""IMU grades by their data sheets, and the error processes of an inertial sensor.

The error of each axis is a constant bias, a first-order Gauss-Markov bias instability and white noise (Groves 2013,
section 4.4).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.kernels import njit

DEGREE_PER_HOUR = math.pi / 180.0 / 3600.0
DEGREE_PER_ROOT_HOUR = math.pi / 180.0 / 60.0
MICRO_G = 9.80665e-6


@dataclass(frozen=True, kw_only=True)
class ImuGrade:
    """The errors of an IMU in the units of its data sheet, one sigma, the same on every axis.

    Attributes:
        name: of the grade.
        gyro_bias: constant bias, deg/h.
        gyro_random_walk: angular random walk, deg/√h.
        gyro_instability: bias instability, deg/h.
        accelerometer_bias: constant bias, µg.
        accelerometer_random_walk: velocity random walk, µg/√Hz.
        accelerometer_instability: bias instability, µg.
        correlation_time: of both instabilities, s.
        source: where the figures come from.
    """

    name: str
    gyro_bias: float
    gyro_random_walk: float
    gyro_instability: float
    accelerometer_bias: float
    accelerometer_random_walk: float
    accelerometer_instability: float
    correlation_time: float
    source: str

    def __post_init__(self) -> None:
        for item in (
            "gyro_bias",
            "gyro_random_walk",
            "gyro_instability",
            "accelerometer_bias",
            "accelerometer_random_walk",
            "accelerometer_instability",
        ):
            validation.non_negative(f"IMU grade {self.name!r}", item, getattr(self, item))
        validation.above(f"IMU grade {self.name!r}", "correlation_time", self.correlation_time)

    @property
    def noise_density(self) -> Floats:
        """White noise of gyro and accelerometer axes, (6,), rad/√s and m/s²/√Hz."""
        gyro, accelerometer = self.gyro_random_walk * DEGREE_PER_ROOT_HOUR, self.accelerometer_random_walk * MICRO_G
        return np.repeat([gyro, accelerometer], 3)

    @property
    def bias_sigma(self) -> Floats:
        """Constant biases, (6,), rad/s and m/s²."""
        return np.repeat([self.gyro_bias * DEGREE_PER_HOUR, self.accelerometer_bias * MICRO_G], 3)

    @property
    def instability_sigma(self) -> Floats:
        """Stationary sigma of the bias instability, (6,), rad/s and m/s²."""
        return np.repeat([self.gyro_instability * DEGREE_PER_HOUR, self.accelerometer_instability * MICRO_G], 3)

    @property
    def whole_bias_sigma(self) -> Floats:
        """Constant and unstable part of a bias together, (6,), rad/s and m/s²."""
        return np.hypot(self.bias_sigma, self.instability_sigma)


GRADES = {
    item.name: item
    for item in (
        ImuGrade(
            name="navigation",
            gyro_bias=0.01,
            gyro_random_walk=0.005,
            gyro_instability=0.0,
            accelerometer_bias=100.0,
            accelerometer_random_walk=20.0,
            accelerometer_instability=0.0,
            correlation_time=3600.0,
            source="Liu et al. 2018, table 1 (aviation-grade INS)",
        ),
        ImuGrade(
            name="fog",
            gyro_bias=0.1,
            gyro_random_walk=0.012,
            gyro_instability=0.0,
            accelerometer_bias=50.0,
            accelerometer_random_walk=120.0,
            accelerometer_instability=0.0,
            correlation_time=3600.0,
            source="KVH 1775 class (named by FOI-R-5687): data-sheet figures of its fibre-optic gyros and 10 g "
            "accelerometers; biases stand for offset and instability",
        ),
        ImuGrade(
            name="tactical",
            gyro_bias=1.0,
            gyro_random_walk=0.1,
            gyro_instability=0.3,
            accelerometer_bias=1000.0,
            accelerometer_random_walk=100.0,
            accelerometer_instability=50.0,
            correlation_time=300.0,
            source="class figures, rounded; compare Honeywell HG1700: 1 deg/h, 0.125 deg/√h, 1 mg",
        ),
        ImuGrade(
            name="industrial",
            gyro_bias=10.0,
            gyro_random_walk=0.3,
            gyro_instability=3.0,
            accelerometer_bias=2000.0,
            accelerometer_random_walk=200.0,
            accelerometer_instability=50.0,
            correlation_time=300.0,
            source="class figures of factory-calibrated MEMS, rounded; compare Analog Devices ADIS16488",
        ),
        ImuGrade(
            name="automotive",
            gyro_bias=720.0,
            gyro_random_walk=0.6,
            gyro_instability=20.0,
            accelerometer_bias=40000.0,
            accelerometer_random_walk=300.0,
            accelerometer_instability=200.0,
            correlation_time=300.0,
            source="class figures of consumer MEMS, rounded; compare Bosch BMI088 and TDK ICM-20602",
        ),
        ImuGrade(
            name="kujur-navigation",
            gyro_bias=0.01,
            gyro_random_walk=0.002,
            gyro_instability=0.0,
            accelerometer_bias=25.0,
            accelerometer_random_walk=10.0,
            accelerometer_instability=0.0,
            correlation_time=3600.0,
            source="assumed: the table of IMU grades (appendix F) is missing in the text of Kujur 2024",
        ),
        ImuGrade(
            name="kujur-tactical",
            gyro_bias=1.0,
            gyro_random_walk=0.07,
            gyro_instability=0.0,
            accelerometer_bias=300.0,
            accelerometer_random_walk=50.0,
            accelerometer_instability=0.0,
            correlation_time=3600.0,
            source="assumed: the table of IMU grades (appendix F) is missing in the text of Kujur 2024",
        ),
        ImuGrade(
            name="kujur-automotive",
            gyro_bias=20.0,
            gyro_random_walk=0.4,
            gyro_instability=0.0,
            accelerometer_bias=1000.0,
            accelerometer_random_walk=80.0,
            accelerometer_instability=0.0,
            correlation_time=3600.0,
            source="assumed: the table of IMU grades (appendix F) is missing in the text of Kujur 2024",
        ),
        ImuGrade(
            name="kujur-lousy",
            gyro_bias=20.0,
            gyro_random_walk=0.4,
            gyro_instability=0.0,
            accelerometer_bias=1000.0,
            accelerometer_random_walk=8000.0,
            accelerometer_instability=0.0,
            correlation_time=3600.0,
            source="Kujur 2024: the automotive grade with a hundred times its velocity random walk",
        ),
    )
}


def grade(name: object) -> ImuGrade:
    """The grade of this name.

    Raises:
        ValueError: unknown; the message lists the valid names.
    """
    if not isinstance(name, str) or name not in GRADES:
        raise ValueError(f"unknown IMU grade {validation.shown(name)}; valid grades: {', '.join(GRADES)}")
    return GRADES[name]


def require_grade(owner: str, option: str, name: str) -> None:
    """Refuse the value of an option that names no grade.

    Raises:
        ValueError: naming owner, option and the valid names.
    """
    with validation.argument(owner, option):
        grade(name)


@njit(cache=True, nogil=True)
def gauss_markov_step(value: float, sigma: float, decay: float, normal: float) -> float:
    """One step of a first-order Gauss-Markov process: x <- a x + σ √(1 - a²) n, with a = exp(-Δt / τ)."""
    return decay * value + sigma * math.sqrt(1.0 - decay * decay) * normal


@njit(cache=True, nogil=True)
def white_sample(density: float, step: float, normal: float) -> float:
    """White noise averaged over a sample: density / √Δt times a standard normal."""
    return density / math.sqrt(step) * normal
