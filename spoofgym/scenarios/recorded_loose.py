"""The loosely coupled filter on a log, whose fixes it takes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.logs.fix_rows import UNMEASURED_SIGMA
from spoofgym.logs.log import velocity_of
from spoofgym.logs.log_noise import LogNoise
from spoofgym.logs.spoofed_fixes import RecordedSpoof, recorded_spoof
from spoofgym.logs.table import seconds
from spoofgym.navigation.facts import COASTING, INERTIAL_SOLUTION
from spoofgym.navigation.interface import Demands
from spoofgym.navigation.loose.fixes import FixFamily
from spoofgym.navigation.loose.strapdown import StrapdownNavigator
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.navigation.loose.warm_start import ERROR, NUM_JOINT
from spoofgym.parallel import RunSlices
from spoofgym.scenarios.clean_run import CleanRun, clean_run
from spoofgym.scenarios.recorded_family import RecordedFamily
from spoofgym.streams import RunStreams

SIGMA_FLOOR = 0.3
"""Smallest 1 sigma that the filter believes of a fix, m and m/s: timing and lever arm are not known better."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedFixes(RecordedFamily, FixFamily):
    """Loosely coupled filters on the fixes of a log; each fix is an epoch.

    Attributes:
        tuning: what the filter believes; its measurement sigmas hold where the log states none.
        sigma_floor: smallest 1 sigma of a fix that the filter believes, m and m/s.
        noise: estimated noises, which the filter believes in place of those of ``grade``, ``tuning`` and
            ``sigma_floor``; None = there are none.
    """

    offers: ClassVar[tuple[str, ...]] = (INERTIAL_SOLUTION, COASTING)

    sigma_floor: float = SIGMA_FLOOR
    noise: LogNoise | None = None

    def __post_init__(self) -> None:
        if self.dimension == 6 and self.log.fixes.velocity is None:
            raise ValueError(f"scenario {self.name!r}: the log gives no velocity (columns vn_mps, ve_mps, vd_mps)")
        super().__post_init__()

    @property
    def dimension(self) -> int:
        """m, of the fix."""
        return len(self.tuning.measurement_sigma)

    @cached_property
    def _fix(self) -> slice:
        """The fixes that are epochs of the whole run: those after the alignment, as far as IMU and reference reach."""
        first = self.alignment.fix
        stop = int(np.searchsorted(self.log.fixes.time, self._end, side="right"))
        if stop - first < 4:
            raise ValueError(
                f"scenario {self.name!r}: too few fixes after the alignment at {seconds(self.align_time)} s"
            )
        return slice(first + 1, stop)

    @cached_property
    def epoch_time(self) -> Floats:
        """Times of all epochs after the alignment, (E,), s."""
        return self.log.fixes.time[self._fix]

    @cached_property
    def model(self) -> StrapdownModel:
        """All epochs after the alignment, with fixes in place of the truth where the log has no reference."""
        velocity, position = velocity_of(self.log.fixes)[self._fix], self.log.fixes.position[self._fix]
        covariance = np.square(self._measurement_sigma)[:, :, None] * np.eye(self.dimension)
        return self._inertial_model(position, velocity, covariance)

    @property
    def _prior_sigma(self) -> Floats:
        sigma = self.tuning.initial_sigma(self.grade)
        sigma[:3] = self.alignment.attitude_sigma
        sigma[6:9] = self._measurement_sigma[0, :3]
        return sigma

    @property
    def _filter_density(self) -> Floats:
        return super()._filter_density if self.noise is None else self.noise.density

    @cached_property
    def stated_sigma(self) -> Floats:
        """Of each epoch's fix as the log states it, or by default, (E, m), m and m/s."""
        fixes, size = self.log.fixes, (len(self.epoch_time), 3)
        columns = []
        for place, stated in ((0, fixes.position_sigma), (3, fixes.velocity_sigma)):
            if place < self.dimension:
                default = np.broadcast_to(self.tuning.measurement_sigma[place : place + 3], size)
                columns.append(default if stated is None else stated[self._fix])
        return np.hstack(columns)

    @cached_property
    def measured(self) -> Flags:
        """Components of the fixes that are measured, (E, m): some only fill a column of the log."""
        measured = self.stated_sigma < UNMEASURED_SIGMA
        velocity = self.log.fixes.velocity
        if velocity is not None and not velocity[:, 2].any():
            measured[:, 5:] = False
        return measured

    @cached_property
    def _measurement_sigma(self) -> Floats:
        """Of each epoch's fix, (E, m), m and m/s."""
        return self.believed_sigma(self.noise)

    def believed_sigma(self, noise: LogNoise | None) -> Floats:
        """1 sigma of the white error of each epoch's fix that a filter believes, (E, m), m and m/s.

        Args:
            noise: estimated; None = by the stated sigmas and ``sigma_floor``.
        """
        stated = self.stated_sigma
        sigma = np.maximum(stated, self.sigma_floor) if noise is None else noise.fix_sigma(stated)
        return np.where(self.measured, sigma, UNMEASURED_SIGMA)

    @property
    def unmeasured(self) -> Runs:
        """Velocities that the receiver fills without measuring them, at each epoch after the alignment, (E,)."""
        return np.add.reduce(~self.measured, axis=1, dtype=np.int64)

    @cached_property
    def clean(self) -> CleanRun:
        """The filter on the unspoofed fixes, from the alignment to the end of the log."""
        with self._refusing_divergence():
            run = clean_run(self.model)
        self._warn_of_large_innovations(run)
        return run

    def recorded_spoof(self) -> RecordedSpoof:
        """The real attack that the log holds; raises as `spoofgym.logs.spoofed_fixes.recorded_spoof`."""
        return recorded_spoof(self.log)

    def navigator(
        self, fidelity: str, demands: Demands, burn_in: int, num_runs: int, slices: RunSlices
    ) -> StrapdownNavigator:
        """A navigator that starts from the clean run's filter before epoch -burn_in; arguments as in `FilterFamily`."""
        return StrapdownNavigator(self._game_model(self._first(burn_in)), num_runs, slices, demands)

    def draw_initial(self, runs: Runs, burn_in: int, streams: RunStreams) -> Floats:
        """No error but the biases': the samples carry the real ones, the filter its estimates, (n, 30)."""
        initial = np.zeros((len(runs), NUM_JOINT))
        initial[:, ERROR][:, 9:15] = -self.clean.bias[self._first(burn_in)]
        return initial

    def draw_receiver_noise(self, runs: Runs, initial: Floats, burn_in: int, streams: RunStreams) -> Floats:
        """Zeros: the fixes carry their own, (n, burn_in + K + 1, m), m and m/s."""
        return np.zeros((len(runs), self.last + 1 - self._first(burn_in), self.dimension))
