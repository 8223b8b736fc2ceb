"""A magnetometer that tells the heading."""

from __future__ import annotations

import math

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.navigation.aids.aid import Aid, AidStates, Place
from spoofgym.navigation.error_model import NUM_NAVIGATION


class Magnetometer(Aid):
    """The azimuth of the magnetic field, levelled by the filter's own attitude, against the declination.

    It reads the field's direction in body axes. Turned by the filter's attitude, the field has an azimuth, which is the
    declination where the attitude is right. An error of the heading turns it one to one; one of roll or pitch turns it,
    too, the more the steeper the field. A constant error of the declination (or iron in the vehicle) is a state (Groves
    2013, section 6.1.1). The figures are ours.

    Args:
        sigma: of the white noise of the azimuth, degrees.
        offset: 1 sigma of the constant error when the filter starts, degrees.
        walk: of that error, deg/√s.
        declination: of the field, east of true north, degrees; None = 0 in a simulation, that of the log in a log.
        dip: of the field below the horizon, degrees; a log tells its own.
        rate: of the readings, Hz.
        gate: probability that a good reading is left out; 0 = none is; None = 0 in a simulation, 1e-6 in a log.

    Raises:
        ValueError: a number out of range.
    """

    kind = "magnetometer"
    dimension = 1

    def __init__(
        self,
        *,
        sigma: float = 2.0,
        offset: float = 3.0,
        walk: float = 0.0,
        declination: float | None = None,
        dip: float = 60.0,
        rate: float = 1.0,
        gate: float | None = None,
    ) -> None:
        self.noise = (math.radians(validation.above(self.kind, "sigma", sigma)),)
        first = math.radians(validation.non_negative(self.kind, "offset", offset))
        drift = math.radians(validation.non_negative(self.kind, "walk", walk))
        self.states = AidStates(sigma=(first,), walk=(drift,))
        self.stated = declination
        given = 0.0 if declination is None else declination
        self.declination = math.radians(validation.between(self.kind, "declination", given, -180.0, 180.0))
        self.dip = math.radians(validation.between(self.kind, "dip", dip, -85.0, 85.0))
        self.set_up(rate, gate, sigma=sigma, offset=offset, walk=walk, declination=declination, dip=dip)

    def read(self, place: Place) -> Floats:
        """The field's direction in body axes, (n, 3)."""
        level = math.cos(self.dip)
        field = np.array([level * math.sin(self.declination), level * math.cos(self.declination), -math.sin(self.dip)])
        return np.einsum("nij,i->nj", place.attitude, field)

    def residual(self, place: Place, reading: Floats) -> Floats:
        """Azimuth of the field as the attitude turns it, less the declination, (n, 1), rad, within half a turn."""
        east, north, _ = _turned(place, reading)
        apart = np.arctan2(east, north) - self.declination
        return np.asarray((apart + np.pi) % (2.0 * np.pi) - np.pi)[:, None]

    def observe(self, place: Place, reading: Floats) -> Floats:
        """With the field (e, n, u): φ_U - u (e φ_E + n φ_N) / (e² + n²) - constant error, (n, 1, 10)."""
        east, north, up = _turned(place, reading)
        level = np.maximum(east**2 + north**2, 1e-12 * (up**2 + 1e-30))
        observation = np.zeros((len(reading), 1, NUM_NAVIGATION + 1))
        observation[:, 0, 0] = -up * east / level
        observation[:, 0, 1] = -up * north / level
        observation[:, 0, 2] = 1.0
        observation[:, 0, NUM_NAVIGATION] = -1.0
        return observation


def _turned(place: Place, reading: Floats) -> Floats:
    """The field in ENU, (3, n)."""
    return np.asarray(np.einsum("nij,nj->in", place.attitude, reading))
