"""The tightly coupled filter on recorded samples and ranges: the errors are in them, and none is drawn."""

from __future__ import annotations

from spoofgym.arrays import Floats, Runs
from spoofgym.navigation.interface import NO_DEMANDS, Demands
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.navigation.tight.model import TightModel
from spoofgym.navigation.tight.states import CLOCK
from spoofgym.navigation.tight.strapdown import TightStrapdownNavigator
from spoofgym.parallel import RunSlices
from spoofgym.streams import RunStreams


class TightReplayNavigator(TightStrapdownNavigator):
    """N closed-loop tightly coupled filters on a log.

    Nobody knows the true clock, atmosphere or multipath of a log: their reference is zero, so that ``state`` holds what
    the filter estimates. What really acts is part of the deviation of the ranges.
    """

    def __init__(
        self,
        model: StrapdownModel,
        tight: TightModel,
        satellites: Floats,
        clock: Floats,
        num_runs: int,
        slices: RunSlices,
        demands: Demands = NO_DEMANDS,
    ) -> None:
        """Allocate ``num_runs`` runs; `reset` starts them.

        Args:
            model: the inertial part of the game.
            tight: the filter, on the same epochs.
            satellites: their positions, (K+1, S, 3), ECEF at the time of reception, m.
            clock: what `clock_error` takes for the truth at each epoch, (K+1,), m.
            num_runs: N.
            slices: the threads to use.
            demands: of the players.
        """
        super().__init__(model, tight, satellites, num_runs, slices, demands)
        self._clock = clock

    def reset(self, runs: Runs, initial: Floats, streams: RunStreams) -> None:
        """Start new episodes just before epoch 0; arguments as in `TightStrapdownNavigator`."""
        super().reset(runs, initial, streams)
        self.range_normals[runs] = 0.0

    @property
    def clock_error(self) -> Floats:
        """Estimate minus reference of the receiver's clock, (N,), m."""
        return self.state[:, CLOCK] - self._clock[self.index]

    @property
    def measured(self) -> Floats:
        """Code and range rate of the log less those of the reference, (N, m), m and m/s."""
        return self._deviation.copy()
