"""Orbits and clocks of real satellites by the broadcast ephemeris of GPS."""

from __future__ import annotations

import csv
import math
import os
from dataclasses import dataclass, fields
from os import PathLike

import numpy as np
from scipy.constants import speed_of_light

from spoofgym.arrays import Floats, Runs
from spoofgym.sensors.constellation import EARTH_RATE, GRAVITATIONAL_PARAMETER, per_satellite, plane_to_earth

WEEK = 604_800.0
"""Length of a week of GPS time, s."""
RELATIVITY = -2.0 * np.sqrt(GRAVITATIONAL_PARAMETER) / speed_of_light**2
"""F of the relativistic correction of the satellite's clock, s/√m (IS-GPS-200, section 20.3.3.3.3.1)."""
LARGEST_ECCENTRICITY = 0.5
"""That the message can carry; six steps of Newton's method solve Kepler's equation up to it."""
KEPLER_STEPS = 6

COLUMNS = {
    "toe": "toe_s",
    "sqrt_a": "sqrta",
    "e": "ecc",
    "m0": "m0_rad",
    "delta_n": "dn_radps",
    "omega": "omega_rad",
    "omega0": "omega0_rad",
    "omega_dot": "omegadot_radps",
    "i0": "i0_rad",
    "idot": "idot_radps",
    "cuc": "cuc_rad",
    "cus": "cus_rad",
    "crc": "crc_m",
    "crs": "crs_m",
    "cic": "cic_rad",
    "cis": "cis_rad",
    "toc": "toc_s",
    "af0": "af0_s",
    "af1": "af1",
    "af2": "af2",
    "tgd": "tgd_s",
}
"""Columns of the table that `read_csv` reads, by the names of `Ephemeris`."""
LIMITS = {
    "svid": (1.0, 999.0),
    **dict.fromkeys(("toe_s", "toc_s"), (-WEEK, 2.0 * WEEK)),
    "sqrta": (2530.0, 8192.0),
    "ecc": (0.0, 0.49),
    **dict.fromkeys(("m0_rad", "omega_rad", "omega0_rad", "i0_rad"), (-100.0, 100.0)),
    **dict.fromkeys(("dn_radps", "omegadot_radps", "idot_radps"), (-1e-4, 1e-4)),
    **dict.fromkeys(("cuc_rad", "cus_rad", "cic_rad", "cis_rad"), (-0.01, 0.01)),
    **dict.fromkeys(("crc_m", "crs_m"), (-1e4, 1e4)),
    "af0_s": (-1.0, 1.0),
    "af1": (-1e-6, 1e-6),
    "af2": (-1e-12, 1e-12),
    "tgd_s": (-1e-3, 1e-3),
}
"""Valid values, inclusive, of the columns of a table: axes from the Earth's surface to what the message can carry, and
ten times what it can carry of corrections or more; angles may be several turns."""
LARGEST_TABLE = 1_000_000
"""Bytes of a table at most: some thousand satellites."""


