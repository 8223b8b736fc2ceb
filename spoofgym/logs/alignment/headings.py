"""Headings that a log tells without any motion: stated in ``log.toml``, or of its magnetometer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.logs.log import Log
from spoofgym.logs.magnetometer import read_magnetometer
from spoofgym.mechanization import attitude_matrix

UNKNOWN_SIGMA = np.pi / np.sqrt(3.0)
"""Of a heading of which nothing is known, rad: that of a uniform one."""
MAGNETIC_SIGMA = np.radians(10.0)
"""Of a magnetic heading whose declination is stated, rad: iron nearby, tilt, mounting."""
UNDECLINED_SIGMA = np.radians(20.0)
"""Of one without it, rad: half of the inhabited places have less than 10 degrees of declination."""
WINDOW = 1.0
"""Time to either side over which the magnetic field is averaged, s."""


@dataclass(frozen=True)
class Heading:
    """A heading.

    Attributes:
        value: clockwise from true north, rad.
        sigma: rad.
        source: for a reader.
    """

    value: float
    sigma: float
    source: str


def heading_at(log: Log, time: float, up: Floats) -> Heading:
    """The best heading of a moment that does not come from motion.

    Args:
        log: whose stated heading counts before its magnetometer.
        time: s.
        up: vertical direction in body axes, (3,), of length 1.

    Raises:
        ValueError: the table of the magnetometer is damaged.
    """
    if log.heading is not None:
        return Heading(log.heading.value, log.heading.sigma, "heading as stated in log.toml")
    field = read_magnetometer(log.folder, log.rotation)
    if field is None:
        return Heading(0.0, UNKNOWN_SIGMA, "heading unknown")
    near = np.abs(field.time - time) <= WINDOW
    if not near.any():
        return Heading(0.0, UNKNOWN_SIGMA, "heading unknown: magnetometer silent")
    east = np.cross(field.body[near].mean(axis=0), up)
    if np.linalg.norm(east) == 0.0:
        return Heading(0.0, UNKNOWN_SIGMA, "heading unknown: magnetic field vertical")
    # body axes of a heading of zero, tilted as the vehicle is: the angle of magnetic east in them is minus the heading
    pitch, roll = np.arctan2(up[1], np.hypot(up[0], up[2])), np.arctan2(-up[0], up[2])
    level = attitude_matrix(pitch, roll, 0.0) @ east
    magnetic = float(np.arctan2(level[1], level[0]))
    if log.declination is None:
        return Heading(magnetic, UNDECLINED_SIGMA, "heading magnetic, declination not stated")
    return Heading(magnetic + log.declination, MAGNETIC_SIGMA, "heading magnetic")
