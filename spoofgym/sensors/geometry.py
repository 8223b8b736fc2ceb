"""The geometry of a receiver and a constellation: satellites in view, lines of sight, dilution of precision."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.constants import speed_of_light

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.geodesy import ecef_to_enu_rotation, geodetic_to_ecef
from spoofgym.kernels import njit
from spoofgym.sensors.constellation import EARTH_RATE
from spoofgym.sensors.constellation import Constellation as Constellation

TYPICAL_FLIGHT_TIME = 0.075
"""Of a GPS signal, s: between that from the zenith and that from the horizon."""
MINIMUM_SATELLITES = 4
MOST_SLOTS = 100
SINGULAR = 1e-12
"""Share of a diagonal element of the normal matrix that its pivot must leave."""


@dataclass(frozen=True)
class SatelliteGeometry:
    """The satellites in view of a receiver, each in a slot that it keeps while it is in view.

    An empty slot is zero everywhere, and -1 in ``satellite``.

    Attributes:
        time: of reception, (E,), s.
        satellite: number of the satellite in a slot, (E, S); -1 = empty.
        position: of the satellite when it sent what is received now, in the ECEF frame of the moment of reception: the
            geometric range is the distance to it, (E, S, 3), m.
        velocity: rate of change of ``position`` for a receiver at rest: the range rate is
            line of sight · (velocity - receiver velocity), (E, S, 3), m/s. A receiver that moves changes the time of
            flight, too, which is left out (3e-6 of its own velocity).
        line_of_sight: unit vector from the receiver to the satellite, ENU, (E, S, 3).
        elevation: above the horizon, (E, S), rad.
        azimuth: from north to east, from 0 to 2π, (E, S), rad.
    """

    time: Floats
    satellite: Runs
    position: Floats
    velocity: Floats
    line_of_sight: Floats
    elevation: Floats
    azimuth: Floats

    @property
    def num_slots(self) -> int:
        """S."""
        return self.satellite.shape[1]

    @cached_property
    def present(self) -> Flags:
        """Slots that hold a satellite, (E, S)."""
        return self.satellite >= 0

    @cached_property
    def started(self) -> Flags:
        """Slots with another satellite than at the epoch before; at the first epoch all present ones, (E, S)."""
        changed = self.present.copy()
        changed[1:] &= self.satellite[1:] != self.satellite[:-1]
        return changed


def view(
    constellation: Constellation,
    receiver_position: Floats,
    time: Floats,
    mask: float = math.radians(5.0),
    slots: int | None = None,
) -> SatelliteGeometry:
    """The satellites above the mask along a path.

    A satellite keeps its slot until it sets; one that rises takes the first free slot, the highest first where several
    wait. With fewer slots than satellites, those that find none free wait.

    Args:
        constellation: the satellites.
        receiver_position: latitude rad, longitude rad, height m, (E, 3) or (3,).
        time: of reception, in the time of the constellation, (E,), s.
        mask: lowest elevation that is in view, rad.
        slots: S; None = the largest number in view at once.

    Raises:
        ValueError: shapes do not fit, or ``slots`` or ``mask`` is out of range.
    """
    moments = np.asarray(time, dtype=np.float64)
    if moments.ndim != 1 or len(moments) == 0:
        raise ValueError(f"view: time must be one axis of one epoch or more, got shape {moments.shape}")
    path = np.broadcast_to(np.asarray(receiver_position, dtype=np.float64), (len(moments), 3))
    lowest = validation.finite("view", "mask", mask)
    if not -0.5 * math.pi <= lowest < 0.5 * math.pi:
        raise ValueError(f"view: mask must be from -pi/2 to less than pi/2, got {mask!r}")
    position, velocity, _ = received_states(constellation, path, moments)
    sight = lines_of_sight(position, path)
    elevation = np.arcsin(np.clip(sight[..., 2], -1.0, 1.0))
    visible = elevation >= lowest
    width = int(visible.sum(axis=1).max()) if slots is None else validation.whole("view", "slots", slots, 1, MOST_SLOTS)
    column = _assign(visible, elevation, width)
    present = column >= 0

    def gather(values: Any) -> Any:
        chosen = np.take_along_axis(values, column.reshape(*column.shape, *[1] * (values.ndim - 2)), axis=1)
        chosen[~present] = 0
        return chosen

    sight = gather(sight)
    return SatelliteGeometry(
        time=moments,
        satellite=np.where(present, constellation.satellites[column], -1),
        position=gather(position),
        velocity=gather(velocity),
        line_of_sight=sight,
        elevation=gather(elevation),
        azimuth=np.mod(np.arctan2(sight[..., 0], sight[..., 1]), 2.0 * np.pi),
    )


def received_states(
    constellation: Constellation, receiver_position: Floats, time: Floats
) -> tuple[Floats, Floats, Floats]:
    """All satellites as a receiver sees them, above and below its horizon.

    The time of flight τ solves c τ = |R(ω τ) r(t - τ) - receiver|, where R turns the Earth-fixed frame of the
    transmission into that of the reception. It is found on the tangent of the orbit, where τ is right to 1e-12 s.

    Args:
        constellation: the satellites.
        receiver_position: latitude rad, longitude rad, height m, (E, 3).
        time: of reception, (E,), s.

    Returns:
        Position (E, n, 3) in m and velocity (E, n, 3) in m/s as in `SatelliteGeometry`, and τ (E, n) in s.
    """
    receiver = geodetic_to_ecef(receiver_position)[:, None]
    moments = np.asarray(time, dtype=np.float64)[:, None]
    position, velocity = constellation.states(moments[:, 0] - TYPICAL_FLIGHT_TIME)
    flight_time = np.full(position.shape[:2], TYPICAL_FLIGHT_TIME)
    for _ in range(2):
        moved = position + velocity * (TYPICAL_FLIGHT_TIME - flight_time)[..., None]
        flight_time = _length(_turn(moved, flight_time) - receiver) / speed_of_light
    position, velocity = constellation.states(moments - flight_time)
    seen = _turn(position, flight_time)
    return seen, _received_velocity(seen, _turn(velocity, flight_time), receiver), flight_time


def lines_of_sight(position: Floats, receiver_position: Floats) -> Floats:
    """Unit vectors from receivers to satellites.

    Args:
        position: of the satellites, (E, S, 3), ECEF, m.
        receiver_position: latitude rad, longitude rad, height m, (E, 3).

    Returns:
        (E, S, 3), ENU.
    """
    away = position - geodetic_to_ecef(receiver_position)[:, None]
    rotation = ecef_to_enu_rotation(receiver_position)[:, None]
    enu = (
        rotation[..., 0] * away[..., 0, None]
        + rotation[..., 1] * away[..., 1, None]
        + rotation[..., 2] * away[..., 2, None]
    )
    return enu / _length(away)[..., None]


def dilution(line_of_sight: Floats, present: Flags) -> Floats:
    """Dilution of precision: 1-sigma error of the fix per 1-sigma error of every range (Kaplan & Hegarty, section 7.3).

    Args:
        line_of_sight: (E, S, 3), ENU.
        present: (E, S).

    Returns:
        (E, 5): GDOP, PDOP, HDOP, VDOP, TDOP; NaN where fewer than four satellites, or their geometry, give no fix.
    """
    variance = np.diagonal(normal_inverse(line_of_sight, np.asarray(present, dtype=np.float64)), axis1=1, axis2=2)
    east, north, up, clock = (variance[:, i] for i in range(4))
    position = east + north + up
    return np.sqrt(np.stack([position + clock, position, east + north, up, clock], axis=1))


def normal_inverse(line_of_sight: Floats, weight: Floats) -> Floats:
    """(G' W G)⁻¹ with the rows [-line of sight, 1] of G: the cofactor matrix of position and clock.

    Args:
        line_of_sight: (E, S, 3), ENU or ECEF.
        weight: 1/σ² of every range, 0 = not used, (E, S).

    Returns:
        (E, 4, 4): position in the frame of the lines of sight and clock (as a range); NaN where fewer than four
        satellites, or their geometry, give no fix.
    """
    inverse = np.empty((len(line_of_sight), 4, 4))
    _normal_inverses(np.ascontiguousarray(line_of_sight), np.ascontiguousarray(weight, dtype=np.float64), inverse)
    return inverse


@njit(cache=True, nogil=True, error_model="numpy")
def invert_normal(line_of_sight: Floats, weight: Floats, inverse: Floats) -> None:
    """(G' W G)⁻¹ of one epoch by Cholesky's factors; NaN where the matrix is singular.

    Args:
        line_of_sight: (S, 3).
        weight: (S,).
        inverse: (4, 4), written.
    """
    normal = np.zeros((4, 4))
    row = np.ones(4)
    number = 0
    for s in range(len(weight)):
        if weight[s] == 0.0:
            continue
        number += 1
        for i in range(3):
            row[i] = -line_of_sight[s, i]
        for i in range(4):
            for j in range(i + 1):
                normal[i, j] += weight[s] * row[i] * row[j]
    inverse[:] = np.nan
    if number < MINIMUM_SATELLITES:
        return
    # the lower triangle L of L L' = G' W G
    for j in range(4):
        diagonal = normal[j, j]
        for k in range(j):
            normal[j, j] -= normal[j, k] ** 2
        if not normal[j, j] > SINGULAR * diagonal:
            return
        normal[j, j] = math.sqrt(normal[j, j])
        for i in range(j + 1, 4):
            for k in range(j):
                normal[i, j] -= normal[i, k] * normal[j, k]
            normal[i, j] /= normal[j, j]
    for column in range(4):
        for i in range(4):
            value = 1.0 if i == column else 0.0
            for k in range(i):
                value -= normal[i, k] * inverse[k, column]
            inverse[i, column] = value / normal[i, i]
        for i in range(3, -1, -1):
            value = inverse[i, column]
            for k in range(i + 1, 4):
                value -= normal[k, i] * inverse[k, column]
            inverse[i, column] = value / normal[i, i]


@njit(cache=True, nogil=True, error_model="numpy")
def _normal_inverses(line_of_sight: Floats, weight: Floats, inverse: Floats) -> None:
    for e in range(len(inverse)):
        invert_normal(line_of_sight[e], weight[e], inverse[e])


def _received_velocity(position: Floats, velocity: Floats, receiver: Floats) -> Floats:
    """Rate of change of R(ω τ) r(t - τ): τ changes at ρ'/c, and with it the moment of transmission and the turn."""
    sight = position - receiver
    sight /= _length(sight)[..., None]
    turning = np.stack(
        [EARTH_RATE * position[..., 1], -EARTH_RATE * position[..., 0], np.zeros(position.shape[:-1])], axis=-1
    )
    excess = turning - velocity
    flight_rate = _along(sight, velocity) / (speed_of_light - _along(sight, excess))
    return velocity + flight_rate[..., None] * excess


def _turn(vector: Floats, flight_time: Floats) -> Floats:
    """Components in the Earth-fixed frame as it stands ``flight_time`` later."""
    sine, cosine = np.sin(EARTH_RATE * flight_time), np.cos(EARTH_RATE * flight_time)
    turned = np.empty_like(vector)
    turned[..., 0] = cosine * vector[..., 0] + sine * vector[..., 1]
    turned[..., 1] = cosine * vector[..., 1] - sine * vector[..., 0]
    turned[..., 2] = vector[..., 2]
    return turned


def _along(left: Floats, right: Floats) -> Floats:
    return left[..., 0] * right[..., 0] + left[..., 1] * right[..., 1] + left[..., 2] * right[..., 2]


def _length(vector: Floats) -> Floats:
    return np.sqrt(_along(vector, vector))


def _assign(visible: Flags, elevation: Floats, slots: int) -> Runs:
    """Index of the satellite in every slot, (E, slots); -1 = empty."""
    held = np.full(slots, -1, dtype=np.int64)
    column = np.empty((len(visible), slots), dtype=np.int64)
    changes = np.flatnonzero((visible[1:] != visible[:-1]).any(axis=1)) + 1
    starts = [0, *changes.tolist()]
    for start, end in zip(starts, [*starts[1:], len(visible)], strict=True):
        held[(held >= 0) & ~visible[start, held]] = -1
        waiting = np.setdiff1d(np.flatnonzero(visible[start]), held)
        waiting = waiting[np.argsort(-elevation[start, waiting], kind="stable")]
        free = np.flatnonzero(held < 0)
        number = min(len(waiting), len(free))
        held[free[:number]] = waiting[:number]
        column[start:end] = held
    return column
