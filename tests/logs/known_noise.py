"""A synthetic drive whose noises are known: what a filter's own model says, and nothing else."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from spoofgym.geodesy import displace
from spoofgym.logs.log_noise import LogNoise
from spoofgym.trajectory import Accelerate, Straight, Turn, fly

RATE = 50
STATED = (1.0, 0.2)
"""Sigmas of position and velocity that the log states, m and m/s."""
TRUE = LogNoise(
    gyro_noise=5e-3,
    accelerometer_noise=0.08,
    gyro_walk=2e-4,
    accelerometer_walk=1e-2,
    position_walk=(0.3, 0.3, 0.2),
    position_scale=(0.4, 0.4, 0.7),
    velocity_scale=(0.3, 0.5, 0.8),
)
FRD_OF_RFU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Also north, east, down of east, north, up."""


def write(folder: Path, seed: int, legs: int = 5, noise: LogNoise = TRUE) -> Path:
    """A drive of 30 s a leg with turns and changes of speed; the reference is the truth."""
    generator = np.random.default_rng(seed)
    turn, parts = math.radians(80.0), []
    for leg in range(legs):
        parts += [Straight(6.0), Accelerate(5.0, 16.0 if leg % 2 else 8.0), Straight(7.0)]
        parts += [Turn(turn if leg % 3 else -turn, 8.0), Straight(4.0)]
    truth = fly(parts, position=(0.8, 0.2, 100.0), speed=8.0, heading=0.5, rate=RATE)
    steps, step = truth.num_steps, 1.0 / RATE
    white = np.repeat([noise.gyro_noise, noise.accelerometer_noise], 3) / math.sqrt(step)
    walk = np.repeat([noise.gyro_walk, noise.accelerometer_walk], 3) * math.sqrt(step)
    drift = np.cumsum(walk * generator.standard_normal((steps, 6)), axis=0)
    body = np.hstack([truth.angular_rate, truth.specific_force]) + drift
    body += white * generator.standard_normal((steps, 6))
    imu = np.hstack([truth.time[:-1, None] + 0.5 * step, body[:, :3] @ FRD_OF_RFU.T, body[:, 3:] @ FRD_OF_RFU.T])
    folder.mkdir(parents=True)
    (folder / "log.toml").write_text(
        'name = "known"\nimu_to_body_frd = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nstart_s = 2.0\ngnss_delay_s = 0.0\n'
    )
    header = "t_s,gx_radps,gy_radps,gz_radps,ax_mps2,ay_mps2,az_mps2"
    np.savetxt(folder / "imu.csv", imu, delimiter=",", header=header, comments="", fmt="%.10g")
    index = np.arange(RATE, steps, RATE)
    slow = np.cumsum(np.array(noise.position_walk) * generator.standard_normal((len(index), 3)), axis=0)
    sigma = noise.fix_sigma(np.tile(np.repeat(STATED, 3), (len(index), 1)))
    error = sigma * generator.standard_normal((len(index), 6))
    position = displace(truth.position[index], slow + error[:, :3])
    velocity = (truth.velocity[index] + error[:, 3:]) @ FRD_OF_RFU.T
    stated = np.tile(np.repeat(STATED, 3), (len(index), 1))
    _table(folder / "gnss.csv", truth.time[index], position, velocity, stated)
    _table(folder / "reference.csv", truth.time[index], truth.position[index], truth.velocity[index] @ FRD_OF_RFU.T)
    return folder


def _table(path: Path, time: np.ndarray, position: np.ndarray, velocity: np.ndarray, *more: np.ndarray) -> None:
    columns = "t_s,lat_deg,lon_deg,h_m,vn_mps,ve_mps,vd_mps"
    if more:
        columns += ",sd_n_m,sd_e_m,sd_d_m,sd_vn_mps,sd_ve_mps,sd_vd_mps"
    rows = np.column_stack([time, np.degrees(position[:, :2]), position[:, 2], velocity, *more])
    np.savetxt(path, rows, delimiter=",", header=columns, comments="", fmt="%.13g")
