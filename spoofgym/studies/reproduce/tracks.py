"""A simulation played to its end, with what the figures of a paper are read from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from spoofgym.arrays import Flags, Floats
from spoofgym.geodesy import horizontal
from spoofgym.navigation.interface import Decision
from spoofgym.navigation.loose.own_gains import OwnCovarianceNavigator
from spoofgym.navigation.loose.strapdown import StrapdownNavigator
from spoofgym.simulation import Simulation


@dataclass(frozen=True)
class Tracks:
    """N runs over the epochs 0..K of a game; vectors in east, north, up.

    Attributes:
        time: scenario time, (K+1,), s.
        error: of the real-time output after each decision, (N, K+1, 3), m.
        residual: innovation z = p_INS - p_GNSS, (N, K+1, 3), m.
        nis: normalised innovation squared, (N, K+1).
        receiver_error: of the fix, noise and offset, (N, K+1, 3), m.
        position_sigma: the filter's own, after each decision, (N, K+1, 3), m.
        bias: that the filter has estimated, (N, K+1, 6), rad/s and m/s².
        alarm: whether any detector alarmed, (N, K+1).
        used: whether the fix was used, (N, K+1).
        recomputed: errors as later backtracking has rewritten them, (N, K+1, 3), m.
        statistics: of each detector by its name, (N, K+1) each.
    """

    time: Floats
    error: Floats
    residual: Floats
    nis: Floats
    receiver_error: Floats
    position_sigma: Floats
    bias: Floats
    alarm: Flags
    used: Flags
    recomputed: Floats
    statistics: dict[str, Floats]

    @property
    def horizontal_error(self) -> Floats:
        """Length of the horizontal error, (N, K+1), m."""
        return horizontal(self.error)

    def at(self, time: float) -> int:
        """The epoch at a scenario time.

        Raises:
            ValueError: there is none.
        """
        epoch = int(np.argmin(np.abs(self.time - time)))
        if abs(self.time[epoch] - time) > 1e-6:
            raise ValueError(f"no epoch at {time:g} s; they run from {self.time[0]:g} to {self.time[-1]:g} s")
        return epoch


def play(
    simulation: Simulation,
    decide: Callable[[float, int], Decision | None] | None = None,
) -> Tracks:
    """Play all runs from their first to their last epoch.

    Args:
        simulation: not yet reset.
        decide: gives the decision of all runs at a time, s, for that many runs; None, or a decision of None = the
            response's.
    """
    n, timeline = simulation.num_runs, simulation.scenario.timeline
    times = timeline.times
    vectors = [np.empty((n, len(times), 3)) for _ in range(4)]
    error, residual, receiver_error, sigma = vectors
    nis, bias = np.empty((n, len(times))), np.empty((n, len(times), 6))
    alarm, used = (np.empty((n, len(times)), dtype=bool) for _ in range(2))
    statistics = {name: np.empty((n, len(times))) for name in simulation.detectors}
    recomputed = np.empty((n, len(times), 3))
    for k, time in enumerate(times):
        epoch = simulation.observe() if k else simulation.reset()
        residual[:, k], nis[:, k] = epoch.innovation.residual[:, :3], epoch.innovation.nis
        receiver_error[:, k] = simulation.error - residual[:, k]
        alarm[:, k] = simulation.alarm
        for name, values in statistics.items():
            values[:, k] = epoch.statistics[name]
        simulation.resolve(None if decide is None else decide(float(time), n))
        used[:, k] = simulation.used
        error[:, k], bias[:, k] = simulation.error, simulation.navigator.estimated_bias
        recomputed[:, k] = simulation.error
        _rewrite(recomputed, k, simulation)
        sigma[:, k] = np.sqrt(np.diagonal(simulation.navigator.position_covariance, axis1=1, axis2=2))
    return Tracks(times, error, residual, nis, receiver_error, sigma, bias, alarm, used, recomputed, statistics)


def _rewrite(track: Floats, k: int, simulation: Simulation) -> None:
    """Put the errors of epochs that have just been recomputed in place of the former ones."""
    navigator = simulation.navigator
    depth = navigator.backtracked
    if not depth.any():
        return
    assert isinstance(navigator, OwnCovarianceNavigator | StrapdownNavigator)
    deepest = int(depth.max())
    recomputed = navigator.recomputed_error(deepest)
    again = np.arange(deepest) >= deepest - depth[:, None]
    track[:, k - deepest : k][again] = recomputed[again]
