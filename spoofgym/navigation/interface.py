"""What one GNSS epoch is made of, and what a navigator offers.

Arrays carry a leading axis of runs N; m is the dimension of the fix (3: position, 6: position and velocity), in east,
north, up.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.streams import RunStreams


@dataclass(frozen=True)
class Timeline:
    """The epochs of a game.

    Attributes:
        start: scenario time of epoch 0, the last clean epoch before the game, s.
        interval: time between GNSS epochs, s.
        num_epochs: epochs of the game, after epoch 0.
    """

    start: float
    interval: float
    num_epochs: int

    @property
    def end(self) -> float:
        """Scenario time of the last epoch, s."""
        return self.start + self.interval * self.num_epochs

    @property
    def times(self) -> Floats:
        """Scenario time of epochs 0..K, (K+1,), s."""
        return np.asarray(self.start + self.interval * np.arange(self.num_epochs + 1), dtype=np.float64)


@dataclass(frozen=True)
class Clock:
    """Where each run stands.

    Attributes:
        index: epochs since the clean epoch 0 of its episode, (N,).
        time: scenario time, (N,), s.
    """

    index: Runs
    time: Floats


@dataclass(frozen=True)
class Innovation:
    """The innovation of one epoch, whitened once: every test uses it.

    Attributes:
        residual: z = p_INS - p_GNSS (and v_INS - v_GNSS), (N, m), m and m/s.
        covariance: S = H P H' + R, (N, m, m).
        whitened: L⁻¹ residual with S = L L', (N, m).
        nis: normalised innovation squared, whitened' whitened, (N,).
    """

    residual: Floats
    covariance: Floats
    whitened: Floats
    nis: Floats


@dataclass(frozen=True)
class Epoch(Clock):
    """What one epoch knows; never the truth.

    Attributes:
        innovation: of this epoch.
        statistics: each detector's statistic by its name, (N,) each; filled in the order of the detectors.
    """

    innovation: Innovation
    statistics: dict[str, Floats] = field(default_factory=dict)


@dataclass(frozen=True)
class Decision:
    """What becomes of the present fix.

    Attributes:
        use: apply the fix (True) or leave it out, (N,).
    """

    use: Flags


class Navigator(Protocol):
    """N filters that go through the epochs of a scenario in two half-steps.

    Every half-step can be asked for some of the runs only; arrays then have their length, in their order. ``index``
    counts the epochs of the navigator's model, -1 before the first. ``deviation`` is what lies between the fix and the
    scenario's reference position (and velocity) of the epoch: receiver noise plus spoofing offset, (N, m).
    """

    index: Runs

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes, before the model's first epoch, from joint states (n, 30) of truth and filter."""

    def propagate(self, runs: Runs | None = None) -> None:
        """Carry runs (all by default) to their next epoch by inertial measurements."""

    def innovate(self, deviation: Floats, runs: Runs | None = None) -> Innovation:
        """Form the innovation of the present epoch."""

    def resolve(self, decision: Decision, runs: Runs | None = None) -> None:
        """Apply the fix where the decision says so."""

    @property
    def error(self) -> Floats:
        """Estimate minus truth, (N, 3), m ENU."""

    @property
    def position_covariance(self) -> Floats:
        """The filter's own covariance of the position, (N, 3, 3), m²."""

    @property
    def estimated_bias(self) -> Floats:
        """Gyro and accelerometer biases that the filter has estimated, (N, 6), rad/s and m/s²."""
