"""The loosely coupled filter on a simulated trajectory: 15 error states, corrected by fixes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.burn_in_cache import kept_by_burn_in
from spoofgym.navigation.facts import COASTING, INERTIAL_SOLUTION, LINEAR_MODEL, FilterFacts
from spoofgym.navigation.family import FIDELITIES
from spoofgym.navigation.interface import Demands, Navigator
from spoofgym.navigation.linear_model import ErrorDynamics, LinearModel, error_dynamics, linear_model
from spoofgym.navigation.loose.adaptation import Adaptation
from spoofgym.navigation.loose.adaptive import AdaptiveNavigator, AdaptiveStrapdownNavigator
from spoofgym.navigation.loose.fixes import FixFamily
from spoofgym.navigation.loose.own_gains import OwnCovarianceNavigator
from spoofgym.navigation.loose.shared_gains import LinearNavigator
from spoofgym.navigation.loose.strapdown import StrapdownNavigator
from spoofgym.navigation.loose.strapdown_model import StrapdownModel, strapdown_model
from spoofgym.navigation.loose.warm_start import COLOUR, RANGES, WarmStart, cold_start, num_joint, warm_up
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.parallel import RunSlices
from spoofgym.sensors.imu import ImuGrade
from spoofgym.sensors.range_fix import RangeFix, draw_fix_noise
from spoofgym.sensors.receiver import Receiver, draw_noise
from spoofgym.streams import RunStreams
from spoofgym.truth import SimulatedTruth


@dataclass(frozen=True, kw_only=True, eq=False)
class LooseFamily(FixFamily):
    """Loosely coupled filters on a simulated trajectory.

    Attributes:
        truth: the true motion, whose epochs are those of the receiver.
        grade: of the IMU.
        receiver: of the fixes.
        tuning: what the filter believes.
        true_position_random_walk: what really acts on the INS position, m/√s.
        adaptation: how the filter tunes itself from the first epoch of a burn-in or a game on; None = a filter with
            constant R and Q. `warm_start` and `linear_model` are of that filter, whatever the adaptation.
        ranges: noise of the fixes, from the first of the trajectory on, where they are made from ranges; it comes on
            top of the receiver's. None = they are not.
    """

    truth: SimulatedTruth
    grade: ImuGrade
    receiver: Receiver
    tuning: FilterTuning
    true_position_random_walk: float
    adaptation: Adaptation | None = None
    ranges: RangeFix | None = None

    fidelities = FIDELITIES
    offers: ClassVar[tuple[str, ...]] = (INERTIAL_SOLUTION, LINEAR_MODEL, COASTING)
    random = True

    def __post_init__(self) -> None:
        owner = f"scenario {self.truth.name!r}"
        with validation.argument(owner, "receiver"):
            self.receiver.samples_per_fix(self.truth.trajectory.rate)
        if self.receiver.rate != self.truth.rate:
            raise ValueError(
                f"{owner}: epochs must be those of the receiver, got {self.truth.rate} Hz with a receiver at "
                f"{self.receiver.rate} Hz"
            )
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
        needed = self.truth.first(0) + self.truth.horizon + 1
        if ranges.num_epochs < needed:
            raise ValueError(f"ranges have {ranges.num_epochs} epochs, the game needs {needed} from the start on")

    @property
    def dimension(self) -> int:
        """m, of the fix."""
        return self.receiver.dimension

    @property
    def matched(self) -> bool:
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
        return self.grade.whole_bias_sigma

    @property
    def facts(self) -> FilterFacts:
        """What the designer of the filter knows."""
        return FilterFacts(
            self.truth.name,
            self.truth.timeline.interval,
            self.bias_sigma,
            self.offers,
            self.linear_model,
            matched=self.matched,
        )

    @cached_property
    def dynamics(self) -> ErrorDynamics:
        """What acts on an error from the start of the trajectory to the end of the game."""
        epochs = round(self.truth.timeline.end * self.receiver.rate)
        return error_dynamics(
            self.truth.trajectory, self.grade, self.receiver, self.tuning, self.true_position_random_walk, epochs
        )

    def epochs(self, first: int, last: int) -> ErrorDynamics:
        """What acts in epochs first..last-1 of the trajectory, counted from 0 at its first fix."""
        dynamics = self.dynamics
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
        before = self._before(burn_in)
        start = cold_start(self.grade, self.receiver, self.tuning, self.ranges)
        return warm_up(start, self.epochs(0, before), self.grade, self.receiver, self.tuning, self.ranges)

    def _before(self, burn_in: int) -> int:
        """Epochs of the trajectory before epoch -burn_in; raises as `warm_start`."""
        before = self.truth.first(burn_in)
        if before < 0:
            raise ValueError(
                f"scenario {self.truth.name!r}: the detectors look back {burn_in} epochs, but a burn-in of so many "
                f"reaches before the trajectory, which has {before + burn_in} before the game: take detectors with a "
                "shorter memory, or a later onset where there is one"
            )
        return before

    @kept_by_burn_in
    def linear_model(self, burn_in: int = 0) -> LinearModel:
        """The game in the linear fidelity, from epoch -burn_in on, under the filter with constant R and Q."""
        first, timeline = self.truth.first(burn_in), self.truth.timeline_from(burn_in)
        dynamics = self.epochs(first, first + timeline.num_epochs + 1)
        prior = self.warm_start(burn_in).filter_covariance
        return linear_model(dynamics, prior, self.tuning.measurement_covariance, timeline)

    def _strapdown_model(self, burn_in: int) -> StrapdownModel:
        """The game in the strapdown fidelity, from epoch -burn_in on."""
        return strapdown_model(
            self.truth.trajectory,
            self.grade,
            self.receiver,
            self.tuning,
            self.true_position_random_walk,
            self.warm_start(burn_in).filter_covariance,
            self.truth.timeline_from(burn_in),
        )

    def navigator(
        self, fidelity: str, demands: Demands, burn_in: int, num_runs: int, slices: RunSlices
    ) -> Navigator:
        """A navigator whose model starts ``burn_in`` epochs before epoch 0; arguments as in `FilterFamily`."""
        if fidelity == "strapdown":
            model = self._strapdown_model(burn_in)
            if self.adaptation is not None:
                return AdaptiveStrapdownNavigator(model, num_runs, slices, self.adaptation, demands)
            return StrapdownNavigator(model, num_runs, slices, demands)
        linear, interval = self.linear_model(burn_in), self.receiver.interval
        if self.adaptation is not None:
            return AdaptiveNavigator(linear, self.grade, interval, num_runs, slices, self.adaptation, demands)
        kind = OwnCovarianceNavigator if demands.excludes else LinearNavigator
        return kind(linear, self.grade, interval, num_runs, slices, demands)

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
        epochs = burn_in + self.truth.horizon + 1
        noise = np.empty((len(runs), epochs, self.dimension))
        for place, run in enumerate(runs):
            stream = streams(run, "receiver")
            noise[place] = draw_noise(self.receiver, epochs, stream, initial[place, COLOUR])
            if self.ranges is not None:
                first = self.truth.first(burn_in)
                noise[place] += draw_fix_noise(self.ranges, first, first + epochs, stream, initial[place, RANGES])
        return noise
