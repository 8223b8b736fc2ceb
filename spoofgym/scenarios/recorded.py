"""A recorded drive or flight as a game: real inertial samples and fixes, to which the spoofer adds its offset.

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
from spoofgym.geodesy import position_difference
from spoofgym.navigation.facts import INERTIAL_SOLUTION
from spoofgym.navigation.interface import Demands, Timeline
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose import StrapdownNavigator
from spoofgym.navigation.strapdown_model import StrapdownModel
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.navigation.warm_start import ERROR, NUM_JOINT
from spoofgym.parallel import RunSlices
from spoofgym.scenario import Scenario
from spoofgym.scenarios.alignment import Alignment, align
from spoofgym.scenarios.clean_run import CleanRun, clean_run
from spoofgym.scenarios.log import Log, interpolate, read_log, velocity_of
from spoofgym.scenarios.range_fixes import range_fixes
from spoofgym.sensors.imu import ImuGrade
from spoofgym.sensors.imu import grade as imu_grade
from spoofgym.specification import spell
from spoofgym.streams import RunStreams

FIXES = ("phone", "ranges")
"""Which fixes a filter may take: those in the log, or those made from its raw ranges."""
MAX_IMU_GAP = 0.5
"""Longest time between inertial samples inside a game, s."""
SIGMA_FLOOR = 0.3
"""Smallest 1 sigma that the filter believes of a fix, m and m/s: timing and lever arm are not known better."""
UNMEASURED_SIGMA = 1e3
"""1 sigma of a vertical velocity that is 0 in every fix, m/s: the receiver fills the column without measuring it."""
DEFAULT_SIGMA = (2.5, 2.5, 5.0, 0.3, 0.3, 0.5)
"""1 sigma of a fix whose log states none, m and m/s."""
ALIGNMENT_SIGMA = (math.radians(5.0), math.radians(5.0), math.radians(10.0))
"""Initial attitude error (E, N, U), rad: course against heading, and a mounting known to some degrees."""
ALIGNMENT_VELOCITY_SIGMA = (0.5, 0.5, 0.5)
NOISE_FACTOR = 20.0
"""The filter's white inertial noise over the data sheet's, for what its model leaves out (presumably scale factor,
misalignment, vibration). An empirical figure: chosen by the clean errors of four logs, on which it is therefore not
an independent result, and cautious there (mean NIS well below the fix's dimension)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedScenario(Scenario):
    """A game on a log, in the strapdown fidelity.

    Its epochs are fixes, so that they need not be equally spaced; ``timeline.interval`` is their median.

    Attributes:
        name: the specification that builds it.
        log: the recording.
        grade: of the IMU, as the filter believes.
        tuning: what the filter believes beside it; its measurement sigmas hold where the log states none.
        sigma_floor: smallest 1 sigma of a fix that the filter believes, m and m/s.
        onset: latest time of epoch 0, the last clean fix, s; None = a third of the way from the log's start to its end.
        horizon: epochs of the game; None = to the end of the log.
        drag_off_rate: largest rate of the spoofed position per axis, m/s.
        error_scale: metres of error that make a reward of 1.
    """

    fidelities = ("strapdown",)
    offers = (INERTIAL_SOLUTION,)
    matched = False
    random = False

    name: str
    log: Log
    grade: ImuGrade
    tuning: FilterTuning
    sigma_floor: float = SIGMA_FLOOR
    onset: float | None = None
    horizon: int | None = None
    drag_off_rate: tuple[float, float, float] = (4.0, 4.0, 4.0)
    error_scale: float = 10.0

    def __post_init__(self) -> None:
        if self.dimension == 6 and self.log.fixes.velocity is None:
            raise ValueError(f"scenario {self.name!r}: the log gives no velocity (columns vn_mps, ve_mps, vd_mps)")
        self._check_imu(self.epoch_time[self.first], self.epoch_time[self.last])

    @property
    def dimension(self) -> int:  # type: ignore[override]
        """m, of the fix."""
        return len(self.tuning.measurement_sigma)

    @cached_property
    def alignment(self) -> Alignment:
        """Where the filter starts."""
        return align(self.log)

    @cached_property
    def _fix(self) -> slice:
        """The fixes that are epochs of the whole run: those after the alignment, as far as IMU and reference reach."""
        log, first = self.log, self.alignment.fix
        last = log.imu_time[-1]
        if log.reference is not None:
            last = min(last, log.reference.time[-1])
            if log.reference.time[0] > log.fixes.time[first]:
                raise ValueError(
                    f"scenario {self.name!r}: the reference begins at {log.reference.time[0]:g} s, after the alignment "
                    f"at {log.fixes.time[first]:g} s; move start_s in log.toml"
                )
        stop = int(np.searchsorted(log.fixes.time, last, side="right"))
        if stop - first < 4:
            raise ValueError(
                f"scenario {self.name!r}: too few fixes after the alignment at {log.fixes.time[first]:g} s"
            )
        return slice(first + 1, stop)

    @cached_property
    def epoch_time(self) -> Floats:
        """Times of all epochs after the alignment, (E,), s."""
        return self.log.fixes.time[self._fix]

    @cached_property
    def first(self) -> int:
        """Epoch 0 of the game, counted from the first epoch after the alignment.

        Raises:
            ValueError: the onset lies outside the log, or the horizon reaches beyond it.
        """
        time = self.epoch_time
        onset = self.onset
        if onset is None:
            begin = max(self.log.start, self.log.fixes.time[0])
            onset = begin + (time[-1] - begin) / 3.0
            onset = min(max(onset, time[0]), time[-2])
        if not time[0] <= onset < time[-1]:
            raise ValueError(
                f"scenario {self.name!r}: onset {onset:g} s lies outside the log: valid from {time[0]:g} s (the first "
                f"fix after the alignment) to {time[-2]:g} s"
            )
        first = int(np.searchsorted(time, onset + 1e-9, side="right")) - 1
        longest = len(time) - 1 - first
        if self.horizon is not None and not 1 <= self.horizon <= longest:
            raise ValueError(
                f"scenario {self.name!r}: horizon {self.horizon} does not fit: valid from 1 to {longest} epochs after "
                f"{onset:g} s"
            )
        return first

    @property
    def last(self) -> int:
        """The last epoch of the game, counted likewise."""
        return len(self.epoch_time) - 1 if self.horizon is None else self.first + self.horizon

    @property
    def timeline(self) -> Timeline:  # type: ignore[override]
        """The epochs of the game."""
        time = self.epoch_time[self.first : self.last + 1]
        return Timeline(float(time[0]), float(np.median(np.diff(time))), len(time) - 1)

    def _check_imu(self, onset: float, end: float) -> None:
        time, begin = self.log.imu_time, self.log.fixes.time[self.alignment.fix]
        gaps = np.flatnonzero((np.diff(time) > MAX_IMU_GAP) & (time[1:] > begin) & (time[:-1] < end))
        if len(gaps):
            at, length = time[gaps[0]], time[gaps[0] + 1] - time[gaps[0]]
            remedy = "a smaller horizon ends the game before it" if at > onset else "a later start_s begins after it"
            raise ValueError(
                f"scenario {self.name!r}: the IMU has a gap of {length:.3g} s at {at:g} s; valid is at most "
                f"{MAX_IMU_GAP:g} s between the alignment at {begin:g} s and the end of the game at {end:g} s; {remedy}"
            )

    @cached_property
    def _truth(self) -> tuple[Floats, Floats] | None:
        """Position and velocity (ENU, m/s) of the reference at the epochs, (E, 3) each; None = the log has none."""
        reference = self.log.reference
        return None if reference is None else interpolate(reference, self.epoch_time)

    @cached_property
    def model(self) -> StrapdownModel:
        """All epochs after the alignment, with fixes in place of the truth where the log has no reference."""
        log, time, align_time = self.log, self.epoch_time, self.log.fixes.time[self.alignment.fix]
        ends = np.concatenate([[align_time], time])
        inside = (log.imu_time > align_time) & (log.imu_time < time[-1])
        grid = np.union1d(log.imu_time[inside], ends)

        def means(samples: Floats) -> Floats:
            """Of straight lines between the samples, over each step of the grid."""
            at = np.column_stack([np.interp(grid, log.imu_time, samples[:, a]) for a in range(3)])
            return 0.5 * (at[1:] + at[:-1])

        velocity, position = velocity_of(log.fixes)[self._fix], log.fixes.position[self._fix]
        prior = self.tuning.initial_sigma(self.grade)
        sigma = self._measurement_sigma
        prior[6:9] = sigma[0, :3]
        return StrapdownModel(
            time=time,
            angular_rate=means(log.angular_rate),
            specific_force=means(log.specific_force),
            step=np.diff(grid),
            boundaries=np.searchsorted(grid, ends).astype(np.int64),
            fix_position=position,
            fix_velocity=velocity,
            true_position=position if self._truth is None else self._truth[0],
            true_velocity=velocity if self._truth is None else self._truth[1],
            lever_arm=np.zeros(3),
            latency_samples=0,
            measurement_covariance=np.square(sigma)[:, :, None] * np.eye(self.dimension),
            filter_density=self.tuning.noise_density(self.grade),
            true_noise=np.zeros(9),
            instability_sigma=np.zeros(6),
            instability_decay=1.0,
            attitude=self.alignment.attitude,
            velocity=self.alignment.velocity,
            position=self.alignment.position,
            prior_covariance=np.diag(np.square(self.tuning.initial_scale * prior)),
        )

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
        if fixes.velocity is not None and not fixes.velocity[:, 2].any():
            sigma[:, 5:] = UNMEASURED_SIGMA
        return sigma

    @cached_property
    def clean(self) -> CleanRun:
        """The filter on the unspoofed fixes, from the alignment to the end of the log."""
        run = clean_run(self.model)
        if not np.all(np.isfinite(run.position)):
            raise ValueError(
                f"scenario {self.name!r}: the filter diverges on this log; check imu_to_body_frd and grade"
            )
        return run

    @cached_property
    def true_position(self) -> Floats:
        """Of all epochs after the alignment, (E, 3): the reference's, else the clean run's."""
        return self.clean.position[1:] if self._truth is None else self._truth[0]

    @property
    def true_velocity(self) -> Floats:
        """Of all epochs after the alignment, (E, 3), ENU, m/s: the reference's, else the clean run's."""
        return self.clean.velocity[1:] if self._truth is None else self._truth[1]

    def _first(self, burn_in: int) -> int:
        if burn_in > self.first:
            raise ValueError(
                f"scenario {self.name!r}: a detector looks back {burn_in} epochs, but there are {self.first} between "
                f"the alignment and the onset at {self.timeline.start:g} s: begin later"
            )
        return self.first - burn_in

    @property
    def bias_sigma(self) -> Floats:
        """Data-sheet bias of the IMU grade that the filter believes in, (6,), rad/s and m/s²."""
        return np.hypot(self.grade.bias_sigma, self.grade.instability_sigma)

    def times(self, burn_in: int) -> Floats:
        """Log time of the epochs -burn_in..K, s."""
        return self.epoch_time[self._first(burn_in) : self.last + 1]

    def velocity(self, burn_in: int = 0) -> Floats:
        """The velocity at epochs -burn_in..K, (burn_in + K + 1, 3), ENU, m/s: the reference's, else the clean run's."""
        return self.true_velocity[self._first(burn_in) : self.last + 1]

    def track(self) -> Floats:
        """The true position at epochs 0..K from that at epoch 0, (K+1, 3), m ENU."""
        position = self.true_position[self.first : self.last + 1]
        return position_difference(position, position[0])

    def linear_model(self, burn_in: int = 0) -> LinearModel:
        """A log has none.

        Raises:
            ValueError: always; the message says what is valid instead.
        """
        raise ValueError(
            f"scenario {self.name!r}: a recorded log has no linear model: knowledge must be 'blind' and action 'rate'"
        )

    def navigator(
        self, fidelity: str, demands: Demands, burn_in: int, num_runs: int, slices: RunSlices
    ) -> StrapdownNavigator:
        """A navigator that starts from the clean run's filter before epoch -burn_in; arguments as in `Scenario`."""
        self.check_fidelity(fidelity)
        first, stop, whole, clean = self._first(burn_in), self.last + 1, self.model, self.clean
        model = replace(
            whole,
            time=whole.time[first:stop],
            boundaries=whole.boundaries[first : stop + 1],
            fix_position=whole.fix_position[first:stop],
            fix_velocity=whole.fix_velocity[first:stop],
            true_position=self.true_position[first:stop],
            true_velocity=self.true_velocity[first:stop],
            measurement_covariance=whole.measurement_covariance[first:stop],
            attitude=clean.attitude[first],
            velocity=clean.velocity[first],
            position=clean.position[first],
            prior_covariance=clean.covariance[first],
        )
        return StrapdownNavigator(model, num_runs, slices, demands)

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
) -> RecordedScenario:
    """A log in the project's format as a game.

    Args:
        path: folder of the log; no comma in it.
        grade: name of the IMU grade that the filter believes in.
        onset: time of the last clean fix, s (the last fix up to it is taken); None = a third of the way from the log's
            start to its end.
        horizon: epochs of the game; None = to the end of the log.
        velocity: whether the filter uses the receiver's velocity beside its position; None = where the log has it.
        sigma_floor: smallest 1 sigma of a fix that the filter believes, m and m/s.
        noise_factor: the filter's white inertial noise over the data sheet's.
        fixes: which ones the filter takes: ``phone``, those in the log, whatever receiver made them, or ``ranges``,
            least squares of the log's raw ranges (`range_fixes`).

    Raises:
        ValueError: a path with a comma, an unknown grade, a log that cannot be used or has no ranges, an onset or a
            horizon outside it, or a number that is not positive.
    """
    path = str(Path(path))
    if "," in path:
        raise ValueError(f"recorded: a path must not contain a comma, which separates options; got {path!r}")
    imu = imu_grade(grade)
    if onset is not None:
        onset = validation.finite("recorded", "onset", onset)
    sigma_floor = validation.above("recorded", "sigma_floor", sigma_floor)
    noise_factor = validation.above("recorded", "noise_factor", noise_factor)
    fixes = validation.one_of("recorded", "fixes", fixes, FIXES)
    log = read_log(path)
    if fixes == "ranges":
        log = replace(log, fixes=range_fixes(log))
    uses_velocity = log.fixes.velocity is not None if velocity is None else velocity
    options = {
        "grade": (grade, "automotive"),
        "onset": (onset, None),
        "horizon": (horizon, None),
        "velocity": (velocity, None),
        "sigma_floor": (sigma_floor, SIGMA_FLOOR),
        "noise_factor": (noise_factor, NOISE_FACTOR),
        "fixes": (fixes, FIXES[0]),
    }
    return RecordedScenario(
        name=spell("recorded", path, **{key: value for key, (value, default) in options.items() if value != default}),
        log=log,
        grade=imu,
        tuning=FilterTuning(
            attitude_sigma=ALIGNMENT_SIGMA,
            velocity_sigma=ALIGNMENT_VELOCITY_SIGMA,
            position_sigma=DEFAULT_SIGMA[:3],
            initial_scale=1.0,
            process_noise_scale=noise_factor**2,
            measurement_sigma=DEFAULT_SIGMA if uses_velocity else DEFAULT_SIGMA[:3],
        ),
        sigma_floor=sigma_floor,
        onset=onset,
        horizon=horizon,
    )
