"""What a game is played on: truth, sensors, filter settings and the stretch of time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.burn_in_cache import kept_by_burn_in
from spoofgym.geodesy import position_difference
from spoofgym.immutable import Immutable
from spoofgym.navigation.facts import INERTIAL_SOLUTION, LINEAR_MODEL, FilterFacts
from spoofgym.navigation.interface import Demands, Navigator, Spoof
from spoofgym.navigation.linear_model import ErrorDynamics, LinearModel, error_dynamics, linear_model
from spoofgym.navigation.loose.adaptation import Adaptation
from spoofgym.navigation.loose.adaptive import AdaptiveNavigator, AdaptiveStrapdownNavigator
from spoofgym.navigation.loose.mean import LooseMeanFilter
from spoofgym.navigation.loose.own_gains import OwnCovarianceNavigator
from spoofgym.navigation.loose.shared_gains import LinearNavigator
from spoofgym.navigation.loose.strapdown import StrapdownNavigator
from spoofgym.navigation.loose.strapdown_model import strapdown_model
from spoofgym.navigation.loose.warm_start import COLOUR, RANGES, WarmStart, cold_start, num_joint, warm_up
from spoofgym.navigation.mean import MeanFilter
from spoofgym.navigation.tight.model import TightModel
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.navigation.white import WhiteInnovations
from spoofgym.parallel import RunSlices
from spoofgym.sensors.imu import ImuGrade
from spoofgym.sensors.range_fix import RangeFix, draw_fix_noise
from spoofgym.sensors.receiver import Receiver, draw_noise
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline, manoeuvre_times
from spoofgym.trajectory import Trajectory
from spoofgym.validation import shown, written

FIDELITIES = ("linear", "strapdown")
ROUNDING = 1e-9
"""Times closer than this are the same, s."""


class Scenario(Immutable, ABC):
    """What a simulation asks of a scenario.

    Attributes:
        name: the specification that builds it.
        timeline: the epochs of the game.
        dimension: m, of the fix.
        drag_off_rate: the largest rate at which a spoofer moves the position, per axis (E, N, U), m/s.
        error_scale: metres of navigation error that make a spoofer's reward of 1.
        defender_scale: metres of navigation error that cost a defender 1.
        depth_table: depths among which a defender chooses, epochs.
        history: epochs that the navigator keeps at least, where somebody can backtrack.
        bias_sigma: data-sheet bias of the IMU's gyros and accelerometers, constant and unstable part together, (6,),
            rad/s and m/s².
        fidelities: the valid ones.
        offers: what its navigator gives to monitors beside innovations.
        matched: whether the filter's model is the truth, so that clean innovations are white.
        random: whether every episode is drawn anew; a recorded log has one realisation.
        coupling: ``loose``: the filter takes fixes; ``tight``: it takes the ranges to satellites.
        slots: S, satellites that a tightly coupled filter tracks at most.
        clock_rate: the largest rate at which a spoofer pulls the clock of a receiver of ranges, m/s.
        alert_limits: horizontal and vertical position error from which the navigation is hazardous, m.
    """

    name: str
    timeline: Timeline
    dimension: int
    drag_off_rate: tuple[float, float, float]
    error_scale: float
    defender_scale: float = 10.0
    depth_table: tuple[int, ...] = (0, 5, 10, 20, 50)
    history: int = 60
    fidelities: tuple[str, ...] = FIDELITIES
    offers: tuple[str, ...] = (INERTIAL_SOLUTION, LINEAR_MODEL)
    matched: bool
    random: bool = True
    coupling: str = "loose"
    slots: int = 0
    clock_rate: float = 0.0
    alert_limits: tuple[float, float] = (556.0, 50.0)

    @property
    @abstractmethod
    def bias_sigma(self) -> Floats:
        """Data-sheet bias of the IMU, (6,), rad/s and m/s²."""

    @property
    def facts(self) -> FilterFacts:
        """What the designer of the filter knows."""
        return FilterFacts(
            self.name, self.timeline.interval, self.bias_sigma, self.offers, self.linear_model, matched=self.matched
        )

    def manoeuvres(self) -> tuple[float, ...]:
        """Times within the game at which the vehicle begins to change its velocity, s."""
        return manoeuvre_times(self.velocity_in_steps(), self.timeline)

    @abstractmethod
    def times(self, burn_in: int) -> Floats:
        """Scenario time of the epochs -burn_in..K, s."""

    @abstractmethod
    def velocity(self, burn_in: int = 0) -> Floats:
        """The true velocity at epochs -burn_in..K, which a spoofer tracks, (burn_in + K + 1, 3), ENU, m/s."""

    def velocity_in_steps(self) -> Floats:
        """The true velocity at the moments of the timeline's steps, (M+1, 3), ENU, m/s.

        These are epochs 0..K where no epoch is missing.
        """
        return self.velocity()

    @abstractmethod
    def track(self) -> Floats:
        """The true position at epochs 0..K from that at epoch 0, (K+1, 3), m ENU."""

    @abstractmethod
    def linear_model(self, burn_in: int = 0) -> LinearModel:
        """The game in the linear fidelity from epoch -burn_in on, every fix used: what a shadow filter knows.

        Raises:
            ValueError: the scenario has no such model.
        """

    def tight_model(self, burn_in: int = 0) -> TightModel:
        """The game of a tightly coupled filter from epoch -burn_in on, every range used.

        Raises:
            ValueError: the filter is loosely coupled.
        """
        raise ValueError(f"scenario {self.name!r} is loosely coupled: it has a linear_model, not a tight_model")

    def mean_filter(self, num_runs: int, slices: RunSlices) -> MeanFilter:
        """The filter of ``num_runs`` games run in expectation, which is what a spoofer's shadow filter is.

        Args:
            num_runs: N.
            slices: the threads to use.

        Raises:
            ValueError: the scenario has no linear model.
        """
        return LooseMeanFilter(self.linear_model(), num_runs, slices)

    def white_innovations(self) -> WhiteInnovations:
        """What clean innovations at epochs 0..K are made of, where the filter is matched."""
        return WhiteInnovations(self.linear_model().innovation_factor)

    def spoofed(self, fidelity: str, index: Runs, burn_in: int, spoof: Spoof) -> Floats:
        """What a spoofer adds to the measurements of runs, (k, m), m and m/s.

        Args:
            fidelity: of the navigator.
            index: epoch of each run, counted from the burn-in's first, (k,).
            burn_in: clean epochs before epoch 0.
            spoof: what the receivers are made to believe.
        """
        if self.dimension == 3:
            return spoof.offset
        return np.concatenate([spoof.offset, spoof.rate], axis=1)

    def disturbed(self, multipath: Floats, burn_in: int) -> Floats:
        """What multipath adds to the measurements at epochs 0..K, (k, K+1, m), from its effect on fixes, likewise."""
        return multipath

    def satellites(self, index: Runs, burn_in: int) -> Runs:
        """Number of the satellite in each slot at epochs counted from the burn-in's first, (k, S); -1 = none."""
        return np.full((len(index), self.slots), -1)

    @abstractmethod
    def navigator(
        self, fidelity: str, demands: Demands, burn_in: int, num_runs: int, slices: RunSlices
    ) -> Navigator:
        """A navigator of ``num_runs`` runs whose model starts ``burn_in`` epochs before epoch 0.

        Args:
            fidelity: one of `fidelities`.
            demands: what the players ask of it.
            burn_in: clean epochs before epoch 0.
            num_runs: N.
            slices: the threads to use.
        """

    @abstractmethod
    def draw_initial(self, runs: Runs, burn_in: int, streams: RunStreams) -> Floats:
        """Joint states of truth and filter just before epoch -burn_in, (n, 30)."""

    @abstractmethod
    def draw_receiver_noise(self, runs: Runs, initial: Floats, burn_in: int, streams: RunStreams) -> Floats:
        """Receiver noise of the epochs -burn_in..K, (n, burn_in + K + 1, m), m and m/s."""

    def check_fidelity(self, fidelity: object) -> None:
        """Refuse a fidelity that the scenario does not have.

        Raises:
            ValueError: naming the valid ones.
        """
        if not isinstance(fidelity, str) or fidelity not in self.fidelities:
            valid = ", ".join(self.fidelities)
            raise ValueError(f"scenario {self.name!r} has no fidelity {shown(fidelity)}; valid fidelities: {valid}")