@dataclass(frozen=True, kw_only=True)
class Ephemeris:
    """One broadcast ephemeris per satellite, all (n,); names as in IS-GPS-200, table 20-III.

    Attributes:
        satellites: PRN.
        toe: reference time of the orbit, s of the GPS week.
        sqrt_a: √ of the semi-major axis, √m.
        e: eccentricity.
        m0: mean anomaly at ``toe``, rad.
        delta_n: correction of the mean motion, rad/s.
        omega: argument of perigee ω, rad.
        omega0: longitude Ω₀ of the ascending node at the beginning of the week, rad.
        omega_dot: rate of the right ascension of the node, rad/s.
        i0: inclination at ``toe``, rad.
        idot: its rate, rad/s.
        cuc: cosine correction of the argument of latitude, rad.
        cus: sine correction of the argument of latitude, rad.
        crc: cosine correction of the radius, m.
        crs: sine correction of the radius, m.
        cic: cosine correction of the inclination, rad.
        cis: sine correction of the inclination, rad.
        toc: reference time of the clock, s of the GPS week.
        af0: clock offset at ``toc``, s.
        af1: clock drift, s/s.
        af2: its rate, s/s².
        tgd: group delay of L1 against the clock, s; `clock` leaves it out.
    """

    satellites: Runs
    toe: Floats
    sqrt_a: Floats
    e: Floats
    m0: Floats
    delta_n: Floats
    omega: Floats
    omega0: Floats
    omega_dot: Floats
    i0: Floats
    idot: Floats
    cuc: Floats
    cus: Floats
    crc: Floats
    crs: Floats
    cic: Floats
    cis: Floats
    toc: Floats
    af0: Floats
    af1: Floats
    af2: Floats
    tgd: Floats

    def __post_init__(self) -> None:
        number = len(self.satellites)
        if number == 0:
            raise ValueError("ephemeris: there must be one satellite or more, got none")
        if len(np.unique(self.satellites)) < number:
            raise ValueError(f"ephemeris: every satellite must be there once, got {self.satellites.tolist()}")
        for name in COLUMNS:
            values = getattr(self, name)
            if values.shape != (number,) or not np.isfinite(values).all():
                raise ValueError(f"ephemeris: {name} must be {number} finite numbers, got {values!r}")
        if not ((self.e >= 0.0) & (self.e < LARGEST_ECCENTRICITY)).all():
            raise ValueError(f"ephemeris: e must be from 0 to less than {LARGEST_ECCENTRICITY}, got {self.e!r}")
        if not (self.sqrt_a > 0.0).all():
            raise ValueError(f"ephemeris: sqrt_a must be greater than 0, got {self.sqrt_a!r}")

    def states(self, time: Floats) -> tuple[Floats, Floats]:
        """Positions and velocities in the Earth-fixed frame of the same moment (IS-GPS-200, table 20-IV).

        The message is meant for two hours around ``toe``; how far off is the caller's concern.

        Args:
            time: s of the GPS week, (E,) for all satellites or (E, n). A time is taken in the week in which it is
                nearest to the reference time.

        Returns:
            (E, n, 3) m and (E, n, 3) m/s, ECEF.
        """
        since = _since(time, self.toe)
        anomaly = self._eccentric_anomaly(since)
        cosine, sine = np.cos(anomaly), np.sin(anomaly)
        nearness = 1.0 - self.e * cosine
        anomaly_rate = self._mean_motion / nearness
        minor = np.sqrt(1.0 - self.e**2)
        phase = np.arctan2(minor * sine, cosine - self.e) + self.omega
        phase_rate = anomaly_rate * minor / nearness

        twice_cosine, twice_sine = np.cos(2.0 * phase), np.sin(2.0 * phase)
        latitude = phase + self.cus * twice_sine + self.cuc * twice_cosine
        latitude_rate = phase_rate * (1.0 + 2.0 * (self.cus * twice_cosine - self.cuc * twice_sine))
        radius = self.sqrt_a**2 * nearness + self.crs * twice_sine + self.crc * twice_cosine
        radius_rate = self.sqrt_a**2 * self.e * sine * anomaly_rate
        radius_rate = radius_rate + 2.0 * phase_rate * (self.crs * twice_cosine - self.crc * twice_sine)
        inclination = self.i0 + self.idot * since + self.cis * twice_sine + self.cic * twice_cosine
        inclination_rate = self.idot + 2.0 * phase_rate * (self.cis * twice_cosine - self.cic * twice_sine)

        node_rate = self.omega_dot - EARTH_RATE
        along, across = radius * np.cos(latitude), radius * np.sin(latitude)
        return plane_to_earth(
            along,
            across,
            radius_rate * np.cos(latitude) - across * latitude_rate,
            radius_rate * np.sin(latitude) + along * latitude_rate,
            self.omega0 + node_rate * since - EARTH_RATE * self.toe,
            inclination,
            node_rate,
            inclination_rate,
        )

    def clock(self, time: Floats) -> Floats:
        """Offset of the satellites' clocks from GPS time, relativistic term included, group delay not.

        Δt = af0 + af1 (t - toc) + af2 (t - toc)² + F e √A sin E (IS-GPS-200, section 20.3.3.3.3.1). A pseudorange is
        shorter by c Δt, that of L1 alone by c (Δt - tgd).

        Args:
            time: s of the GPS week, (E,) for all satellites or (E, n).

        Returns:
            (E, n), s.
        """
        since = _since(time, self.toc)
        relativistic = RELATIVITY * self.e * self.sqrt_a * np.sin(self._eccentric_anomaly(_since(time, self.toe)))
        return self.af0 + self.af1 * since + self.af2 * since**2 + relativistic

    @property
    def _mean_motion(self) -> Floats:
        """n = √(GM / A³) + Δn, rad/s."""
        return np.sqrt(GRAVITATIONAL_PARAMETER) / self.sqrt_a**3 + self.delta_n

    def _eccentric_anomaly(self, since: Floats) -> Floats:
        """E of Kepler's equation M = E - e sin E; a fixed number of steps, so that no satellite depends on another."""
        mean = self.m0 + self._mean_motion * since
        anomaly = mean + self.e * np.sin(mean)
        for _ in range(KEPLER_STEPS):
            anomaly = anomaly - (anomaly - self.e * np.sin(anomaly) - mean) / (1.0 - self.e * np.cos(anomaly))
        return anomaly


