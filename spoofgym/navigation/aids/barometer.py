"""A barometric altimeter."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.navigation.aids.aid import Aid, AidStates, Place
from spoofgym.navigation.error_model import NUM_NAVIGATION

HEIGHT = 8
"""Place of the height in the error state."""


class Barometer(Aid):
    """The height above the ellipsoid by air pressure, with an offset that the filter estimates.

    It reads h + b + white noise. The offset b holds all that is slow: the pressure at sea level, the geoid, the
    temperature of the air. It is a random walk, so that GNSS teaches it slowly and a pull of the height that is slower
    than the walk stays hidden. Groves 2013, section 6.2.1, tells what it errs by; the figures are ours.

    Args:
        sigma: of the white noise, m.
        offset: 1 sigma of b when the filter starts, m.
        walk: of b, m/√s.
        rate: of the readings, Hz.
        gate: probability that a good reading is left out; 0 = none is; None = 0 in a simulation, 1e-6 in a log.

    Raises:
        ValueError: a number out of range.
    """

    kind = "barometer"
    dimension = 1

    def __init__(
        self,
        *,
        sigma: float = 0.5,
        offset: float = 300.0,
        walk: float = 0.05,
        rate: float = 1.0,
        gate: float | None = None,
    ) -> None:
        self.noise = (validation.above(self.kind, "sigma", sigma),)
        first = validation.non_negative(self.kind, "offset", offset)
        self.states = AidStates(sigma=(first,), walk=(validation.non_negative(self.kind, "walk", walk),))
        self.set_up(rate, gate, sigma=sigma, offset=offset, walk=walk)

    def read(self, place: Place) -> Floats:
        """The height, (n, 1), m."""
        return place.position[:, 2:3].copy()

    def residual(self, place: Place, reading: Floats) -> Floats:
        """Height minus reading, (n, 1), m."""
        return place.position[:, 2:3] - reading

    def observe(self, place: Place, reading: Floats) -> Floats:
        """It observes height plus offset, (n, 1, 10)."""
        observation = np.zeros((len(reading), 1, NUM_NAVIGATION + 1))
        observation[:, 0, HEIGHT] = 1.0
        observation[:, 0, NUM_NAVIGATION] = 1.0
        return observation