def check_game(owner: str, onset: float, interval: float, horizon: int, trajectory: Trajectory) -> None:
    """Refuse a game that does not fit its trajectory.

    Args:
        owner: whose game, for the message.
        onset: time of epoch 0, s.
        interval: time between epochs, s.
        horizon: epochs of the game.
        trajectory: on which it is played.

    Raises:
        ValueError: no epochs, a game outside the trajectory, or an onset between two epochs.
    """
    if horizon < 1:
        raise ValueError(f"{owner}: horizon must be 1 epoch or more, got {horizon}")
    first, last = 2 * interval, trajectory.time[-1] - horizon * interval
    if not first - ROUNDING <= onset <= last + ROUNDING:
        raise ValueError(
            f"{owner}: onset {written(onset)} s with a horizon of {horizon} epochs does not fit the trajectory "
            f"of {written(trajectory.time[-1])} s: valid from {written(first)} to {written(last)} s"
        )
    if abs(onset / interval - round(onset / interval)) > 1e-9:
        raise ValueError(f"{owner}: onset {written(onset)} s is no epoch of a receiver at {written(1.0 / interval)} Hz")


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedScenario(Scenario):
    """A scenario with a known true trajectory.

    Attributes:
        name: the specification that builds it.
        trajectory: the truth, at the IMU rate.
        grade: of the IMU.
        receiver: of the fixes.
        tuning: what the filter believes.
        onset: time of epoch 0, the last clean fix, s.
        horizon: epochs of the game.
        drag_off_rate: largest rate of the spoofed position per axis, m/s.
        error_scale: metres of error that make a spoofer's reward of 1.
        defender_scale: metres of error that cost a defender 1.
        depth_table: depths among which a defender chooses, epochs.
        true_position_random_walk: what really acts on the INS position, m/√s.
        adaptation: how the filter tunes itself from the first epoch of a burn-in or a game on; None = a filter with
            constant R and Q. `warm_start` and `linear_model` are of that filter, whatever the adaptation.
        ranges: noise of the fixes, from the first of the trajectory on, where they are made from ranges; it comes on
            top of the receiver's. None = they are not.
        alert_limits: horizontal and vertical, m.
    """

    name: str
    trajectory: Trajectory
    grade: ImuGrade
    receiver: Receiver
    tuning: FilterTuning
    onset: float
    horizon: int
    drag_off_rate: tuple[float, float, float]
    error_scale: float
    true_position_random_walk: float
    defender_scale: float = 10.0
    depth_table: tuple[int, ...] = (0, 5, 10, 20, 50)
    adaptation: Adaptation | None = None
    ranges: RangeFix | None = None
    alert_limits: tuple[float, float] = Scenario.alert_limits

    def __post_init__(self) -> None:
        with validation.argument(f"scenario {self.name!r}", "receiver"):
            self.receiver.samples_per_fix(self.trajectory.rate)
        owner = f"scenario {self.name!r}"
        check_game(owner, self.onset, self.receiver.interval, self.horizon, self.trajectory)
        for rate in validation.triple(owner, "drag_off_rate", self.drag_off_rate):
            validation.above(owner, "drag_off_rate", rate)
        validation.above(owner, "error_scale", self.error_scale)
        validation.above(owner, "defender_scale", self.defender_scale)
        if len(self.tuning.measurement_sigma) != self.receiver.dimension:
            raise ValueError(
                f"the filter expects fixes of dimension {len(self.tuning.measurement_sigma)}, the receiver gives "
                f"{self.receiver.dimension}"
            )
        if self.ranges is not None:
            self._check_ranges(self.ranges)

    def _check_ranges(self, ranges: RangeFix) -> None:
        if self.receiver.dimension != 3:
            raise ValueError("fixes from ranges are of position alone: the receiver's velocity_sigma must be None")
        needed = self._first(0) + self.horizon + 1
        if ranges.num_epochs < needed:
            raise ValueError(f"ranges have {ranges.num_epochs} epochs, the game needs {needed} from the start on")

    @property
    def timeline(self) -> Timeline:  # type: ignore[override]
        """The epochs of the game."""
        return Timeline.steady(self.onset, self.receiver.interval, self.horizon)

    @property
    def dimension(self) -> int:  # type: ignore[override]
        """m, of the fix."""
        return self.receiver.dimension

    @property
    def matched(self) -> bool:  # type: ignore[override]
        """Whether the noises that act are white and are those the filter believes in.

        The initial covariance may still be over-stated; what is left of that after the warm-up shows only in states
        that the fixes hardly observe.
        """
        return (
            self.adaptation is None
            and self.ranges is None
            and not any(self.receiver.markov_sigma)
            and np.allclose(self.receiver.white_deviation, self.tuning.measurement_sigma, rtol=1e-12)
            and not np.any(self.grade.instability_sigma)
            and self.true_position_random_walk == self.tuning.position_random_walk
            and self.tuning.process_noise_scale == 1.0
            and (self.tuning.bias_states or not np.any(self.grade.bias_sigma))
        )

    @property
    def bias_sigma(self) -> Floats:
        """Data-sheet bias of the IMU, (6,), rad/s and m/s²."""
        return np.hypot(self.grade.bias_sigma, self.grade.instability_sigma)

    def times(self, burn_in: int) -> Floats:
        """Scenario time of the epochs -burn_in..K, s."""
        start = self.onset - burn_in * self.receiver.interval
        return Timeline.steady(start, self.receiver.interval, self.horizon + burn_in).times

    def velocity(self, burn_in: int = 0) -> Floats:
        """The true velocity at epochs -burn_in..K, (burn_in + K + 1, 3), ENU, m/s."""
        return self.trajectory.velocity[np.round(self.times(burn_in) * self.trajectory.rate).astype(int)]

    def track(self) -> Floats:
        """The true position at epochs 0..K from that at epoch 0, (K+1, 3), m ENU."""
        position = self.trajectory.position[np.round(self.times(0) * self.trajectory.rate).astype(int)]
        return position_difference(position, position[0])

    @cached_property
    def _dynamics(self) -> ErrorDynamics:
        """From the start of the trajectory to the end of the game."""
        epochs = round(self.timeline.end * self.receiver.rate)
        return error_dynamics(
            self.trajectory, self.grade, self.receiver, self.tuning, self.true_position_random_walk, epochs
        )

    def _first(self, burn_in: int) -> int:
        """Place of epoch -burn_in among those of the trajectory; negative where it does not reach back that far."""
        return round(self.onset * self.receiver.rate) - 1 - burn_in

    def _epochs(self, first: int, last: int) -> ErrorDynamics:
        """Epochs first..last-1 of the trajectory, counted from 0 at its first fix."""
        dynamics = self._dynamics
        return ErrorDynamics(
            dynamics.transition[first:last],
            dynamics.process_noise[first:last],
            dynamics.true_noise[first:last],
            dynamics.observation[first:last],
        )

    @kept_by_burn_in
    def warm_start(self, burn_in: int = 0) -> WarmStart:
        """Truth and filter just before epoch -burn_in.

        Raises:
            ValueError: the trajectory does not reach back that far.
        """
        before = self._first(burn_in)
        if before < 0:
            raise ValueError(
                f"scenario {self.name!r}: the detectors look back {burn_in} epochs, but a burn-in of so many reaches "
                f"before the trajectory, which has {before + burn_in} before the game: take detectors with a shorter "
                "memory, or a later onset where there is one"
            )
        start = cold_start(self.grade, self.receiver, self.tuning, self.ranges)
        return warm_up(start, self._epochs(0, before), self.grade, self.receiver, self.tuning, self.ranges)

    @kept_by_burn_in
    def linear_model(self, burn_in: int = 0) -> LinearModel:
        """The game in the linear fidelity, from epoch -burn_in on, under the filter with constant R and Q."""
        first = self._first(burn_in)
        timeline = Timeline.steady(
            self.onset - burn_in * self.receiver.interval, self.receiver.interval, self.horizon + burn_in
        )
        dynamics = self._epochs(first, first + timeline.num_epochs + 1)
        return linear_model(dynamics, self.warm_start(burn_in).filter_covariance, self.tuning, timeline)

    def navigator(
        self, fidelity: str, demands: Demands, burn_in: int, num_runs: int, slices: RunSlices
    ) -> Navigator:
        """A navigator whose model starts ``burn_in`` epochs before epoch 0; arguments as in `Scenario`."""
        self.check_fidelity(fidelity)
        interval = self.receiver.interval
        if fidelity == "linear":
            linear = self.linear_model(burn_in)
            if self.adaptation is not None:
                return AdaptiveNavigator(linear, self.grade, interval, num_runs, slices, self.adaptation, demands)
            kind = OwnCovarianceNavigator if demands.excludes else LinearNavigator
            return kind(linear, self.grade, interval, num_runs, slices, demands)
        model = strapdown_model(
            self.trajectory,
            self.grade,
            self.receiver,
            self.tuning,
            self.true_position_random_walk,
            self.warm_start(burn_in).filter_covariance,
            Timeline.steady(self.times(burn_in)[0], interval, self.horizon + burn_in),
        )
        if self.adaptation is not None:
            return AdaptiveStrapdownNavigator(model, num_runs, slices, self.adaptation, demands)
        return StrapdownNavigator(model, num_runs, slices, demands)

    def draw_initial(self, runs: Runs, burn_in: int, streams: RunStreams) -> Floats:
        """Joint states of truth and filter just before epoch -burn_in, (n, 30), and slow errors of ranges, if any."""
        factor = self.warm_start(burn_in).joint_factor
        normals = np.empty((len(runs), num_joint(self.ranges)))
        for place, run in enumerate(runs):
            streams(run, "initial").standard_normal(out=normals[place])
        initial = np.zeros_like(normals)
        for j in np.flatnonzero(factor.any(axis=0)):
            initial += normals[:, j, None] * factor[:, j]
        return initial

    def draw_receiver_noise(self, runs: Runs, initial: Floats, burn_in: int, streams: RunStreams) -> Floats:
        """Receiver noise of the epochs -burn_in..K, (n, burn_in + K + 1, m), m and m/s."""
        epochs = burn_in + self.horizon + 1
        noise = np.empty((len(runs), epochs, self.dimension))
        for place, run in enumerate(runs):
            stream = streams(run, "receiver")
            noise[place] = draw_noise(self.receiver, epochs, stream, initial[place, COLOUR])
            if self.ranges is not None:
                first = self._first(burn_in)
                noise[place] += draw_fix_noise(self.ranges, first, first + epochs, stream, initial[place, RANGES])
        return noise
