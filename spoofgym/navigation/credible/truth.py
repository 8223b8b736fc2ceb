"""The true motion of a ground robot, sampled as often as its odometer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.burn_in_cache import kept_by_burn_in
from spoofgym.immutable import Immutable
from spoofgym.sensors.odometer import PlanarMotion
from spoofgym.timeline import Timeline


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanarTruth(Immutable):
    """The stretch of a motion in the plane on which a game is played.

    Attributes:
        name: the specification that builds the scenario.
        path: times (J+1,), s, and the step between them, s -> the motion at these times.
        speed: of the motion, m/s.
        interval: between epochs, s.
        step: between samples, s.
        samples: per epoch.
        onset: time of epoch 0, s.
        horizon: K, epochs of the game.
    """

    name: str
    path: Callable[[Floats, float], PlanarMotion]
    speed: float
    interval: float
    step: float
    samples: int
    onset: float
    horizon: int

    @property
    def timeline(self) -> Timeline:
        """The epochs of the game."""
        return Timeline.steady(self.onset, self.interval, self.horizon)

    def times(self, burn_in: int) -> Floats:
        """Scenario time of the epochs -burn_in..K, s."""
        start = self.onset - burn_in * self.interval
        return Timeline.steady(start, self.interval, self.horizon + burn_in).times

    @kept_by_burn_in
    def motion(self, burn_in: int = 0) -> PlanarMotion:
        """The truth at the samples, from one interval before epoch -burn_in on."""
        steps = (burn_in + 1 + self.horizon) * self.samples
        start = self.onset - (burn_in + 1) * self.interval
        times: Floats = start + self.step * np.arange(steps + 1, dtype=np.float64)
        return self.path(times, self.step)

    def _at_epochs(self, samples: Floats) -> Floats:
        """Of planar samples those at the epochs, with a zero height, (E, 3)."""
        chosen = samples[self.samples :: self.samples]
        return np.column_stack([chosen, np.zeros(len(chosen))])

    def velocity(self, burn_in: int = 0) -> Floats:
        """The true velocity at epochs -burn_in..K, (burn_in + K + 1, 3), ENU, m/s."""
        return self._at_epochs(self.motion(burn_in).velocity)

    def velocity_in_steps(self) -> Floats:
        """The true velocity at the moments of the timeline's steps, (K+1, 3), ENU, m/s: no epoch is missing."""
        return self.velocity()

    def track(self) -> Floats:
        """The true position at epochs 0..K from that at epoch 0, (K+1, 3), m ENU."""
        position = self._at_epochs(self.motion().position)
        return position - position[0]
