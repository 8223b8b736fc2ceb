"""A synthetic drive with raw ranges, for tests: the truth is known, and the ranges come from the time of flight."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.constants import speed_of_light
from scipy.spatial.transform import Rotation

from spoofgym.geodesy import ecef_to_enu_rotation, geodetic_to_ecef
from spoofgym.logs.ranges_log import CODE_SIGMA, RATE_SIGMA, zenith_troposphere
from spoofgym.sensors.ephemeris import read_csv
from spoofgym.sensors.ranging import troposphere_mapping
from spoofgym.trajectory import Accelerate, Straight, Trajectory, Turn, fly
from tests.logs.test_ranges_log import CLOCK, DRIFT, EARTH_RATE, FIRST, START, write_ephemeris

RATE = 50
DELAY = 0.3
"""How much later the clock of GPS is than that of the log, s."""
HALF = 5
"""Samples to either side over which a range rate is a difference."""
FRD = [1, 0, 2]
SIGN = np.array([1.0, 1.0, -1.0])


@dataclass(frozen=True)
class Clock:
    """A receiver's clock.

    Attributes:
        offset: at the first epoch, m.
        drift: m/s.
        steps: (epoch, seconds) of each step.
        in_tags: whether the time tags step with the ranges.
        in_rates: whether the range rates are those of the ranges and show the steps, too.
    """

    offset: float = CLOCK
    drift: float = DRIFT
    steps: tuple[tuple[int, float], ...] = ()
    in_tags: bool = True
    in_rates: bool = False

    def stepped(self, epochs: int) -> np.ndarray:
        """The sum of the steps up to each epoch, (E,), m."""
        total = np.zeros(epochs)
        for epoch, seconds in self.steps:
            total[epoch:] += seconds * speed_of_light
        return total


@cache
def drive(turns: int) -> Trajectory:
    """A drive of ``turns`` times 35 s."""
    manoeuvres = []
    for k in range(turns):
        side = 1.0 if k % 3 else -1.0
        manoeuvres += [Straight(15.0), Turn(side * math.radians(80.0), 10.0), Accelerate(1.0 if k % 2 else -1.0, 10.0)]
    return fly(manoeuvres, position=tuple(START), speed=12.0, heading=0.5, rate=RATE)


def flights(folder: Path, place: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pseudoranges of a perfect receiver, (E, S), m, in a frame that does not turn, and the satellites' elevation."""
    ephemeris = read_csv(folder / "ephemeris.csv")
    receiver = geodetic_to_ecef(place)
    flight = np.full((len(time), len(ephemeris.satellites)), 0.07)
    for _ in range(8):
        satellite, _ = ephemeris.states(time[:, None] - flight)
        turn = np.outer(-EARTH_RATE * flight.ravel(), [0.0, 0.0, 1.0])
        sight = Rotation.from_rotvec(turn).apply(satellite.reshape(-1, 3)).reshape(satellite.shape) - receiver[:, None]
        flight = np.linalg.norm(sight, axis=2) / speed_of_light
    up = np.einsum("ej,esj->es", ecef_to_enu_rotation(place)[:, 2], sight)
    elevation = np.arcsin(up / np.linalg.norm(sight, axis=2))
    delay = zenith_troposphere(place)[:, None] * troposphere_mapping(np.maximum(elevation, 0.05))
    clock = ephemeris.clock(time[:, None] - flight) - ephemeris.tgd
    return speed_of_light * (flight - clock) + delay, elevation


