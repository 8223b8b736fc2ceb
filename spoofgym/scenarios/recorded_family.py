"""What all filters on a log have in common: the log, its alignment, and epochs that need not be equally spaced."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.geodesy import displace, position_difference
from spoofgym.immutable import Immutable
from spoofgym.logs.alignment import Alignment, align
from spoofgym.logs.imu_gaps import refuse_gaps
from spoofgym.logs.log import Log, covered, interpolate, step_means
from spoofgym.logs.log_warning import warn
from spoofgym.logs.spoofed_fixes import RecordedSpoof
from spoofgym.logs.table import seconds
from spoofgym.navigation.facts import FilterFacts
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.strapdown_model import StrapdownModel
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.scenario import Scenario
from spoofgym.scenarios.clean_run import CleanRun, CleanRunDivergedError, coast
from spoofgym.sensors.imu import ImuGrade
from spoofgym.timeline import Timeline

LEAD = 20.0
"""Time before a recorded attack at which its game begins at the latest, s."""
SETTLING = 30.0
"""Time after the alignment that clean figures leave out, s: heading and biases are still being found."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedFamily(Immutable, ABC):
    """Filters on a log, in the strapdown fidelity. They are aligned on its fixes and run from there.

    A family is its own truth: where the log has no reference, the filter's clean run is the truth. Epochs are where the
    receiver gave something; ``timeline.interval`` is the median of the times between them.

    Attributes:
        name: the specification that builds it.
        log: the recording; its fixes are those that the alignment takes.
        grade: of the IMU, as the filter believes.
        tuning: what the filter believes beside it.
        onset: latest time of epoch 0, the last clean epoch, s; None = a third of the way into the log.
        horizon: epochs of the game; None = to the end of the log.
        attacked: whether the game is the attack that the log holds, and begins before it.
        doubts: what is likely wrong with a log on which the filter is bad.
    """

    doubts = (
        "fixes and IMU on different clocks (imu_delay_s, gnss_delay_s), an antenna far from the IMU "
        "(antenna_lever_arm_m), a wrong mounting (imu_to_body_frd), sigmas of fixes that are too small (sigma_floor), "
        "single wrong fixes or inertial samples, columns in other units, an IMU that is worse than its grade"
    )
    fidelities = ("strapdown",)
    matched = False
    random = False

    name: str
    log: Log
    grade: ImuGrade
    tuning: FilterTuning
    onset: float | None = None
    horizon: int | None = None
    aligned: str | None = None
    least_speed: float | None = None
    attacked: bool = False

    def __post_init__(self) -> None:
        onset, end = float(self.epoch_time[self.first]), float(self.epoch_time[self.last])
        refuse_gaps(f"scenario {self.name!r}", self.log.imu_time, self.align_time, onset, end)

    @property
    def truth(self) -> RecordedFamily:
        """Itself."""
        return self

    @property
    @abstractmethod
    def offers(self) -> tuple[str, ...]:
        """What the filter gives to monitors beside innovations."""

    @property
    def facts(self) -> FilterFacts:
        """What the designer of the filter knows."""
        return FilterFacts(
            self.name, self.timeline.interval, self.bias_sigma, self.offers, self.linear_model, matched=self.matched
        )

    @property
    @abstractmethod
    def unmeasured(self) -> Runs:
        """Components of the measurement at each epoch after the alignment that only fill a column of the log, (E,)."""

    @property
    @abstractmethod
    def epoch_time(self) -> Floats:
        """Times of all epochs after the alignment, (E,), s."""

    @property
    @abstractmethod
    def model(self) -> StrapdownModel:
        """Inertial samples and prior of all epochs after the alignment."""

    @property
    @abstractmethod
    def clean(self) -> CleanRun:
        """The filter on unspoofed measurements, from the alignment to the end of the log."""

    @property
    def spoofed_within(self) -> bool:
        """Whether the log's own measurements are spoofed at some time: nobody knows the true ones then."""
        return False

    @abstractmethod
    def recorded_spoof(self) -> RecordedSpoof:
        """The real attack that the log holds; raises ValueError where there is none."""

    @property
    @abstractmethod
    def _prior_sigma(self) -> Floats:
        """Of the error of the alignment, (15,)."""

    @property
    def _filter_density(self) -> Floats:
        """The filter's process noise, (15,), unit²/s."""
        return self.tuning.noise_density(self.grade)

    @property
    def align_time(self) -> float:
        """Of the fix that the filter starts from, s."""
        return float(self.log.fixes.time[self.alignment.fix])

    @cached_property
    def _end(self) -> float:
        """As far as IMU and reference reach, s.

        Raises:
            ValueError: the reference ends before the alignment.
        """
        log, end = self.log, float(self.log.imu_time[-1])
        if log.reference is None:
            return end
        if log.reference.time[-1] <= self.align_time:
            raise ValueError(
                f"scenario {self.name!r}: the reference ends at {seconds(log.reference.time[-1])} s, before the "
                f"alignment at {seconds(self.align_time)} s"
            )
        return min(end, float(log.reference.time[-1]))

    @cached_property
    def alignment(self) -> Alignment:
        """Where the filter starts."""
        return align(self.log, self.aligned, self.least_speed)

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
            latest = self.recorded_spoof().begin - LEAD if self.attacked else time[-2]
            onset = min(max(min(onset, latest), time[0]), time[-2])
        if not time[0] <= onset < time[-1]:
            raise ValueError(
                f"scenario {self.name!r}: onset {seconds(onset)} s lies outside the log: valid from "
                f"{seconds(time[0])} s (the first fix after the alignment) to {seconds(time[-2])} s"
            )
        first = int(np.searchsorted(time, onset + 1e-9, side="right")) - 1
        longest = len(time) - 1 - first
        if self.horizon is not None and not 1 <= self.horizon <= longest:
            raise ValueError(
                f"scenario {self.name!r}: horizon {self.horizon} does not fit: valid from 1 to {longest} epochs after "
                f"{seconds(onset)} s"
            )
        return first

    @property
    def last(self) -> int:
        """The last epoch of the game, counted as `first`."""
        return len(self.epoch_time) - 1 if self.horizon is None else self.first + self.horizon

    @property
    def timeline(self) -> Timeline:
        """The epochs of the game."""
        time = self.epoch_time[self.first : self.last + 1]
        return Timeline(time, float(np.median(np.diff(time))))

    @cached_property
    def compared(self) -> Flags:
        """Epochs after the alignment whose true position is known, (E,): not in a hole of the reference.

        Without a reference, which makes the clean run the truth, these are all.
        """
        reference = self.log.reference
        return np.ones(len(self.epoch_time), dtype=bool) if reference is None else covered(reference, self.epoch_time)

    @cached_property
    def _truth(self) -> tuple[Floats, Floats] | None:
        """Position and velocity (ENU, m/s) of the reference at the epochs, (E, 3) each; None = the log has none.

        In a hole, or before the reference begins, they mean nothing.
        """
        reference = self.log.reference
        if reference is None:
            return None
        return interpolate(reference, np.clip(self.epoch_time, reference.time[0], reference.time[-1]))

    def _known(self, truth: int, otherwise: Floats) -> Floats:
        """Position (0) or velocity (1) of the reference, and something else, (E, 3), where it does not know it."""
        return otherwise if self._truth is None else np.where(self.compared[:, None], self._truth[truth], otherwise)

    @property
    def cuts(self) -> Floats:
        """Times at which a step of the inertial samples must end, beside those of the epochs, s: none by default."""
        return np.zeros(0)

    @cached_property
    def grid(self) -> Floats:
        """Ends of the steps of the inertial samples, from the alignment to the last epoch, s."""
        log, time = self.log, self.epoch_time
        inside = (log.imu_time > self.align_time) & (log.imu_time < time[-1])
        return np.union1d(np.concatenate([log.imu_time[inside], self.cuts]), np.concatenate([[self.align_time], time]))

    def _inertial_model(self, position: Floats, velocity: Floats, covariance: Floats) -> StrapdownModel:
        """The samples of all epochs after the alignment, as straight lines cut so that a step ends at each epoch.

        Args:
            position: of the fixes, and of the truth where no reference tells it, (E, 3).
            velocity: of the fixes, and of the truth where no reference tells it, (E, 3), ENU, m/s.
            covariance: the filter's R of fixes, (E, m, m).
        """
        log, time, grid = self.log, self.epoch_time, self.grid
        return StrapdownModel(
            time=time,
            angular_rate=step_means(log.imu_time, log.angular_rate, grid),
            specific_force=step_means(log.imu_time, log.specific_force, grid),
            step=np.diff(grid),
            boundaries=np.searchsorted(grid, np.concatenate([[self.align_time], time])).astype(np.int64),
            fix_position=position,
            fix_velocity=velocity,
            true_position=self._known(0, position),
            true_velocity=self._known(1, velocity),
            lever_arm=self.log.lever_arm,
            latency_samples=0,
            measurement_covariance=covariance,
            filter_density=self._filter_density,
            true_noise=np.zeros(9),
            instability_sigma=np.zeros(6),
            instability_decay=1.0,
            attitude=self.alignment.attitude,
            velocity=self.alignment.velocity,
            position=self.alignment.position(self.log),
            prior_covariance=np.diag(np.square(self.tuning.initial_scale * self._prior_sigma)),
        )

    def _game_model(self, first: int) -> StrapdownModel:
        """The part of `model` from an epoch to the end of the game, begun from the clean run's filter."""
        stop, whole, clean = self.last + 1, self.model, self.clean
        return replace(
            whole.part(first, stop),
            true_position=self.true_position[first:stop],
            true_velocity=self.true_velocity[first:stop],
            attitude=clean.attitude[first],
            velocity=clean.velocity[first],
            position=clean.position[first],
            prior_covariance=clean.covariance[first],
        )

    @contextmanager
    def _refusing_divergence(self) -> Iterator[None]:
        """Refuse the log where the clean run made in this block diverges.

        Raises:
            ValueError: it does; the message says when, and likely reasons.
        """
        try:
            yield
        except CleanRunDivergedError as error:
            raise ValueError(
                f"scenario {self.name!r}: the filter diverges on this log; innovations are first too large at "
                f"{seconds(error.lost)} s{self.log.fixes.line(error.lost)}; likely reasons: {self.doubts} ({error})"
            ) from error

    def _warn_of_large_innovations(self, run: CleanRun) -> None:
        """Warn of a clean run whose innovations are too large.

        Warns:
            LogWarning: the mean NIS, from `SETTLING` after the alignment on, and likely reasons.
        """
        settled = int(np.searchsorted(self.epoch_time, self.align_time + SETTLING))
        first = settled if settled < len(self.epoch_time) else 0
        if run.is_doubtful(first):
            time = float(self.epoch_time[first + int(np.argmax(run.nis[first:]))])
            place = f"{seconds(time)} s{self.log.fixes.line(time)}"
            warn(self.log.folder, f"{run.told(first)} at {place}; likely reasons: {self.doubts}")

    @cached_property
    def true_position(self) -> Floats:
        """Of all epochs after the alignment, (E, 3): the reference's, else the clean run's.

        In a hole of the reference it is the clean run's, less its error at the ends of the hole, in between a straight
        line in time: what a game needs to go on, but no truth.
        """
        clean = self.clean.position[1:]
        place = self._known(0, clean)
        if self.compared.all():
            return place
        error = self._across_holes(position_difference(place, clean))
        return np.where(self.compared[:, None], place, displace(clean, error))

    @cached_property
    def true_velocity(self) -> Floats:
        """Of all epochs after the alignment, (E, 3), ENU, m/s, formed as the position is."""
        clean = self.clean.velocity[1:]
        velocity = self._known(1, clean)
        return np.where(self.compared[:, None], velocity, clean + self._across_holes(velocity - clean))

    def _across_holes(self, error: Floats) -> Floats:
        """Something of the epochs, (E, 3), in holes of the reference by straight lines between their ends."""
        known = self.compared
        if not known.any():
            return error
        return np.column_stack([np.interp(self.epoch_time, self.epoch_time[known], axis[known]) for axis in error.T])

    def _first(self, burn_in: int) -> int:
        if burn_in > self.first:
            raise ValueError(
                f"scenario {self.name!r}: a detector looks back {burn_in} epochs, but there are {self.first} between "
                f"the alignment and the onset at {seconds(self.timeline.start)} s: begin later"
            )
        return self.first - burn_in

    @property
    def bias_sigma(self) -> Floats:
        """Data-sheet bias of the IMU grade that the filter believes in, (6,), rad/s and m/s²."""
        return self.grade.whole_bias_sigma

    def times(self, burn_in: int) -> Floats:
        """Log time of the epochs -burn_in..K, s."""
        return self.epoch_time[self._first(burn_in) : self.last + 1]

    def velocity(self, burn_in: int = 0) -> Floats:
        """The velocity at epochs -burn_in..K, (burn_in + K + 1, 3), ENU, m/s: the reference's, else the clean run's."""
        return self.true_velocity[self._first(burn_in) : self.last + 1]

    def velocity_in_steps(self) -> Floats:
        """The velocity at the moments of the timeline's steps, (M+1, 3), ENU, m/s.

        Between epochs it is that of the inertial samples, which a straight line in time leads from the velocity at one
        epoch to that at the next.
        """
        moments, _, epochs = self.timeline.steps
        velocity = np.empty((len(moments), 3))
        velocity[epochs] = self.velocity()
        for k in np.flatnonzero(np.diff(epochs) > 1).tolist():
            inside, ends = moments[epochs[k] + 1 : epochs[k + 1]], self.timeline.times[[k, k + 1]]
            time, coasting = coast(self.model, self.clean, self.first + k + 1)
            amiss = velocity[epochs[[k, k + 1]]] - coasting[[0, -1]]
            for a in range(3):
                between = np.interp(inside, time, coasting[:, a]) + np.interp(inside, ends, amiss[:, a])
                velocity[epochs[k] + 1 : epochs[k + 1], a] = between
        return velocity

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


def recorded_family(scenario: Scenario) -> RecordedFamily:
    """The filters of a recorded log.

    Raises:
        ValueError: the scenario is simulated.
    """
    if not isinstance(scenario.family, RecordedFamily):
        raise ValueError(f"scenario {scenario.name!r} is no recorded log")
    return scenario.family
