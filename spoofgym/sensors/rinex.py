"""The broadcast ephemeris of a RINEX navigation file."""

from __future__ import annotations

from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.sensors.ephemeris import COLUMNS, Ephemeris, from_sets, time_between

GPS_NUMBERS = 32
"""PRN of the GPS satellites, the first numbers of RTKLIB."""

FIELDS = {
    "toe": "toes",
    "e": "e",
    "m0": "M0",
    "delta_n": "deln",
    "omega": "omg",
    "omega0": "OMG0",
    "omega_dot": "OMGd",
    "i0": "i0",
    "idot": "idot",
    "cuc": "cuc",
    "cus": "cus",
    "crc": "crc",
    "crs": "crs",
    "cic": "cic",
    "cis": "cis",
    "af0": "f0",
    "af1": "f1",
    "af2": "f2",
}
"""Members of RTKLIB's ``eph_t`` by the names of `Ephemeris`, where both have the same unit."""


def read_rinex(path: str | PathLike[str], time: float) -> Ephemeris:
    """The GPS satellites of a navigation file of RINEX 2 or 3, read by RTKLIB (``pip install "spoofgym[logs]"``).

    Of each satellite the healthy set whose reference time is nearest to ``time`` is taken.

    Args:
        path: of the file.
        time: s of the GPS week, 0 to 604 800.

    Raises:
        ImportError: pyrtklib is not installed.
        FileNotFoundError: there is no such file.
        ValueError: the file has no healthy GPS satellite, or ``time`` is not a finite number.
    """
    moment = validation.finite("rinex", "time", time)
    rtklib = _rtklib()
    if not Path(path).is_file():
        raise FileNotFoundError(f"rinex: there is no file {fspath(path)!r}")
    navigation = rtklib.nav_t()
    rtklib.readrnx(fspath(path), 1, "", None, navigation, None)
    nearest: dict[int, dict[str, float]] = {}
    for index in range(navigation.n):
        message = navigation.eph[index]
        if message.sat > GPS_NUMBERS or message.svh != 0:
            continue
        values = _values(rtklib, message)
        known = nearest.get(message.sat)
        if known is None or _age(moment, values) < _age(moment, known):
            nearest[message.sat] = values
    if not nearest:
        raise ValueError(f"rinex: {fspath(path)!r} has no healthy GPS satellite")
    columns = {name: np.array([values[name] for values in nearest.values()]) for name in COLUMNS}
    return from_sets(np.array(list(nearest), dtype=np.float64), columns)


def _values(rtklib: Any, message: Any) -> dict[str, float]:
    """One ``eph_t`` by the names of `Ephemeris`."""
    values = {name: float(getattr(message, member)) for name, member in FIELDS.items()}
    week = rtklib.Arr1Dint(1)
    values["toc"] = rtklib.time2gpst(message.toc, week)
    values["sqrt_a"] = float(np.sqrt(message.A))
    values["tgd"] = float(message.tgd[0])
    return values


def _age(time: float, values: dict[str, float]) -> float:
    return float(abs(time_between(np.array(time), np.array(values["toe"]))))


def _rtklib() -> Any:
    try:
        import pyrtklib
    except ImportError as error:
        raise ImportError('a RINEX file needs pyrtklib: pip install "spoofgym[logs]"') from error
    return pyrtklib
