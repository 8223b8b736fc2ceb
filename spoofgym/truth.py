"""The vehicle's true motion in a game: its epochs, the velocity and the track there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.geodesy import position_difference
from spoofgym.immutable import Immutable
from spoofgym.timeline import Timeline
from spoofgym.trajectory import Trajectory
from spoofgym.validation import written

ROUNDING = 1e-9
"""Times closer than this are the same, s."""


class Truth(Protocol):
    """What a game asks of the true motion. Epoch 0 is the last clean one; a burn-in lies before it."""

    @property
    def name(self) -> str:
        """The specification that builds the scenario."""

    @property
    def timeline(self) -> Timeline:
        """The epochs of the game."""

    def times(self, burn_in: int) -> Floats:
        """Scenario time of the epochs -burn_in..K, s."""

    def velocity(self, burn_in: int = 0) -> Floats:
        """The true velocity at epochs -burn_in..K, which a spoofer tracks, (burn_in + K + 1, 3), ENU, m/s."""

    def velocity_in_steps(self) -> Floats:
        """The true velocity at the moments of the timeline's steps, (M+1, 3), ENU, m/s.

        These are epochs 0..K where no epoch is missing.
        """

    def track(self) -> Floats:
        """The true position at epochs 0..K from that at epoch 0, (K+1, 3), m ENU."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedTruth(Immutable):
    """The stretch of a simulated trajectory on which a game is played.

    Attributes:
        name: the specification that builds the scenario.
        trajectory: the true motion, at the IMU rate.
        rate: of the epochs, Hz.
        onset: time of epoch 0, the last clean epoch, s.
        horizon: K, epochs of the game.
    """

    name: str
    trajectory: Trajectory
    rate: float
    onset: float
    horizon: int

    def __post_init__(self) -> None:
        owner, interval = f"scenario {self.name!r}", self.interval
        if self.horizon < 1:
            raise ValueError(f"{owner}: horizon must be 1 epoch or more, got {self.horizon}")
        first, last = 2 * interval, self.trajectory.time[-1] - self.horizon * interval
        if not first - ROUNDING <= self.onset <= last + ROUNDING:
            raise ValueError(
                f"{owner}: onset {written(self.onset)} s with a horizon of {self.horizon} epochs does not fit the "
                f"trajectory of {written(self.trajectory.time[-1])} s: valid from {written(first)} to {written(last)} s"
            )
        if abs(self.onset / interval - round(self.onset / interval)) > 1e-9:
            raise ValueError(
                f"{owner}: onset {written(self.onset)} s is no epoch of a receiver at {written(1.0 / interval)} Hz"
            )

    @property
    def interval(self) -> float:
        """Time between epochs, s."""
        return 1.0 / self.rate

    @property
    def timeline(self) -> Timeline:
        """The epochs of the game."""
        return self.timeline_from(0)

    def timeline_from(self, burn_in: int) -> Timeline:
        """The epochs -burn_in..K as a timeline of their own."""
        return Timeline.steady(self.onset - burn_in * self.interval, self.interval, self.horizon + burn_in)

    def times(self, burn_in: int) -> Floats:
        """Scenario time of the epochs -burn_in..K, s."""
        return self.timeline_from(burn_in).times

    def samples(self, times: Floats) -> Runs:
        """Samples of the trajectory at scenario times."""
        return np.asarray(np.round(times * self.trajectory.rate), dtype=np.int64)

    def first(self, burn_in: int) -> int:
        """Place of epoch -burn_in among those of the trajectory, counted from 0 at the first interval's end.

        It is negative where the trajectory does not reach back that far.
        """
        return round(self.onset * self.rate) - 1 - burn_in

    def position(self, burn_in: int = 0) -> Floats:
        """The true position at epochs -burn_in..K, (burn_in + K + 1, 3), latitude rad, longitude rad, height m."""
        return self.trajectory.position[self.samples(self.times(burn_in))]

    def velocity(self, burn_in: int = 0) -> Floats:
        """The true velocity at epochs -burn_in..K, (burn_in + K + 1, 3), ENU, m/s."""
        return self.trajectory.velocity[self.samples(self.times(burn_in))]

    def velocity_in_steps(self) -> Floats:
        """The true velocity at the moments of the timeline's steps, (K+1, 3), ENU, m/s: no epoch is missing."""
        return self.velocity()

    def track(self) -> Floats:
        """The true position at epochs 0..K from that at epoch 0, (K+1, 3), m ENU."""
        position = self.position()
        return position_difference(position, position[0])
