"""A recorded drive or flight as a game: real inertial samples and fixes, to which the spoofer adds its offset.

Where the filter is to take the ranges themselves it is the game of `recorded_tight`.

The filter is aligned on the log, run over the clean fixes up to the onset, and goes on from there. A log is one
realisation: nothing is drawn, and every episode is the same but for what the players do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.logs.fix_rows import DEFAULT_SIGMA, UNMEASURED_SIGMA
from spoofgym.logs.lever_arm import with_velocity_at_imu
from spoofgym.logs.log import Log, read_log, velocity_of
from spoofgym.logs.log_warning import warn
from spoofgym.logs.range_epochs import range_epochs
from spoofgym.logs.range_fixes import range_fixes
from spoofgym.logs.reference import checked_reference
from spoofgym.logs.table import seconds
from spoofgym.navigation.facts import INERTIAL_SOLUTION
from spoofgym.navigation.interface import Demands
from spoofgym.navigation.loose.strapdown import StrapdownNavigator
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.navigation.loose.warm_start import ERROR, NUM_JOINT
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.parallel import RunSlices
from spoofgym.scenarios.clean_run import CleanRun, clean_run
from spoofgym.scenarios.limits import NOISE_FACTORS
from spoofgym.scenarios.recorded_scenario import RecordedScenario
from spoofgym.scenarios.recorded_tight import RecordedRanges
from spoofgym.sensors.imu import grade as imu_grade
from spoofgym.specification import spell
from spoofgym.streams import RunStreams

FIXES = ("phone", "ranges")
"""Which fixes a filter may take: those in the log, or those made from its raw ranges."""
COUPLINGS = ("loose", "tight")
SIGMA_FLOOR = 0.3
"""Smallest 1 sigma that the filter believes of a fix, m and m/s: timing and lever arm are not known better."""
ALIGNMENT_SIGMA = (math.radians(5.0), math.radians(5.0), math.radians(10.0))
"""Initial attitude error (E, N, U), rad: course against heading, and a mounting known to some degrees."""
ALIGNMENT_VELOCITY_SIGMA = (0.5, 0.5, 0.5)
NOISE_FACTOR = 20.0
"""The filter's white inertial noise over the data sheet's, for what its model leaves out (presumably scale factor,
misalignment, vibration). An empirical figure: chosen by the clean errors of four logs, on which it is therefore not
an independent result, and cautious there (mean NIS well below the fix's dimension)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedFixes(RecordedScenario):
    """A game on the fixes of a log, for a loosely coupled filter; each fix is an epoch.

    Attributes:
        tuning: what the filter believes; its measurement sigmas hold where the log states none.
        sigma_floor: smallest 1 sigma of a fix that the filter believes, m and m/s.
    """

    offers = (INERTIAL_SOLUTION,)

    sigma_floor: float = SIGMA_FLOOR

    def __post_init__(self) -> None:
        if self.dimension == 6 and self.log.fixes.velocity is None:
            raise ValueError(f"scenario {self.name!r}: the log gives no velocity (columns vn_mps, ve_mps, vd_mps)")
        super().__post_init__()

    @property
    def dimension(self) -> int:  # type: ignore[override]
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
        sigma[6:9] = self._measurement_sigma[0, :3]
        return sigma

    @cached_property
    def _measurement_sigma(self) -> Floats:
        """Of each epoch's fix, (E, m), m and m/s."""
        fixes, size = self.log.fixes, (len(self.epoch_time), 3)
        columns = []
        for place, stated in ((0, fixes.position_sigma), (3, fixes.velocity_sigma)):
            if place < self.dimension:
                default = np.broadcast_to(self.tuning.measurement_sigma[place : place + 3], size)
                columns.append(default if stated is None else stated[self._fix])
        sigma = np.maximum(np.hstack(columns), self.sigma_floor)
        if fixes.velocity is not None and not fixes.velocity[:, 2].any():  # the receiver fills it without measuring
            sigma[:, 5:] = UNMEASURED_SIGMA
        return sigma

    @cached_property
    def clean(self) -> CleanRun:
        """The filter on the unspoofed fixes, from the alignment to the end of the log."""
        with self._refusing_divergence():
            run = clean_run(self.model)
        self._warn_of_large_innovations(run)
        return run

    def navigator(
        self, fidelity: str, demands: Demands, burn_in: int, num_runs: int, slices: RunSlices
    ) -> StrapdownNavigator:
        """A navigator that starts from the clean run's filter before epoch -burn_in; arguments as in `Scenario`."""
        self.check_fidelity(fidelity)
        return StrapdownNavigator(self._game_model(self._first(burn_in)), num_runs, slices, demands)

    def draw_initial(self, runs: Runs, burn_in: int, streams: RunStreams) -> Floats:
        """No error but the biases': the samples carry the real ones, the filter its estimates, (n, 30)."""
        initial = np.zeros((len(runs), NUM_JOINT))
        initial[:, ERROR][:, 9:15] = -self.clean.bias[self._first(burn_in)]
        return initial

    def draw_receiver_noise(self, runs: Runs, initial: Floats, burn_in: int, streams: RunStreams) -> Floats:
        """Zeros: the fixes carry their own, (n, burn_in + K + 1, m), m and m/s."""
        return np.zeros((len(runs), self.last + 1 - self._first(burn_in), self.dimension))


def recorded(
    path: str,
    grade: str = "automotive",
    onset: float | None = None,
    horizon: int | None = None,
    velocity: bool | None = None,
    sigma_floor: float = SIGMA_FLOOR,
    noise_factor: float = NOISE_FACTOR,
    fixes: str = FIXES[0],
    coupling: str = COUPLINGS[0],
) -> RecordedScenario:
    """A log in the project's format as a game.

    Args:
        path: folder of the log; no comma in it.
        grade: name of the IMU grade that the filter believes in.
        onset: time of the last clean epoch, s (the last one up to it is taken); None = a third of the way from the
            log's start to its end.
        horizon: epochs of the game; None = to the end of the log.
        velocity: whether the filter uses the receiver's velocity beside its position; None = where the log has it.
        sigma_floor: smallest 1 sigma of a fix that the filter believes, m and m/s.
        noise_factor: the filter's white inertial noise over the data sheet's, from 0.001 to 1000.
        fixes: which ones the filter takes: ``phone``, those in the log, whatever receiver made them, or ``ranges``,
            least squares of the log's raw ranges (`range_fixes`).
        coupling: ``loose``: the filter takes fixes; ``tight``: it takes code and rate of the log's raw ranges.

    Raises:
        ValueError: a path with a comma, an unknown grade, a log that cannot be used or has no ranges, an onset or a
            horizon outside it, a number that is not positive, or options that do not go together.
    """
    path = str(Path(path))
    if "," in path:
        raise ValueError(f"recorded: a path must not contain a comma, which separates options; got {path!r}")
    imu = imu_grade(grade)
    if onset is not None:
        onset = validation.time("recorded", "onset", onset)
    sigma_floor = validation.above("recorded", "sigma_floor", sigma_floor)
    noise_factor = validation.between("recorded", "noise_factor", noise_factor, *map(math.sqrt, NOISE_FACTORS))
    fixes = validation.one_of("recorded", "fixes", fixes, FIXES)
    coupling = validation.one_of("recorded", "coupling", coupling, COUPLINGS)
    if coupling == "tight" and (velocity is not None or sigma_floor != SIGMA_FLOOR or fixes != FIXES[0]):
        raise ValueError("recorded: velocity, sigma_floor and fixes are of fixes; coupling=tight takes none")
    options = {
        "grade": (grade, "automotive"),
        "onset": (None if onset is None else np.format_float_positional(onset, trim="-"), None),
        "horizon": (horizon, None),
        "velocity": (velocity, None),
        "sigma_floor": (sigma_floor, SIGMA_FLOOR),
        "noise_factor": (noise_factor, NOISE_FACTOR),
        "fixes": (fixes, FIXES[0]),
        "coupling": (coupling, COUPLINGS[0]),
    }
    name = spell("recorded", path, **{key: value for key, (value, default) in options.items() if value != default})
    tuning = FilterTuning(
        attitude_sigma=ALIGNMENT_SIGMA,
        velocity_sigma=ALIGNMENT_VELOCITY_SIGMA,
        position_sigma=DEFAULT_SIGMA[:3],
        initial_scale=1.0,
        process_noise_scale=noise_factor**2,
        measurement_sigma=DEFAULT_SIGMA,
    )
    log = read_log(path)
    if coupling == "tight":
        epochs = range_epochs(log)
        log = replace(log, fixes=epochs.fixes, lever_arm=_no_arm(log))
        log = checked_reference(log)
        return RecordedRanges(name=name, log=log, grade=imu, tuning=tuning, epochs=epochs, onset=onset, horizon=horizon)
    if fixes == "ranges":
        log = replace(log, fixes=range_fixes(log))
    log = checked_reference(log)
    log = with_velocity_at_imu(log)
    if velocity is False or (velocity is None and log.fixes.velocity is None):
        tuning = replace(tuning, measurement_sigma=DEFAULT_SIGMA[:3])
    return RecordedFixes(
        name=name, log=log, grade=imu, tuning=tuning, sigma_floor=sigma_floor, onset=onset, horizon=horizon
    )


def _no_arm(log: Log) -> Floats:
    """The lever arm of a filter that knows none, (3,), m, with a warning where the log has one."""
    if log.lever_arm.any():
        warn(
            log.folder,
            "log.toml: coupling=tight does not know antenna_lever_arm_m and takes the antenna for the IMU: positions "
            f"err by up to {np.linalg.norm(log.lever_arm):.1f} m",
        )
    return np.zeros(3)
