"""The wheels of a car: forward speed, and that it neither skids sideways nor leaves the road."""

from __future__ import annotations

import math

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.navigation.aids.aid import Aid, AidStates, Place
from spoofgym.navigation.error_model import NUM_NAVIGATION

FORWARD = (1, 0, 2)
"""Axes of the body (right, forward, up) in the order of the measurement: forward, right, up."""


class WheelSpeed(Aid):
    """The velocity in body axes: forward by the wheels, zero to the right and upwards (non-holonomic constraints).

    Three constant errors are states: the scale of the wheels, and yaw and pitch of the IMU in the vehicle, by which a
    part of the speed seems to go sideways. The constraints hold where the IMU sits: near the rear axle they do, ahead
    of it a car in a turn moves sideways. That is part of ``lateral``, and it is slow, which is why a reading a second
    is usual, although wheels tell more. Groves 2013, chapter 15, has the constraints; the figures are ours.

    Args:
        sigma: of the forward speed, m/s.
        lateral: of the speed to the right, m/s.
        vertical: of the speed upwards in body axes, m/s.
        scale: 1 sigma of the relative error of the wheels' radius.
        mounting: 1 sigma of yaw and pitch of the IMU in the vehicle, degrees.
        rate: of the readings, Hz.
        gate: probability that a good reading is left out; 0 = none is; None = 0 in a simulation, 1e-6 in a log.

    Raises:
        ValueError: a number out of range.
    """

    kind = "wheel-speed"
    dimension = 3

    def __init__(
        self,
        *,
        sigma: float = 0.1,
        lateral: float = 0.2,
        vertical: float = 0.2,
        scale: float = 0.01,
        mounting: float = 0.5,
        rate: float = 1.0,
        gate: float | None = None,
    ) -> None:
        options = {"sigma": sigma, "lateral": lateral, "vertical": vertical}
        self.noise = tuple(validation.above(self.kind, key, value) for key, value in options.items())
        stretch = validation.non_negative(self.kind, "scale", scale)
        angle = math.radians(validation.non_negative(self.kind, "mounting", mounting))
        self.states = AidStates(sigma=(stretch, angle, angle), walk=(0.0, 0.0, 0.0))
        self.set_up(rate, gate, **options, scale=scale, mounting=mounting)

    def read(self, place: Place) -> Floats:
        """The forward speed, (n, 1), m/s."""
        return _in_body(place)[:, 1:2]

    def residual(self, place: Place, reading: Floats) -> Floats:
        """Velocity forward, right and up, less (reading, 0, 0), (n, 3), m/s."""
        apart = _in_body(place)[:, FORWARD]
        apart[:, 0] -= reading[:, 0]
        return apart

    def observe(self, place: Place, reading: Floats) -> Floats:
        """C' δv - C' [v x] φ, and the forward speed on scale, yaw and pitch, (n, 3, 12)."""
        n, down = len(reading), place.attitude.transpose(0, 2, 1)
        cross = np.zeros((n, 3, 3))
        east, north, up = place.velocity.T
        cross[:, 0, 1], cross[:, 0, 2] = -up, north
        cross[:, 1, 0], cross[:, 1, 2] = up, -east
        cross[:, 2, 0], cross[:, 2, 1] = -north, east
        observation = np.zeros((n, 3, NUM_NAVIGATION + 3))
        observation[:, :, 0:3] = -np.einsum("nij,njk->nik", down, cross)[:, FORWARD]
        observation[:, :, 3:6] = down[:, FORWARD]
        observation[:, range(3), range(NUM_NAVIGATION, NUM_NAVIGATION + 3)] = reading
        return observation


def _in_body(place: Place) -> Floats:
    """Velocity to the right, forward and up, (n, 3), m/s."""
    return np.asarray(np.einsum("nij,ni->nj", place.attitude, place.velocity))
