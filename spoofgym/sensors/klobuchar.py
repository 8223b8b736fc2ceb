"""The ionospheric model of the GPS broadcast (Klobuchar 1987; IS-GPS-200, section 20.3.3.5.2.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.constants import speed_of_light

from spoofgym.arrays import Floats

TERMS = 4
DAY = 86_400.0
NIGHT = 5e-9
"""Zenith delay at night, s."""
SHORTEST_PERIOD = 72_000.0
"""s."""
NOON = 50_400.0
"""Local time of the largest delay, s."""
FARTHEST = 0.416
"""Latitude of a pierce point at most, semicircles."""


@dataclass(frozen=True)
class Klobuchar:
    """Its eight parameters, as they are broadcast.

    Attributes:
        alpha: of the amplitude, s, s/semicircle, ..., four of them.
        beta: of the period, s, s/semicircle, ..., four of them.
    """

    alpha: tuple[float, ...]
    beta: tuple[float, ...]

    def delay(self, position: Floats, elevation: Floats, azimuth: Floats, time: Floats) -> Floats:
        """Delay of the code on L1, (E, S), m.

        Args:
            position: of the receiver, latitude rad, longitude rad, height m, (E, 3).
            elevation: of the satellites, (E, S), rad, 0 or more.
            azimuth: clockwise from north, (E, S), rad.
            time: of the GPS week, (E,), s.
        """
        latitude, longitude = position[:, :1] / np.pi, position[:, 1:2] / np.pi
        height = elevation / np.pi
        angle = 0.0137 / (height + 0.11) - 0.022
        pierced = np.clip(latitude + angle * np.cos(azimuth), -FARTHEST, FARTHEST)
        meridian = longitude + angle * np.sin(azimuth) / np.cos(np.pi * pierced)
        magnetic = pierced + 0.064 * np.cos(np.pi * (meridian - 1.617))
        local = np.mod(0.5 * DAY * meridian + time[:, None], DAY)
        slant = 1.0 + 16.0 * (0.53 - height) ** 3
        amplitude = np.maximum(_polynomial(self.alpha, magnetic), 0.0)
        period = np.maximum(_polynomial(self.beta, magnetic), SHORTEST_PERIOD)
        phase = 2.0 * np.pi * (local - NOON) / period
        day = np.where(np.abs(phase) < 1.57, amplitude * (1.0 - phase**2 / 2.0 + phase**4 / 24.0), 0.0)
        return np.asarray(speed_of_light * slant * (NIGHT + day))


def _polynomial(coefficients: tuple[float, ...], value: Floats) -> Floats:
    return np.asarray(np.polynomial.polynomial.polyval(value, np.array(coefficients)))
