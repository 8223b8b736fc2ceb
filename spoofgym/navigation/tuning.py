"""What a loosely coupled filter believes: its initial uncertainty, process noise and measurement noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.sensors.imu import ImuGrade

ARCSECOND = np.pi / (180.0 * 3600.0)


@dataclass(frozen=True, kw_only=True)
class FilterTuning:
    """The settings of the 15-state filter, SI units.

    Attributes:
        attitude_sigma: initial attitude error (E, N, U), 1 sigma, rad.
        velocity_sigma: initial velocity error (E, N, U), m/s.
        position_sigma: initial position error (E, N, U), m.
        initial_scale: the filter starts with (initial_scale x sigma)², while the true initial error has 1 sigma (Liu
            2018, appendix D: 3); the bias sigmas are the data sheet's.
        position_random_walk: process noise of the position, m/√s: the errors of the navigation computation.
        process_noise_scale: factor on the variance of the inertial process noise.
        bias_states: whether the filter estimates the biases of the IMU; without, their variances are zero, so that the
            gains are, and nine states are left.
        measurement_sigma: the filter's R, 1 sigma per axis of the fix, (3,) m or (6,) m and m/s.
    """

    attitude_sigma: tuple[float, float, float] = (20 * ARCSECOND, 20 * ARCSECOND, 180 * ARCSECOND)
    velocity_sigma: tuple[float, float, float] = (0.1, 0.1, 0.1)
    position_sigma: tuple[float, float, float] = (3.7, 3.7, 6.0)
    initial_scale: float = 3.0
    position_random_walk: float = 1.0 / 60.0
    process_noise_scale: float = 1.0
    measurement_sigma: tuple[float, ...] = (3.7, 3.7, 6.0)
    bias_states: bool = True

    def __post_init__(self) -> None:
        owner = "filter tuning"
        for name in ("attitude_sigma", "velocity_sigma", "position_sigma"):
            for sigma in validation.triple(owner, name, getattr(self, name)):
                validation.non_negative(owner, name, sigma)
        sigmas = validation.floats(owner, "measurement_sigma", self.measurement_sigma)
        if sigmas.shape not in ((3,), (6,)) or np.any(sigmas <= 0.0):
            given = validation.shown(self.measurement_sigma)
            raise ValueError(f"{owner}: measurement_sigma must be 3 or 6 positive numbers, got {given}")
        for name in ("initial_scale", "process_noise_scale"):
            validation.above(owner, name, getattr(self, name))
        validation.non_negative(owner, "position_random_walk", self.position_random_walk)
        validation.boolean(owner, "bias_states", self.bias_states)

    def initial_sigma(self, grade: ImuGrade) -> Floats:
        """True 1-sigma initial error of the 15 states."""
        return np.concatenate([self.attitude_sigma, self.velocity_sigma, self.position_sigma, grade.whole_bias_sigma])

    def noise_density(self, grade: ImuGrade) -> Floats:
        """The filter's process noise density of the 15 states, (15,), unit²/s.

        A Gauss-Markov bias of the data sheet is modelled as the random walk of the same driving noise, 2 σ² / τ.
        """
        walk = 2.0 * grade.instability_sigma**2 / grade.correlation_time
        inertial = np.concatenate([grade.noise_density**2, np.full(3, self.position_random_walk**2), walk])
        inertial[:6] *= self.process_noise_scale
        if not self.bias_states:
            inertial[9:] = 0.0
        return inertial

    @property
    def measurement_covariance(self) -> Floats:
        """R, (m, m)."""
        return np.diag(np.square(self.measurement_sigma))


def true_noise_density(grade: ImuGrade, position_random_walk: float) -> Floats:
    """Density of the white noise that really acts on attitude, velocity and position, (9,), unit²/s."""
    return np.concatenate([grade.noise_density**2, np.full(3, position_random_walk**2)])
