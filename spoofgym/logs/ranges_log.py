"""Ranges of a recorded log: the receiver's raw measurements, and what is known of them taken away.

Satellite clock, group delay and the mean troposphere are corrected, and the ionosphere where the log states the
parameters that were broadcast. Of what is left, the part common to all satellites goes into the receiver's clock, the
rest stays as an error of metres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.constants import speed_of_light

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.logs.table import TIMES, read_table, seconds, table_path
from spoofgym.sensors.ephemeris import Ephemeris, read_csv, time_between
from spoofgym.sensors.geometry import SatelliteGeometry, lines_of_sight, received_states
from spoofgym.sensors.klobuchar import Klobuchar
from spoofgym.sensors.ranging import troposphere_mapping

TABLE = "ranges"
RANGE_COLUMNS = ("t_s", "svid", "pseudorange_m", "range_rate_mps", "cn0_dbhz")
RATE_SIGMA_COLUMN = ("rr_std",)
LIMITS = {
    "t_s": TIMES,
    "svid": (1.0, math.inf),
    "pseudorange_m": (-1e12, 1e12),
    "range_rate_mps": (-1e6, 1e6),
    "cn0_dbhz": (0.0, 100.0),
    "rr_std": (0.0, math.inf),
}
"""Valid values, inclusive, of columns with bounds: a receiver's clock may be off by an hour, its rate by 0.3 %."""
MASK = math.radians(5.0)
"""Elevation below which a satellite is not used, rad: that of DO-229."""
CODE_SIGMA = 4.0
"""1 sigma of a pseudorange at `REFERENCE_CN0`, m. Ours, as the next three, from a phone in a city: its residuals grow
with falling C/N0 in this way and are half as large, but multipath is slow, and only with twice that are the innovations
of a filter near its own sigmas. A figure chosen on one log."""
RATE_SIGMA = 0.2
"""1 sigma of a range rate at `REFERENCE_CN0`, m/s."""
REFERENCE_CN0 = 45.0
"""Carrier-to-noise ratio at which the sigmas above hold, dB-Hz."""
STRONGEST_CN0 = 50.0
"""Carrier-to-noise ratio above which ranges become no better, dB-Hz."""
MAX_RATE_SIGMA = 10.0
"""A range rate that its receiver trusts less is none, m/s."""
MAX_AGE = 4.0 * 3600.0
"""Longest time from an ephemeris to a range, s."""
CLOCK_STEP = 1.0
"""Over which the drift of a satellite's clock is formed, s."""


@dataclass(frozen=True, eq=False)
class Ranges:
    """What a receiver measured: E epochs, a slot for each of S satellites, zero where there is nothing.

    Attributes:
        time: of the receiver's clock, s of the GPS week, (E,).
        satellite: PRN, -1 = not measured, (E, S).
        pseudorange: (E, S), m.
        range_rate: (E, S), m/s, positive where the satellite recedes.
        has_rate: where the range rate is usable, (E, S).
        cn0: carrier power over noise density, (E, S), dB-Hz.
        clock_jump: variance of what a step of the receiver's clock leaves in its offset, (E,), m²; 0 as they are read.
        ephemeris: of the S satellites.
        ionosphere: the model that was broadcast; None = its delay is not corrected.
    """

    time: Floats
    satellite: Runs
    pseudorange: Floats
    range_rate: Floats
    has_rate: Flags
    cn0: Floats
    clock_jump: Floats
    ephemeris: Ephemeris
    ionosphere: Klobuchar | None = None


@dataclass(frozen=True, eq=False)
class CorrectedRanges:
    """Ranges that differ from geometry by the receiver's clock and errors; slots as in `Ranges`.

    Attributes:
        geometry: of the satellites above the mask; its time is GPS time of reception, s of the week.
        pseudorange: range plus the receiver's clock, (E, S), m.
        sigma: (E, S), m.
        range_rate: its derivative, (E, S), m/s.
        rate_sigma: (E, S), m/s.
        has_rate: where the range rate is usable, (E, S).
    """

    geometry: SatelliteGeometry
    pseudorange: Floats
    sigma: Floats
    range_rate: Floats
    rate_sigma: Floats
    has_rate: Flags