def read_csv(path: str | PathLike[str]) -> Ephemeris:
    """The healthy satellites of a table with a row for each, columns as in `COLUMNS`, ``svid`` and ``sv_health``.

    Angles are in radians, lengths in metres, times in seconds of the GPS week.

    Raises:
        ValueError: the file is too large or cannot be read, a column is missing, a value is not a number, or one of a
            healthy satellite out of `LIMITS`, such a satellite is there twice, or none is healthy.
    """
    lines, rows = _rows(path)
    wanted = ["svid", "sv_health", *COLUMNS.values()]
    missing = [name for name in wanted if not rows or name not in rows[0]]
    if missing:
        raise ValueError(f"ephemeris {path}: columns {', '.join(missing)} are missing")
    table = np.array(
        [[_number(path, line, name, row[name]) for name in wanted] for line, row in zip(lines, rows, strict=True)]
    )
    healthy = np.flatnonzero(table[:, 1] == 0.0)
    if len(healthy) == 0:
        raise ValueError(f"ephemeris {path}: there must be one satellite or more that is healthy (sv_health = 0)")
    seen: dict[float, int] = {}
    for place in healthy.tolist():
        _check_row(path, lines[place], dict(zip(wanted, table[place].tolist(), strict=True)))
        first = seen.setdefault(table[place, 0], lines[place])
        if first != lines[place]:
            raise ValueError(
                f"ephemeris {path}, line {lines[place]}: satellite {table[place, 0]:.0f} is there twice, first in line "
                f"{first}"
            )
    return from_sets(table[healthy, 0], dict(zip(COLUMNS, table[healthy, 2:].T, strict=True)))


def _rows(path: str | PathLike[str]) -> tuple[list[int], list[dict[str, str | None]]]:
    """The rows of a table below its header, and the lines in which they end."""
    size = os.stat(path).st_size
    if size > LARGEST_TABLE:
        raise ValueError(f"ephemeris {path}: has {size} bytes; valid are {LARGEST_TABLE} at most")
    lines, rows = [], []
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            for row in reader:
                lines.append(reader.line_num)
                rows.append(dict(row))
    except UnicodeDecodeError as error:
        raise ValueError(f"ephemeris {path}: cannot be read: it is no text in UTF-8: {error.reason}") from None
    except csv.Error as error:
        raise ValueError(f"ephemeris {path}, line {reader.line_num}: cannot be read: {error}") from None
    return lines, rows


def _check_row(path: str | PathLike[str], line: int, values: dict[str, float]) -> None:
    """Refuse what no broadcast message of a satellite says."""
    for name, (low, high) in LIMITS.items():
        if not low <= values[name] <= high:
            raise ValueError(
                f"ephemeris {path}, line {line}: {name} must be between {low:g} and {high:g}, got {values[name]!r}"
            )
    if values["svid"] % 1.0:
        raise ValueError(f"ephemeris {path}, line {line}: svid must be a whole number, got {values['svid']!r}")


def _number(path: str | PathLike[str], line: int, name: str, text: str | None) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"ephemeris {path}, line {line}: {name} must be a finite number, got {text!r:.100}")
    return value


def from_sets(satellites: Floats, values: dict[str, Floats]) -> Ephemeris:
    """An ephemeris of these columns, satellites in ascending order.

    Args:
        satellites: PRN, (n,).
        values: by name, all of `Ephemeris` but ``satellites``, (n,).

    Raises:
        ValueError: as `Ephemeris`.
    """
    order = np.argsort(satellites, kind="stable")
    numbers = np.asarray(satellites)[order].astype(np.int64)
    names = [field.name for field in fields(Ephemeris) if field.name != "satellites"]
    return Ephemeris(satellites=numbers, **{name: np.asarray(values[name])[order] for name in names})


def time_between(time: Floats, reference: Floats) -> Floats:
    """Time minus reference, in the week in which the two are nearest (IS-GPS-200, table 20-IV, note), s."""
    difference = time - reference
    return difference - WEEK * np.floor(difference / WEEK + 0.5)


def _since(time: Floats, reference: Floats) -> Floats:
    return time_between(per_satellite(time), reference)
