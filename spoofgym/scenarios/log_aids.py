"""The aids of a recorded log: which of its tables each of them reads, and when."""

from __future__ import annotations

import copy
from collections.abc import Callable

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.aid_tables import TimedReadings, fields, heights, speeds
from spoofgym.logs.log import Log
from spoofgym.logs.standstill import standing_times
from spoofgym.navigation.aids import Aid
from spoofgym.navigation.aids.magnetometer import Magnetometer

USUAL_GATE = 1e-6
"""Gate of the aids of a log, whose sensors have outliers."""


def read_aid(log: Log, aid: Aid) -> tuple[Aid, TimedReadings]:
    """An aid as it is on a log, and what it reads there, as often as its rate asks for.

    Raises:
        ValueError: the log does not hold what it needs.
    """
    readings = READERS[aid.kind](log)
    if isinstance(aid, Magnetometer) and aid.stated is None:
        if log.declination is None:
            raise ValueError(
                f"log {str(log.folder)!r}: the magnetometer needs the declination: declination_deg in log.toml, or "
                "magnetometer:declination=DEGREES"
            )
        aid = copy.copy(aid)
        aid.declination = log.declination
    return aid, thinned(readings, aid.rate)


def thinned(readings: TimedReadings, rate: float) -> TimedReadings:
    """The first reading in each interval of 1 / rate, Hz."""
    interval = np.floor((readings.time - readings.time[0]) * rate + 1e-6)
    first = np.concatenate([[True], np.diff(interval) > 0.0])
    return TimedReadings(readings.time[first], readings.value[first])


def _standstills(log: Log) -> TimedReadings:
    """A velocity of zero wherever the vehicle stands, (n, 3), m/s."""
    time = standing_times(log)
    if not len(time):
        raise ValueError(f"log {str(log.folder)!r}: zero-velocity: the vehicle never stands, by its inertial samples")
    still: Floats = np.zeros((len(time), 3))
    return TimedReadings(time, still)


READERS: dict[str, Callable[[Log], TimedReadings]] = {
    "barometer": heights,
    "magnetometer": fields,
    "wheel-speed": speeds,
    "zero-velocity": _standstills,
}
"""What reads the log for an aid, by its name."""
