"""The states of the tightly coupled filter, and how ranges observe them.

To the fifteen states of the loosely coupled filter (`error_model`) come the receiver's clock, the zenith troposphere
and five states per satellite slot (Kujur 2024, appendix A):

    [φ, δv, δp, gyro bias, accelerometer bias | c dt, its rate | T | (ambiguity, code multipath, carrier multipath,
     I, clock and ephemeris) of each slot],

18 + 5 S in all: 58 with eight satellites. I is the vertical ionospheric delay at the satellite's pierce point. With the
unit vector e to the satellite (ENU), the obliquity F and the mapping function M of its elevation, an error of the
estimate enters the predicted ranges as

    code     -e δp + c dt + M T + F I + clock and ephemeris + code multipath
    carrier  -e δp + c dt + M T - F I + clock and ephemeris + carrier multipath + ambiguity
    rate     -e δv + its rate

so a fix has m = 2 S measurements: the code of every slot, then the carrier, or the range rate, of every slot. What an
empty slot would measure is zero, with a variance of 1: nothing is learnt from it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spoofgym.arrays import Floats
from spoofgym.navigation.error_model import BIAS, INERTIAL, NUM_INERTIAL, POSITION, VELOCITY
from spoofgym.sensors.geometry import SatelliteGeometry
from spoofgym.sensors.ranging import obliquity, troposphere_mapping

__all__ = [
    "AMBIGUITY",
    "BIAS",
    "CARRIER_MULTIPATH",
    "CLOCK",
    "CODE_MULTIPATH",
    "DRIFT",
    "EPHEMERIS",
    "INERTIAL",
    "IONOSPHERE",
    "NONZERO",
    "NUM_COMMON",
    "NUM_INERTIAL",
    "OBSERVABLES",
    "PER_SATELLITE",
    "POSITION",
    "TROPOSPHERE",
    "VELOCITY",
    "num_states",
    "observation_columns",
    "observation_values",
    "slot_states",
]

CLOCK, DRIFT, TROPOSPHERE = range(NUM_INERTIAL, NUM_INERTIAL + 3)
NUM_COMMON = NUM_INERTIAL + 3
PER_SATELLITE = 5
AMBIGUITY, CODE_MULTIPATH, CARRIER_MULTIPATH, IONOSPHERE, EPHEMERIS = range(PER_SATELLITE)

OBSERVABLES = ("carrier", "rate")
"""What a receiver measures beside the code."""

NONZERO = 9
"""Entries of a row of H that need not be zero."""


def num_states(slots: int) -> int:
    """n of a filter with so many satellite slots."""
    return NUM_COMMON + PER_SATELLITE * slots


def slot_states(slots: int) -> NDArray[np.int64]:
    """Places of the states of each slot, (S, 5)."""
    return NUM_COMMON + np.arange(PER_SATELLITE * slots).reshape(slots, PER_SATELLITE)


def observation_columns(slots: int, observable: str) -> NDArray[np.int64]:
    """The states that each measurement observes, (m, 9); a row that observes fewer repeats its last with a zero.

    Args:
        slots: S.
        observable: ``carrier`` or ``rate``, beside the code.
    """
    states = slot_states(slots)
    columns = np.empty((2 * slots, NONZERO), dtype=np.int64)
    columns[:, :3] = range(POSITION.start, POSITION.stop)
    columns[:, 3:5] = CLOCK, TROPOSPHERE
    columns[:slots, 5:] = states[:, [IONOSPHERE, EPHEMERIS, CODE_MULTIPATH, CODE_MULTIPATH]]
    columns[slots:, 5:] = states[:, [IONOSPHERE, EPHEMERIS, CARRIER_MULTIPATH, AMBIGUITY]]
    if observable == "rate":
        columns[slots:, :3] = range(VELOCITY.start, VELOCITY.stop)
        columns[slots:, 3:] = DRIFT
    return columns


def observation_values(geometry: SatelliteGeometry, observable: str) -> Floats:
    """H at these columns, (E, m, 9); zero for empty slots.

    Args:
        geometry: of the epochs, as the receiver sees the satellites.
        observable: ``carrier`` or ``rate``, beside the code.
    """
    epochs, slots = geometry.satellite.shape
    values = np.zeros((epochs, 2, slots, NONZERO))
    values[..., :3] = -geometry.line_of_sight[:, None]
    values[..., 3] = 1.0
    slant = obliquity(geometry.elevation)
    values[:, 0, :, 4] = troposphere_mapping(geometry.elevation)
    values[:, 0, :, 5] = slant
    values[:, 0, :, 6:8] = 1.0
    if observable == "carrier":
        values[:, 1] = values[:, 0]
        values[:, 1, :, 5] = -slant
        values[:, 1, :, 8] = 1.0
    values *= geometry.present[:, None, :, None]
    return values.reshape(epochs, 2 * slots, NONZERO)
