"""The common part of the autopilots' filters: gates on the innovation, and a clock since the last fix used."""

from __future__ import annotations

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.detectors.gates import DEFAULT_GATE, at_least_one_sigma
from spoofgym.navigation.interface import Epoch
from spoofgym.responses.base import Response
from spoofgym.specification import spell

ROUNDING = 1e-6
"""s: times are sums of intervals, and a timer must not run out by their rounding."""

LEAST_VARIANCE = 1e-4
"""m²: of a position, in both (ArduPilot: POS_STATE_MIN_VARIANCE)."""

HORIZONTAL, UP, VELOCITY = slice(0, 2), slice(2, 3), slice(3, 6)


def position_variance(epoch: Epoch) -> Floats:
    """The filter's variance of its position per axis, (N, 3), m².

    Raises:
        ValueError: the epoch was made without a navigator.
    """
    if epoch.view is None:
        raise ValueError("an autopilot needs the filter's covariance, and the epoch has no view of the filter")
    return np.diagonal(epoch.view.position_covariance, axis1=1, axis2=2)


def fix_variance(epoch: Epoch) -> Floats:
    """The variance of the fix's position that the filter counts with, R = S - P, per axis, (N, 3), m².

    It is exact for an antenna at the IMU and a fix without latency; else it holds what these add to S. It is never less
    than the variance that the autopilots allow.

    Raises:
        ValueError: the epoch was made without a navigator.
    """
    innovation = np.diagonal(epoch.innovation.covariance, axis1=1, axis2=2)[:, :3]
    return np.maximum(innovation - position_variance(epoch), LEAST_VARIANCE)


class Autopilot(Response):
    """The part of an autopilot's filter that decides on a fix, by its own gates; it hears no detector.

    PX4 and ArduPilot treat horizontal position, height and velocity as sources that are accepted or rejected one by
    one, each with its own timer. Here a fix is used, or not, as a whole: it is rejected where any of its gates rejects
    it, and there is one timer. There is one receiver, one filter (no lane to switch to) and no receiver flag of
    spoofing; the receiver's own accuracy checks always pass. The yaw emergency estimators are left out.

    Args:
        position_gate: sigma, of the position.
        velocity_gate: sigma, of the velocity; there is none where the receiver gives position only.

    Raises:
        ValueError: a gate less than 1, which both autopilots refuse.
    """

    kind: str

    def __init__(self, position_gate: float = DEFAULT_GATE, velocity_gate: float = DEFAULT_GATE) -> None:
        self.position_gate = at_least_one_sigma(self.kind, "position_gate", position_gate)
        self.velocity_gate = at_least_one_sigma(self.kind, "velocity_gate", velocity_gate)

    @property
    def name(self) -> str:
        """The specification that builds this response."""
        return self._spell()

    def _spell(self, **options: object) -> str:
        """The specification with the gates before a subclass's own options."""
        gates = {"position_gate": self.position_gate, "velocity_gate": self.velocity_gate}
        return spell(
            self.kind, **{key: None if gate == DEFAULT_GATE else gate for key, gate in gates.items()}, **options
        )

    def bind(self, num_runs: int) -> None:
        """Allocate the time of the last fix that was used."""
        super().bind(num_runs)
        self._last = np.full(num_runs, np.nan)

    def reset(self, runs: Runs) -> None:
        """Begin with a fix that has just been used in these runs."""
        self._last[runs] = np.nan

    def silence(self, epoch: Epoch) -> Floats:
        """Time since the last fix that was used, (N,), s; an outage counts."""
        self._last = np.where(np.isnan(self._last), epoch.time, self._last)
        return epoch.time - self._last

    def mark(self, epoch: Epoch, used: Flags) -> None:
        """Start the clock anew where the fix is used."""
        self._last = np.where(used, epoch.time, self._last)
