"""A synthetic log of an antenna that rests, with raw ranges and no IMU, for tests."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from scipy.constants import speed_of_light

from spoofgym.logs.ranges_log import CODE_SIGMA, RATE_SIGMA
from spoofgym.sensors.ephemeris import read_csv
from tests.logs.range_drive import flights
from tests.logs.test_ranges_log import FIRST, START, write_ephemeris

INTERVAL = 0.2
DRIFT = 0.5
"""Of the receiver's clock, m/s."""
OFFSET = 3e4
"""Of the receiver's clock at the first epoch, m."""
HALF = 0.05
"""Time to either side over which a range rate is a difference, s."""


@cache
def _true(folder: Path, epochs: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    time = FIRST + INTERVAL * np.arange(epochs)
    place = np.tile(START, (epochs, 1))
    ranges, elevation = flights(folder, place, time)
    rates = (flights(folder, place, time + HALF)[0] - flights(folder, place, time - HALF)[0]) / (2.0 * HALF)
    return ranges, rates, elevation


_SKY: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []


def write_resting(
    folder: Path,
    *,
    epochs: int = 500,
    noise: float = 0.2,
    seed: int = 0,
    clock: np.ndarray | None = None,
    code: np.ndarray | None = None,
    table: str = "ranges",
    lines: str = "",
) -> Path:
    """A log of 5 Hz ranges.

    Args:
        folder: to be made.
        epochs: E.
        noise: share of the filter's white noise.
        seed: of it.
        clock: what a spoofer adds to the receiver's clock, (E,), m; its range rates follow.
        code: what one adds to every code alone, (E,), m.
        table: where the ranges go.
        lines: more of ``log.toml``.
    """
    folder.mkdir(exist_ok=True)
    latitude, longitude, height = np.degrees(START[0]), np.degrees(START[1]), START[2]
    if table == "ranges":
        folder.joinpath("log.toml").write_text(
            f"imu_to_body_frd = []\nstart_s = {FIRST + 1.0}\nstatic = true\nantenna_lat_deg = {latitude:.12f}\n"
            f"antenna_lon_deg = {longitude:.12f}\nantenna_h_m = {height}\n{lines}"
        )
        write_ephemeris(folder / "ephemeris.csv")
    if not _SKY or len(_SKY[0][0]) < epochs:
        _SKY[:] = [_true(folder, max(epochs, 500))]
    ranges, rates, elevation = (values[:epochs].copy() for values in _SKY[0])
    generator, numbers = np.random.default_rng(seed), read_csv(folder / "ephemeris.csv").satellites
    since = INTERVAL * np.arange(epochs)
    own = OFFSET + DRIFT * since
    pulled = np.zeros(epochs) if clock is None else clock
    parted = np.zeros(epochs) if code is None else code
    ranges += (own + pulled + parted)[:, None] + noise * CODE_SIGMA * generator.standard_normal(ranges.shape)
    rates += (DRIFT + np.gradient(pulled, INTERVAL))[:, None]
    rates += noise * RATE_SIGMA * generator.standard_normal(rates.shape)
    rows = ["svid,t_s,pseudorange_m,range_rate_mps,cn0_dbhz"]
    for k in range(epochs):
        tag = FIRST + since[k] + own[k] / speed_of_light
        rows += [
            f"{numbers[s]},{tag:.9f},{ranges[k, s]:.6f},{rates[k, s]:.6f},45"
            for s in np.flatnonzero(elevation[k] > 0.14)
        ]
    (folder / f"{table}.csv").write_text("\n".join(rows) + "\n")
    return folder


def pull(epochs: int, begin: int, acceleration: float, until: int) -> np.ndarray:
    """A clock that is pulled with this acceleration, m/s², from one epoch to another and then at a steady rate, m."""
    index = np.arange(epochs)
    rate = acceleration * INTERVAL * (np.clip(index, begin, until) - begin)
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * INTERVAL)])
