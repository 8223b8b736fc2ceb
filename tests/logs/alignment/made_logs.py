"""Logs made of a heading and a motion, for alignments: what a perfect or noisy IMU felt, and what the fixes show."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.geodesy import displace, normal_gravity
from spoofgym.logs.log import Fixes, Log
from spoofgym.mechanization import attitude_matrix

PLACE = np.array([np.radians(45.0), np.radians(9.0), 100.0])
RATE = 50
Motion = Callable[[Floats], Floats]


def made_log(
    folder: Path,
    velocity: Motion,
    *,
    heading: float,
    duration: float = 60.0,
    pitch: float = 0.0,
    roll: float = 0.0,
    turn: Motion | None = None,
    noise: float = 0.0,
    gyro_bias: Floats | None = None,
    seed: int = 0,
) -> Log:
    """A log of a vehicle whose attitude does not follow from where it goes.

    Args:
        folder: where further tables of the log may lie.
        velocity: ENU at times, (n, 3), m/s.
        heading: at the start, rad.
        duration: s.
        pitch: rad.
        roll: rad.
        turn: heading since the start at times, (n,), rad; None = it does not turn.
        noise: 1 sigma of the velocity of the fixes, m/s; the IMU's is a hundredth of it, in rad/s and, times 10, m/s².
        gyro_bias: (3,), rad/s.
        seed: of the noise.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, 1.0 / RATE)
    yaw = heading + (np.zeros(len(time)) if turn is None else turn(time))
    attitude = attitude_matrix(pitch, roll, yaw)
    acceleration = np.gradient(velocity(time), time, axis=0)
    acceleration[:, 2] += normal_gravity(PLACE[0], PLACE[2])
    force = np.einsum("nij,ni->nj", attitude, acceleration)
    # heading turns clockwise, the angular rate about the vertical counts the other way
    rate = np.einsum("nij,i->nj", attitude, [0.0, 0.0, -1.0]) * np.gradient(yaw, time)[:, None]
    rate += 0.01 * noise * rng.standard_normal(rate.shape) + (np.zeros(3) if gyro_bias is None else gyro_bias)
    force += 0.1 * noise * rng.standard_normal(force.shape)
    epochs = np.arange(1, len(time) - 1, RATE // 5)
    track = np.concatenate([np.zeros((1, 3)), np.cumsum(velocity(time)[:-1] / RATE, axis=0)])
    fixes = Fixes(
        time=time[epochs],
        position=displace(PLACE, track[epochs]),
        velocity=velocity(time)[epochs] + noise * rng.standard_normal((len(epochs), 3)),
        position_sigma=np.full((len(epochs), 3), 1.0),
        velocity_sigma=np.full((len(epochs), 3), max(noise, 0.05)),
    )
    return Log("made", folder, 0.0, time, rate, force, np.zeros(3), fixes, None)


def at_rest(time: Floats) -> Floats:
    """It stands."""
    return np.zeros((len(time), 3))


def to_and_fro(time: Floats) -> Floats:
    """It hovers back and forth, to all sides, at up to 3 m/s."""
    return np.column_stack([3.0 * np.sin(0.5 * time), 2.0 * np.sin(0.3 * time + 1.0), 0.3 * np.sin(0.2 * time)])