def read_ranges(folder: str | Path, name: str = TABLE, ionosphere: Klobuchar | None = None) -> Ranges:
    """The ranges of a log to healthy satellites with an ephemeris.

    Args:
        folder: holds ``ephemeris.csv`` and ``ranges.csv``, perhaps gzipped.
        name: of the table, less its ending.
        ionosphere: the model that was broadcast; None = not known.

    Raises:
        ValueError: a file or column is missing, a value is no number or out of range, time decreases, a satellite is
            there twice at one time, none has an ephemeris, or an ephemeris is too old.
    """
    folder = Path(folder)
    path = table_path(folder, name)
    ephemeris_path = folder / "ephemeris.csv"
    if not ephemeris_path.is_file():
        raise ValueError(f"{ephemeris_path} is missing: ranges need the satellites' ephemerides")
    table = read_table(path, [RANGE_COLUMNS], [RATE_SIGMA_COLUMN], LIMITS)
    early = np.flatnonzero(np.diff(table["t_s"]) < 0.0)
    if len(early):
        raise ValueError(f"{path}, line {early[0] + 3}: t_s must not decrease")
    ephemeris = read_csv(ephemeris_path)
    known = np.isin(table["svid"], ephemeris.satellites)
    if not known.any():
        raise ValueError(f"{path}: no range to a healthy satellite of {ephemeris_path}")
    table = {name: values[known] for name, values in table.items()}
    time, epoch = np.unique(table["t_s"], return_inverse=True)
    slot = np.searchsorted(ephemeris.satellites, table["svid"])
    shape = (len(time), len(ephemeris.satellites))
    twice = np.flatnonzero(np.bincount(epoch * shape[1] + slot, minlength=shape[0] * shape[1]) > 1)
    if len(twice):
        which = ephemeris.satellites[twice[0] % shape[1]]
        raise ValueError(f"{path}: satellite {which} is there twice at {seconds(time[twice[0] // shape[1]])} s")
    _check_age(path, time, ephemeris)

    def packed(values: Any, empty: Any) -> Any:
        result = np.full(shape, empty)
        result[epoch, slot] = values
        return result

    trusted = table["rr_std"] <= MAX_RATE_SIGMA if "rr_std" in table else np.ones(len(epoch), dtype=bool)
    return Ranges(
        time=time,
        satellite=packed(table["svid"].astype(np.int64), -1),
        pseudorange=packed(table["pseudorange_m"], 0.0),
        range_rate=packed(table["range_rate_mps"], 0.0),
        has_rate=packed(trusted, False),
        cn0=packed(table["cn0_dbhz"], 0.0),
        clock_jump=np.zeros(len(time)),
        ephemeris=ephemeris,
        ionosphere=ionosphere,
    )


def _check_age(path: Path, time: Floats, ephemeris: Ephemeris) -> None:
    age = np.abs(time_between(time[[0, -1], None], ephemeris.toe))
    if age.max() > MAX_AGE:
        which = ephemeris.satellites[np.argmax(age.max(axis=0))]
        raise ValueError(
            f"{path}: the ephemeris of satellite {which} is {age.max():.0f} s from the ranges; valid is at most "
            f"{MAX_AGE:g} s"
        )


def correct(ranges: Ranges, position: Floats, clock: Floats) -> CorrectedRanges:
    """Place the satellites and take away what is known of the ranges.

    Args:
        ranges: of a receiver.
        position: of the receiver, roughly: latitude rad, longitude rad, height m, (E, 3). A kilometre moves the
            troposphere by centimetres and the frame of reception by less.
        clock: its clock's offset as a range, (E,), m; a kilometre moves a satellite by centimetres.
    """
    received = ranges.time - clock / speed_of_light
    place, velocity, flight = received_states(ranges.ephemeris, position, received)
    sent = received[:, None] - flight
    sight = lines_of_sight(place, position)
    elevation = np.arcsin(np.clip(sight[..., 2], -1.0, 1.0))
    present = (ranges.satellite >= 0) & (elevation >= MASK)
    satellite_clock = ranges.ephemeris.clock(sent) - ranges.ephemeris.tgd
    step = ranges.ephemeris.clock(sent + 0.5 * CLOCK_STEP) - ranges.ephemeris.clock(sent - 0.5 * CLOCK_STEP)
    delay = zenith_troposphere(position)[:, None] * troposphere_mapping(np.maximum(elevation, MASK))
    azimuth = np.mod(np.arctan2(sight[..., 0], sight[..., 1]), 2.0 * np.pi)
    if ranges.ionosphere is not None:
        delay = delay + ranges.ionosphere.delay(position, np.maximum(elevation, MASK), azimuth, received)
    weakness = 10.0 ** ((REFERENCE_CN0 - np.minimum(ranges.cn0, STRONGEST_CN0)) / 20.0)

    def kept(values: Any, empty: Any = 0.0) -> Any:
        return np.where(present.reshape(present.shape + (1,) * (values.ndim - 2)), values, empty)

    return CorrectedRanges(
        geometry=SatelliteGeometry(
            time=received,
            satellite=kept(ranges.satellite, -1),
            position=kept(place),
            velocity=kept(velocity),
            line_of_sight=kept(sight),
            elevation=kept(elevation),
            azimuth=kept(azimuth),
        ),
        pseudorange=kept(ranges.pseudorange + speed_of_light * satellite_clock - delay),
        sigma=kept(CODE_SIGMA * weakness),
        range_rate=kept(ranges.range_rate + speed_of_light * step / CLOCK_STEP),
        rate_sigma=kept(RATE_SIGMA * weakness),
        has_rate=present & ranges.has_rate,
    )


def zenith_troposphere(position: Floats) -> Floats:
    """Mean delay at the zenith in the standard atmosphere with half its moisture (Saastamoinen 1972; RTKLIB's form).

    Args:
        position: latitude rad, longitude rad, height m, (..., 3).

    Returns:
        (...), m.
    """
    latitude, height = position[..., 0], np.clip(position[..., 2], 0.0, 10_000.0)
    pressure = 1013.25 * (1.0 - 2.2557e-5 * height) ** 5.2568
    temperature = 288.15 - 6.5e-3 * height
    vapour = 6.108 * 0.5 * np.exp((17.15 * temperature - 4684.0) / (temperature - 38.45))
    dry = 0.0022768 * pressure / (1.0 - 0.00266 * np.cos(2.0 * latitude) - 0.00028e-3 * height)
    return np.asarray(dry + 0.002277 * (1255.0 / temperature + 0.05) * vapour)