def write_drive(
    folder: Path,
    *,
    noise: float = 1.0,
    turns: int = 6,
    seed: int = 0,
    reference: bool = True,
    silent: tuple[int, int] = (0, 0),
    fault: float = 0.0,
    clock: Clock = Clock(),
) -> Trajectory:
    """A log with ranges at 1 Hz whose white noise is ``noise`` times the filter's.

    Args:
        folder: to be made.
        noise: share.
        turns: length of the drive in 35 s.
        seed: of all noise.
        reference: whether the true trajectory is in the log.
        silent: epochs between which the receiver gives nothing.
        fault: of one range in epoch 60, m.
        clock: of the receiver.
    """
    folder.mkdir(exist_ok=True)
    generator, truth = np.random.default_rng(seed), drive(turns)
    folder.joinpath("log.toml").write_text(
        f"imu_to_body_frd = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nstart_s = {FIRST + 2.0}\n"
    )
    bias = np.array([1e-3, -5e-4, 1e-3, 0.03, -0.03, 0.02])
    samples = np.hstack([truth.angular_rate[:, FRD] * SIGN, truth.specific_force[:, FRD] * SIGN]) + bias
    samples += np.repeat([5e-4, 5e-3], 3) * generator.standard_normal(samples.shape)
    imu = np.column_stack([FIRST + truth.time[:-1] + 0.5 / RATE, samples])
    index = np.arange(RATE, truth.num_steps - HALF, RATE)

    def fixes(index: np.ndarray, sigma: float) -> np.ndarray:
        position = truth.position[index].copy()
        position[:, :2] = np.degrees(position[:, :2] + sigma / 6.4e6 * generator.standard_normal((len(index), 2)))
        return np.column_stack([FIRST + truth.time[index], position, truth.velocity[index][:, FRD] * SIGN])

    header = "t_s,lat_deg,lon_deg,h_m,vn_mps,ve_mps,vd_mps"
    tables = {"imu": ("t_s,gx_radps,gy_radps,gz_radps,ax_mps2,ay_mps2,az_mps2", imu)}
    tables["gnss"] = (header, fixes(index, 0.5))
    if reference:
        tables["reference"] = (header, fixes(np.arange(0, truth.num_steps, RATE // 5), 0.0))
    for name, (columns, values) in tables.items():
        np.savetxt(folder / f"{name}.csv", values, delimiter=",", header=columns, comments="", fmt="%.12f")
    _write_ranges(folder, truth, index, generator, noise, silent, fault, clock)
    return truth


_FLIGHTS: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}
"""What `flights` gives, by the drive's length and the first sample: drives differ in their clocks and noise."""


def _true_flights(
    folder: Path, truth: Trajectory, index: np.ndarray, true: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    key = (truth.num_steps, int(index[0]))
    if key not in _FLIGHTS:
        _FLIGHTS[key] = flights(folder, truth.position[index], true)
    return _FLIGHTS[key]


def _write_ranges(
    folder: Path,
    truth: Trajectory,
    index: np.ndarray,
    generator: np.random.Generator,
    noise: float,
    silent: tuple[int, int],
    fault: float,
    oscillator: Clock,
) -> None:
    write_ephemeris(folder / "ephemeris.csv")
    numbers = read_csv(folder / "ephemeris.csv").satellites
    true = FIRST + truth.time[index] + DELAY
    (ranges, elevation), (before, _), (after, _) = (
        _true_flights(folder, truth, index + k, true + k / RATE) for k in (0, -HALF, HALF)
    )
    ranges = ranges.copy()
    rates = (after - before) * RATE / (2 * HALF) + oscillator.drift
    stepped = oscillator.stepped(len(index))
    clock = oscillator.offset + oscillator.drift * np.arange(len(index)) + stepped
    if oscillator.in_rates:
        rates += np.diff(stepped, prepend=0.0)[:, None]
    tag = clock if oscillator.in_tags else clock - stepped
    ranges += clock[:, None] + noise * CODE_SIGMA * generator.standard_normal(ranges.shape)
    rates += noise * RATE_SIGMA * generator.standard_normal(rates.shape)
    seen = elevation > math.radians(8.0)
    seen[silent[0] : silent[1]] = False
    ranges[60, np.flatnonzero(seen[60])[0]] += fault
    lines = ["svid,t_s,pseudorange_m,range_rate_mps,cn0_dbhz"]
    for k in range(len(index)):
        lines += [
            f"{numbers[s]},{true[k] + tag[k] / speed_of_light:.9f},{ranges[k, s]:.6f},{rates[k, s]:.6f},45"
            for s in np.flatnonzero(seen[k])
        ]
    (folder / "ranges.csv").write_text("\n".join(lines) + "\n")
