"""A small synthetic filter: a double integrator per axis with an acceleration bias, embedded in the 15 states."""

from functools import cache

import numpy as np

from spoofgym.navigation.linear_model import LinearModel


@cache
def synthetic_model(num_epochs: int, dimension: int = 3, interval: float = 1.0) -> LinearModel:
    """A steady filter by its own Riccati recursion; the axes differ, and east feels north, so that directions
    matter."""
    n, axes = 15, range(3)
    position, velocity, bias = slice(6, 9), slice(3, 6), slice(12, 15)
    transition = np.eye(n)
    transition[position, velocity] = interval * np.eye(3)
    transition[velocity, bias] = interval * np.eye(3)
    transition[position, bias] = 0.5 * interval**2 * np.eye(3)
    transition[6, 4] = 0.05 * interval
    noise = np.diag(np.repeat([0.0, 1.0, 1e-4, 0.0, 0.0], 3) * np.tile([0.02, 0.03, 0.02], 5)) * interval
    noise[velocity, velocity] **= 2
    sigma = np.array([3.7, 2.5, 6.0, 0.2, 0.2, 0.2])[:dimension]
    observation = np.zeros((dimension, 9))
    observation[axes, [6, 7, 8]] = 1.0
    if dimension == 6:
        observation[[3, 4, 5], [3, 4, 5]] = 1.0
    full = np.hstack((observation, np.zeros((dimension, 6))))
    covariance = np.diag(np.repeat([1e-8, 0.01, 10.0, 1e-12, 2.5e-5], 3))
    priors, factors, gains = [], [], []
    warm_up = 60
    for epoch in range(warm_up + num_epochs + 1):
        if epoch == warm_up:
            start = covariance
        covariance = transition @ covariance @ transition.T + noise
        priors.append(covariance)
        factors.append(np.linalg.cholesky(full @ covariance @ full.T + np.diag(sigma**2)))
        gains.append(np.linalg.solve(factors[-1], full @ covariance))
        covariance = covariance - gains[-1].T @ gains[-1]

    def every(matrix: np.ndarray) -> np.ndarray:
        return np.repeat(matrix[None], num_epochs + 1, axis=0)

    factor = np.array(factors[warm_up:])
    return LinearModel(
        time=800.0 + interval * np.arange(num_epochs + 1),
        transition=every(transition),
        process_noise=every(noise),
        noise_factor=every(np.sqrt(noise[:9, :9])),
        observation=every(observation),
        measurement_covariance=np.diag(sigma**2),
        prior_covariance=start,
        covariance=np.array(priors[warm_up:]),
        innovation_covariance=factor @ factor.transpose(0, 2, 1),
        innovation_factor=factor,
        whitened_gain=np.array(gains[warm_up:]),
    )


def ramp_offsets(model: LinearModel, rate: float, azimuth: float) -> np.ndarray:
    direction = np.array([np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth)), 0.0])
    return rate * (model.time[1:] - model.time[0])[:, None] * direction
