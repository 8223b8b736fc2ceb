"""The loosely coupled filter on a log, corrected by the log's other sensors, too."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.logs.aid_tables import TimedReadings
from spoofgym.logs.log_warning import warn
from spoofgym.navigation.aids import Aid
from spoofgym.navigation.aids.aid_set import AidSet, Readings
from spoofgym.navigation.facts import AIDS, INERTIAL_SOLUTION, FilterFacts
from spoofgym.navigation.interface import Demands
from spoofgym.navigation.loose.aided.strapdown import AidedStrapdownNavigator
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.parallel import RunSlices
from spoofgym.scenarios.clean_run import AidedCleanRun, aided_clean_run
from spoofgym.scenarios.log_aids import USUAL_GATE
from spoofgym.scenarios.recorded_loose import RecordedFixes
from spoofgym.streams import RunStreams

FEWEST = 10
"""Readings of which it can be said that most are left out."""
MOST_REJECTED = 0.5
"""Share of readings left out above which an aid is of no use."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedAided(RecordedFixes):
    """Loosely coupled filters on the fixes of a log, with aids at the times of their own tables.

    Attributes:
        aids: of the filter, at least one.
        readings: of each.
    """

    aids: tuple[Aid, ...]
    readings: tuple[TimedReadings, ...]

    offers = (INERTIAL_SOLUTION, AIDS)

    def __post_init__(self) -> None:
        super().__post_init__()
        for aid, readings in zip(self.aids, self.readings, strict=True):
            if not self._inside(readings).any():
                raise ValueError(
                    f"scenario {self.name!r}: {aid.kind} reads nothing between the alignment and the end of the log"
                )

    @property
    def num_states(self) -> int:  # type: ignore[override]
        """n, with the states of the aids."""
        return super().num_states + self.aid_set.num_states

    @cached_property
    def aid_set(self) -> AidSet:
        """The aids, each behind its gate."""
        return AidSet(self.aids, USUAL_GATE)

    @property
    def facts(self) -> FilterFacts:
        """What the designer of the filter knows."""
        return replace(super().facts, aids=tuple((aid.kind, aid.dimension) for aid in self.aids))

    def _inside(self, readings: TimedReadings) -> np.ndarray:
        """Which readings lie after the alignment, up to the last epoch, (n,)."""
        return np.asarray((readings.time > self.align_time) & (readings.time <= self.epoch_time[-1]))

    @cached_property
    def cuts(self) -> Floats:
        """Times of the readings, at which steps of the inertial samples must end, s."""
        return np.unique(np.concatenate([each.time[self._inside(each)] for each in self.readings]))

    @cached_property
    def _read(self) -> list[Readings]:
        """The readings by the samples of `model`."""
        return [
            Readings(np.searchsorted(self.grid, each.time[inside]), each.value[inside])
            for each, inside in ((each, self._inside(each)) for each in self.readings)
        ]

    @property
    def _prior_sigma(self) -> Floats:
        return np.concatenate([super()._prior_sigma, self.aid_set.sigma])

    def _navigator(
        self, model: StrapdownModel, num_runs: int, slices: RunSlices, demands: Demands
    ) -> AidedStrapdownNavigator:
        return AidedStrapdownNavigator(
            model, self.aid_set, self._read, num_runs, slices, demands, simulated=False
        )

    @cached_property
    def clean(self) -> AidedCleanRun:
        """The filter on the unspoofed fixes and the aids, from the alignment to the end of the log."""
        with self._refusing_divergence():
            run = aided_clean_run(self._navigator(self.model, 1, RunSlices(1), Demands()))
        self._warn_of_large_innovations(run)
        self._warn_of_gates(run)
        return run

    def _warn_of_gates(self, run: AidedCleanRun) -> None:
        """Warn of aids that hardly get through their gates.

        Warns:
            LogWarning: the aid, how many of its readings are left out, and likely reasons.
        """
        for place, aid in enumerate(self.aids):
            number, rejected = (int(each[:, place].sum()) for each in (run.number, run.rejected))
            if number >= FEWEST and rejected > MOST_REJECTED * number:
                warn(
                    self.log.folder,
                    f"the gate of {aid.kind} leaves out {rejected} of {number} readings: the sensor or the filter is "
                    "wrong; likely reasons: a start or a bias that the IMU grade does not cover, so that the filter is "
                    "sure of what is wrong (gate=0 lets the aid correct it), a wrong mounting, sigmas that are too "
                    "small",
                )

    def navigator(
        self, fidelity: str, demands: Demands, burn_in: int, num_runs: int, slices: RunSlices
    ) -> AidedStrapdownNavigator:
        """A navigator that starts from the clean run's filter before epoch -burn_in; arguments as in `FilterFamily`."""
        return self._navigator(self._game_model(self._first(burn_in)), num_runs, slices, demands)

    def draw_initial(self, runs: Runs, burn_in: int, streams: RunStreams) -> Floats:
        """As without aids, and what the filter has estimated of their states, (n, 30 + a)."""
        estimated = np.broadcast_to(self.clean.state[self._first(burn_in)], (len(runs), self.aid_set.num_states))
        return np.concatenate([super().draw_initial(runs, burn_in, streams), estimated], axis=1)
