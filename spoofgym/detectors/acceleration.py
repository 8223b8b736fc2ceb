"""A test that compares the acceleration of the GNSS positions with that of the accelerometers (Kwon and Shim 2020)."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.detectors.base import ThresholdDetector
from spoofgym.detectors.relative_motion import relative_position
from spoofgym.detectors.ring import Ring
from spoofgym.navigation.facts import INERTIAL_SOLUTION
from spoofgym.navigation.interface import Demands, Epoch

DEFAULT_LAG = 10


class Acceleration(ThresholdDetector):
    """Alarm where the positions have accelerated otherwise than the inertial measurements say (Kwon and Shim 2020).

    The decision variable is the paper's magnitude of the acceleration error. The paper has it from the receiver's
    acceleration and the accelerometers; here it is the second divided difference of GNSS - INS (`relative_position`),
    horizontal, over a lag of n epochs,

        statistic = ‖d_k - 2 d_(k-n) + d_(k-2n)‖ / T²,      T = n intervals,

    with each difference over its own time where epochs are not equally spaced. White noise of the fix with a standard
    deviation σ per axis gives each axis the standard deviation √6 σ / T²; the inertial solution adds little, since its
    drift is hardly curved. So the test is the same wherever the game has got to, and does not depend on what the filter
    does with the fixes.

    It sees a change of the spoofed velocity, for 2n epochs, and nothing of a ramp that goes on. Until 2n epochs of the
    game have come the statistic is 0, and so it is where one of the three fixes is missing.

    Args:
        n: lag of the differences, epochs.
        threshold: compared with the statistic, m/s².
        arl0: average run length between false alarms, epochs; calibrated, and 1e5 with nothing given.

    Raises:
        ValueError: both of the last two are given, or a value is out of range.
    """

    kind = "acceleration"
    demands = Demands(auxiliary=True)
    needs = (INERTIAL_SOLUTION,)
    needs_view = True
    in_position = True

    def __init__(self, n: int = DEFAULT_LAG, threshold: float | None = None, arl0: float | None = None) -> None:
        self.n = validation.epochs(self.kind, "n", n, 1)
        self.set_up(threshold, arl0, n=self.n)

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate positions and velocities of the lag, each with its time."""
        self._earlier = Ring(num_runs, self.n, 6, empty=np.nan)

    def reset(self, runs: Runs) -> None:
        """Forget the positions of these runs."""
        self._earlier.reset(runs)

    def update(self, epoch: Epoch) -> Floats:
        """Horizontal acceleration of GNSS against the inertial solution, (N,), m/s²; 0 where a fix is missing."""
        earlier = self._earlier.oldest
        position = relative_position(epoch)
        position[:, 2] = epoch.time
        velocity = divided_difference(position, earlier[:, :3])
        acceleration = divided_difference(velocity, earlier[:, 3:])
        self._earlier.push(np.concatenate([position, velocity], axis=1))
        magnitude = np.hypot(acceleration[:, 0], acceleration[:, 1])
        return np.where(np.isnan(magnitude), 0.0, magnitude)


def divided_difference(value: Floats, earlier: Floats) -> Floats:
    """The mean derivative of a quantity between two times.

    Args:
        value: east, north and time, (N, 3).
        earlier: the same at an earlier time, (N, 3).

    Returns:
        The derivative east and north and its time, midway, (N, 3); NaN where either value is NaN.
    """
    change = value - earlier
    for axis in range(2):
        change[:, axis] /= change[:, 2]
    change[:, 2] = 0.5 * (value[:, 2] + earlier[:, 2])
    return change
