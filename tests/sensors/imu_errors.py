"""Long records of an IMU's errors by the steps that the navigators take, for tests of their statistics."""

import math
from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.kernels import njit
from spoofgym.sensors.imu import ImuGrade, gauss_markov_step, white_sample


def simulate(imu: ImuGrade, num_samples: int, step: float, interval: float, rng: np.random.Generator) -> Floats:
    """Errors of gyro and accelerometer axes, as the navigators apply them: the instability is held over each interval.

    Args:
        imu: the grade.
        num_samples: n.
        step: between samples, s.
        interval: after which the bias instability moves, s.
        rng: source of randomness.

    Returns:
        (n, 6), rad/s and m/s².
    """
    held = max(1, round(interval / step))
    decay = math.exp(-held * step / imu.correlation_time)
    bias = imu.bias_sigma * rng.standard_normal(6)
    instability = imu.instability_sigma * rng.standard_normal(6)
    driving = rng.standard_normal((-(-num_samples // held), 6))
    white = rng.standard_normal((num_samples, 6))
    errors = np.empty((num_samples, 6))
    process = ErrorProcess(imu.instability_sigma, imu.noise_density, decay, step, held)
    _fill(errors, bias, instability, driving, white, process)
    return errors


class ErrorProcess(NamedTuple):
    """How the errors of an inertial unit move.

    Attributes:
        sigma: of the bias instability, (6,), rad/s and m/s².
        density: of the white noise, (6,), rad/√s and m/s/√s.
        decay: of the instability from one held value to the next.
        step: between samples, s.
        held: samples over which the instability is held.
    """

    sigma: Floats
    density: Floats
    decay: float
    step: float
    held: int


@njit(cache=True, nogil=True)
def _fill(
    errors: Floats, bias: Floats, instability: Floats, driving: Floats, white: Floats, process: ErrorProcess
) -> None:
    """Constant bias, bias instability and white noise of every sample, (n, 6)."""
    for i in range(errors.shape[0]):
        if i > 0 and i % process.held == 0:
            for a in range(6):
                normal = driving[i // process.held, a]
                instability[a] = gauss_markov_step(instability[a], process.sigma[a], process.decay, normal)
        for a in range(6):
            errors[i, a] = bias[a] + instability[a] + white_sample(process.density[a], process.step, white[i, a])
