"""A vehicle that stands still knows that it does."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats
from spoofgym.navigation.aids.aid import Aid, AidStates, Place
from spoofgym.navigation.error_model import NUM_NAVIGATION

STANDSTILL = 0.05
"""Speed up to which a simulated vehicle counts as standing, m/s."""


class ZeroVelocity(Aid):
    """The velocity while the vehicle stands: zero (a zero-velocity update).

    In a simulation it stands where its true speed is 0.05 m/s or less. In a log that is told by the inertial samples
    alone (`spoofgym.scenarios.log_aids`). It has no states. Groves 2013, chapter 15, has the update; the
    figures are ours.

    Args:
        sigma: of the velocity at a standstill per axis, m/s.
        rate: of the updates while it stands, Hz.
        gate: probability that a good one is left out; 0 = none is; None = 0 in a simulation, 1e-6 in a log.

    Raises:
        ValueError: a number out of range.
    """

    kind = "zero-velocity"
    dimension = 3

    def __init__(self, *, sigma: float = 0.05, rate: float = 1.0, gate: float | None = None) -> None:
        self.noise = (validation.above(self.kind, "sigma", sigma),) * 3
        self.states = AidStates()
        self.set_up(rate, gate, sigma=sigma)

    def read(self, place: Place) -> Floats:
        """The velocity, (n, 3), m/s: that of a simulated vehicle may creep."""
        return place.velocity.copy()

    def residual(self, place: Place, reading: Floats) -> Floats:
        """Velocity less reading, (n, 3), m/s."""
        return place.velocity - reading

    def observe(self, place: Place, reading: Floats) -> Floats:
        """It observes the velocity, (n, 3, 9)."""
        observation = np.zeros((len(reading), 3, NUM_NAVIGATION))
        observation[:, range(3), range(3, 6)] = 1.0
        return observation

    def measures(self, place: Place) -> Flags:
        """Whether the vehicle stands, (n,)."""
        return np.asarray((place.velocity**2).sum(axis=1) <= STANDSTILL**2)
