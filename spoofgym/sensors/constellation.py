"""Positions of satellites: the interface of a constellation, and the 24-slot constellation of GPS."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from spoofgym.arrays import Floats, Runs

GRAVITATIONAL_PARAMETER = 3.986005e14
"""GM of the GPS orbits, m^3/s^2 (IS-GPS-200, table 20-IV; not that of WGS-84)."""
EARTH_RATE = 7.2921151467e-5
"""Rotation rate of the Earth in the GPS orbits, rad/s (IS-GPS-200, table 20-IV)."""
SLOT_NAMES = tuple(plane + number for plane in "ABCDEF" for number in "1234")
"""Plane and slot of satellites 1 to 24 of `gps_24`."""

NODES = (272.847, 332.847, 32.847, 92.847, 152.847, 212.847)
"""Right ascension of the ascending node of planes A to F at the epoch, degrees."""
ARGUMENTS = (
    (268.126, 161.786, 11.676, 41.806),
    (80.956, 173.336, 309.976, 204.376),
    (111.876, 11.796, 339.666, 241.556),
    (135.226, 265.446, 35.156, 167.356),
    (197.046, 302.596, 66.066, 333.686),
    (238.886, 345.226, 105.206, 135.346),
)
"""Argument of latitude of slots 1 to 4 of planes A to F at the epoch, degrees."""
SIDEREAL_TIME = 279.06
"""Greenwich sidereal time at the epoch, degrees: 18 h 36 min 14.4 s."""
NODE_RATE = -4.4874e-7
"""Drift of the nodes by the oblateness of the Earth, degrees/s."""


class Constellation(Protocol):
    """Satellites with an orbit each."""

    @property
    def satellites(self) -> Runs:
        """Their numbers, (n,), 0 or more."""

    def states(self, time: Floats) -> tuple[Floats, Floats]:
        """Positions and velocities in the Earth-fixed frame of the same moment.

        Args:
            time: (E,) for all satellites or (E, n), s.

        Returns:
            (E, n, 3) m and (E, n, 3) m/s, ECEF.
        """


@dataclass(frozen=True, kw_only=True)
class CircularOrbits:
    """Satellites on circular orbits of one size and inclination, whose nodes drift.

    Attributes:
        satellites: their numbers, (n,).
        node: longitude of the ascending node at time 0, (n,), rad.
        argument_of_latitude: at time 0, (n,), rad.
        semi_major_axis: m.
        inclination: rad.
        node_rate: drift of the nodes in inertial space, rad/s.
    """

    satellites: Runs
    node: Floats
    argument_of_latitude: Floats
    semi_major_axis: float
    inclination: float
    node_rate: float = 0.0

    def states(self, time: Floats) -> tuple[Floats, Floats]:
        """Positions and velocities in the Earth-fixed frame of the same moment.

        Args:
            time: (E,) for all satellites or (E, n), s.

        Returns:
            (E, n, 3) m and (E, n, 3) m/s, ECEF.
        """
        moments = per_satellite(time)
        motion = np.sqrt(GRAVITATIONAL_PARAMETER / self.semi_major_axis**3)
        argument = self.argument_of_latitude + motion * moments
        along, across = self.semi_major_axis * np.cos(argument), self.semi_major_axis * np.sin(argument)
        node_rate = self.node_rate - EARTH_RATE
        return plane_to_earth(
            along,
            across,
            -motion * across,
            motion * along,
            self.node + node_rate * moments,
            np.full_like(argument, self.inclination),
            node_rate,
            0.0,
        )


def gps_24() -> CircularOrbits:
    """The 24-slot constellation of GPS: six planes A to F of four slots; satellite 1 is A1, 24 is F4.

    The slots, the sidereal time of the epoch and a = 26 559.7 km are those of the GPS SPS Performance Standard (2001),
    table 3-1; its almanac (table A2-1) gives the drift of the nodes and is propagated as in IS-GPS-200, with
    n = √(GM / a³). RTCA DO-229, appendix B, uses the same slots. Time is in seconds since 00:00:00 UTC on 1 July 1993.
    The ground tracks repeat after a sidereal day. They drift by about 0.01 degrees a day; the station keeping of real
    satellites takes this drift out.
    """
    node = np.repeat(np.array(NODES) - SIDEREAL_TIME, 4)
    return CircularOrbits(
        satellites=np.arange(1, 25, dtype=np.int64),
        node=np.deg2rad(node),
        argument_of_latitude=np.deg2rad(np.array(ARGUMENTS).ravel()),
        semi_major_axis=26_559.7e3,
        inclination=np.deg2rad(55.0),
        node_rate=np.deg2rad(NODE_RATE),
    )


def per_satellite(time: Floats) -> Floats:
    """Times that broadcast against the satellites: (E,) becomes (E, 1), (E, n) stays."""
    moments = np.asarray(time, dtype=np.float64)
    return moments[:, None] if moments.ndim == 1 else moments


def plane_to_earth(
    along: Floats,
    across: Floats,
    along_rate: Floats,
    across_rate: Floats,
    node: Floats,
    inclination: Floats,
    node_rate: Floats | float,
    inclination_rate: Floats | float,
) -> tuple[Floats, Floats]:
    """Position and velocity from the plane of the orbit to the Earth-fixed frame (IS-GPS-200, table 20-IV).

    Args:
        along: coordinate toward the ascending node, m.
        across: coordinate in the plane, 90 degrees ahead, m.
        along_rate: its derivative, m/s.
        across_rate: its derivative, m/s.
        node: longitude of the ascending node, rad.
        inclination: rad.
        node_rate: derivative of the longitude, rad/s.
        inclination_rate: rad/s.

    Returns:
        (..., 3) m and (..., 3) m/s, ECEF.
    """
    sin_node, cos_node = np.sin(node), np.cos(node)
    sin_tilt, cos_tilt = np.sin(inclination), np.cos(inclination)
    level, height = across * cos_tilt, across * sin_tilt
    level_rate = across_rate * cos_tilt - height * inclination_rate
    x, y = along * cos_node - level * sin_node, along * sin_node + level * cos_node
    position, velocity = np.empty((*x.shape, 3)), np.empty((*x.shape, 3))
    position[..., 0], position[..., 1], position[..., 2] = x, y, height
    velocity[..., 0] = along_rate * cos_node - level_rate * sin_node - y * node_rate
    velocity[..., 1] = along_rate * sin_node + level_rate * cos_node + x * node_rate
    velocity[..., 2] = across_rate * sin_tilt + level * inclination_rate
    return position, velocity
