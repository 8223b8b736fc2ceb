"""A game on the tightly coupled filter: truth, ranges to satellites, filter settings and the stretch of time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.burn_in_cache import kept_by_burn_in
from spoofgym.geodesy import displace, geodetic_to_ecef, position_difference
from spoofgym.navigation.facts import INERTIAL_SOLUTION, RANGES, FilterFacts
from spoofgym.navigation.interface import Demands, Navigator, Spoof
from spoofgym.navigation.linear_model import LinearModel, error_dynamics, semidefinite_factor
from spoofgym.navigation.loose.strapdown_model import strapdown_model
from spoofgym.navigation.mean import MeanFilter
from spoofgym.navigation.tight.mean import TightMeanFilter
from spoofgym.navigation.tight.model import (
    TightDynamics,
    TightModel,
    bias_variance,
    cold_covariance,
    settle,
    tight_dynamics,
    tight_model,
)
from spoofgym.navigation.tight.own_gains import TightOwnNavigator
from spoofgym.navigation.tight.shared_gains import TightNavigator
from spoofgym.navigation.tight.states import BIAS, OBSERVABLES
from spoofgym.navigation.tight.strapdown import TightStrapdownNavigator
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.navigation.white import WhiteInnovations
from spoofgym.parallel import RunSlices
from spoofgym.scenario import Scenario, check_game
from spoofgym.sensors.geometry import Constellation, SatelliteGeometry, view
from spoofgym.sensors.imu import ImuGrade
from spoofgym.sensors.ranging import RangeErrors
from spoofgym.sensors.receiver import Receiver
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline
from spoofgym.trajectory import Trajectory


@dataclass(frozen=True, kw_only=True, eq=False)
class TightScenario(Scenario):
    """A scenario with a known true trajectory whose filter takes the ranges themselves.

    The filter is matched: every error of the IMU and of the ranges acts as the filter believes.

    Attributes:
        name: the specification that builds it.
        trajectory: the truth, at the IMU rate.
        grade: of the IMU.
        errors: of the ranges.
        constellation: where the satellites are.
        start_time: the constellation's time at the start of the trajectory, s.
        rate: of the receiver, Hz.
        mask: elevation below which a satellite is not used, rad.
        observable: ``carrier`` or ``rate``, beside the code.
        tuning: the filter's initial uncertainty and process noise; its measurement noise is not read.
        clock_sigma: initial uncertainty of the receiver's clock, m and m/s.
        onset: time of epoch 0, the last clean epoch, s.
        horizon: epochs of the game.
        drag_off_rate: largest rate of the spoofed position per axis, m/s.
        clock_rate: largest rate of the spoofed clock, m/s.
        error_scale: metres of error that make a spoofer's reward of 1.
        defender_scale: metres of error that cost a defender 1.
        depth_table: depths among which a defender chooses, epochs.
        alert_limits: horizontal and vertical, m.
    """

    name: str
    trajectory: Trajectory
    grade: ImuGrade
    errors: RangeErrors
    constellation: Constellation
    start_time: float
    rate: float
    mask: float
    tuning: FilterTuning
    onset: float
    horizon: int
    drag_off_rate: tuple[float, float, float]
    clock_rate: float
    error_scale: float
    alert_limits: tuple[float, float]
    observable: str = "carrier"
    clock_sigma: tuple[float, float] = (10.0, 1.0)
    defender_scale: float = 50.0
    depth_table: tuple[int, ...] = (0, 5, 10, 20, 50)

    coupling = "tight"
    matched = True
    offers = (INERTIAL_SOLUTION, RANGES)

    def __post_init__(self) -> None:
        check_game(f"scenario {self.name!r}", self.onset, 1.0 / self.rate, self.horizon, self.trajectory)
        if self.observable not in OBSERVABLES:
            raise ValueError(f"observable must be one of {', '.join(OBSERVABLES)}, got {self.observable!r}")

    @property
    def timeline(self) -> Timeline:  # type: ignore[override]
        """The epochs of the game."""
        return Timeline.steady(self.onset, 1.0 / self.rate, self.horizon)

    @property
    def dimension(self) -> int:  # type: ignore[override]
        """m, of the ranges of all slots."""
        return 2 * self.slots

    @property
    def slots(self) -> int:  # type: ignore[override]
        """S, satellites that are tracked at most."""
        return self.geometry.num_slots

    @property
    def bias_sigma(self) -> Floats:
        """Data-sheet bias of the IMU, (6,), rad/s and m/s²."""
        return np.hypot(self.grade.bias_sigma, self.grade.instability_sigma)

    @property
    def facts(self) -> FilterFacts:
        """What the designer of the filter knows."""
        return replace(super().facts, tight_model=self.tight_model)

    def times(self, burn_in: int) -> Floats:
        """Scenario time of the epochs -burn_in..K, s."""
        interval = self.timeline.interval
        return Timeline.steady(self.onset - burn_in * interval, interval, self.horizon + burn_in).times

    def _samples(self, times: Floats) -> Runs:
        return np.asarray(np.round(times * self.trajectory.rate), dtype=np.int64)

    def velocity(self, burn_in: int = 0) -> Floats:
        """The true velocity at epochs -burn_in..K, (burn_in + K + 1, 3), ENU, m/s."""
        return self.trajectory.velocity[self._samples(self.times(burn_in))]

    def track(self) -> Floats:
        """The true position at epochs 0..K from that at epoch 0, (K+1, 3), m ENU."""
        position = self.trajectory.position[self._samples(self.times(0))]
        return position_difference(position, position[0])

    @cached_property
    def geometry(self) -> SatelliteGeometry:
        """The satellites in view at every epoch from the start of the trajectory to the end of the game."""
        interval = self.timeline.interval
        times = np.asarray(interval * np.arange(1, round(self.timeline.end / interval) + 1), dtype=np.float64)
        return view(
            self.constellation, self.trajectory.position[self._samples(times)], self.start_time + times, self.mask
        )

    @cached_property
    def _dynamics(self) -> TightDynamics:
        interval = self.timeline.interval
        # the instability of the biases acts once per epoch, on states of its own
        steady = replace(self.grade, gyro_instability=0.0, accelerometer_instability=0.0)
        inertial = error_dynamics(
            self.trajectory,
            steady,
            Receiver(rate=self.rate),
            self.tuning,
            self.tuning.position_random_walk,
            len(self.geometry.time),
        )
        dynamics = tight_dynamics(inertial, self.grade, self.errors, self.geometry, interval, self.observable)
        return replace(dynamics, time=self.geometry.time - self.start_time)

    def _first(self, burn_in: int) -> int:
        """Place of epoch -burn_in among those of the trajectory.

        Raises:
            ValueError: the trajectory does not reach back that far.
        """
        first = round(self.onset * self.rate) - 1 - burn_in
        if first < 0:
            raise ValueError(
                f"scenario {self.name!r}: a burn-in of {burn_in} epochs reaches before the trajectory, which has "
                f"{first + burn_in} before the game: take detectors with a shorter memory, or a later onset"
            )
        return first

    @kept_by_burn_in
    def tight_model(self, burn_in: int = 0) -> TightModel:
        """The game in the linear fidelity, from epoch -burn_in on, every range used."""
        first = self._first(burn_in)
        inertial = self.tuning.initial_scale * self.tuning.initial_sigma(self.grade)
        cold = cold_covariance(inertial, self.clock_sigma, self.errors, self.slots)
        dynamics = self._dynamics
        prior = settle(dynamics.part(0, first), cold)
        return tight_model(dynamics.part(first, first + self.horizon + burn_in + 1), prior)

    def mean_filter(self, num_runs: int, slices: RunSlices) -> MeanFilter:
        """The filter of ``num_runs`` games run in expectation."""
        return TightMeanFilter(self.tight_model(), num_runs, slices)

    def linear_model(self, burn_in: int = 0) -> LinearModel:
        """A tightly coupled filter has none.

        Raises:
            ValueError: always.
        """
        raise ValueError(f"scenario {self.name!r} is tightly coupled: it has a tight_model, not a linear_model")

    def navigator(
        self, fidelity: str, demands: Demands, burn_in: int, num_runs: int, slices: RunSlices
    ) -> Navigator:
        """A navigator whose model starts ``burn_in`` epochs before epoch 0; arguments as in `Scenario`."""
        self.check_fidelity(fidelity)
        model = self.tight_model(burn_in)
        if fidelity == "linear":
            kind = TightOwnNavigator if demands.excludes else TightNavigator
            return kind(model, num_runs, slices, demands)
        times = self.times(burn_in)
        inertial = strapdown_model(
            self.trajectory,
            self.grade,
            Receiver(rate=self.rate),
            self.tuning,
            self.tuning.position_random_walk,
            model.prior_covariance,
            Timeline.steady(times[0], self.timeline.interval, self.horizon + burn_in),
        )
        first = self._first(burn_in)
        satellites = self.geometry.position[first : first + len(times)]
        return TightStrapdownNavigator(inertial, model, satellites, num_runs, slices, demands)

    @kept_by_burn_in
    def _initial_factors(self, burn_in: int) -> tuple[Floats, Floats]:
        """Square roots of the covariance of the error, (n, n), and of the estimated biases, (6, 6)."""
        prior = self.tight_model(burn_in).prior_covariance
        biases = bias_variance(self.grade, self.timeline.interval, self._first(burn_in))
        estimated = np.diag(biases) - prior[BIAS, BIAS]
        # a filter that begins less certain than the data sheet has not estimated such a bias yet
        wider = np.diag(estimated) < 0.0
        estimated[wider], estimated[:, wider] = 0.0, 0.0
        return semidefinite_factor(prior), semidefinite_factor(estimated)

    def draw_initial(self, runs: Runs, burn_in: int, streams: RunStreams) -> Floats:
        """True error, then estimated biases, just before epoch -burn_in, (k, n + 6).

        The filter is optimal, so its estimates are independent of its errors: the estimated biases have the variance
        that the errors leave of the data sheet's.
        """
        factor, estimated = self._initial_factors(burn_in)
        n = len(factor)
        normals = np.empty((len(runs), n + 6))
        for place, run in enumerate(runs):
            streams(run, "initial").standard_normal(out=normals[place])
        initial = np.zeros_like(normals)
        for j in range(n):
            initial[:, :n] += normals[:, j, None] * factor[:, j]
        for j in range(6):
            initial[:, n:] += normals[:, n + j, None] * estimated[:, j]
        return initial

    def draw_receiver_noise(self, runs: Runs, initial: Floats, burn_in: int, streams: RunStreams) -> Floats:
        """White noise of the ranges at the epochs -burn_in..K, (k, burn_in + K + 1, m), m and m/s."""
        dynamics = self.tight_model(burn_in).dynamics
        sigma = np.sqrt(dynamics.noise_variance) * np.tile(dynamics.present, 2)
        noise = np.empty((len(runs), *sigma.shape))
        for place, run in enumerate(runs):
            streams(run, "receiver").standard_normal(out=noise[place])
        noise *= sigma
        return noise

    def spoofed(self, fidelity: str, index: Runs, burn_in: int, spoof: Spoof) -> Floats:
        """What a spoofer adds to the ranges, (k, m): they become those of a receiver at the offset, its clock moved.

        In the linear fidelity to first order, -e d + c dt; in the strapdown fidelity the difference of the distances.
        """
        dynamics = self.tight_model(burn_in).dynamics
        direction = dynamics.line_of_sight[index]
        if fidelity == "linear":
            code = -along(direction, spoof.offset)
        else:
            nowhere = np.zeros_like(spoof.offset)
            code = self._distance(index, burn_in, spoof.offset) - self._distance(index, burn_in, nowhere)
        code += spoof.clock[:, None]
        second = code
        if self.observable == "rate":
            second = spoof.clock_rate[:, None] - along(direction, spoof.rate)
        return captured_ranges(dynamics.present[index], spoof, code, second)

    def disturbed(self, multipath: Floats, burn_in: int) -> Floats:
        """What multipath adds to the code at epochs 0..K, (k, K+1, m), so that a fix would err by ``multipath``."""
        direction = self.tight_model(burn_in).dynamics.line_of_sight[burn_in:]
        return disturbed_ranges(direction, multipath)

    def satellites(self, index: Runs, burn_in: int) -> Runs:
        """Number of the satellite in each slot, (k, S); -1 = none."""
        return self.tight_model(burn_in).dynamics.satellite[index]

    def white_innovations(self) -> WhiteInnovations:
        """What clean innovations at epochs 0..K are made of."""
        model = self.tight_model()
        return WhiteInnovations(model.innovation_factor, model.position_response, np.tile(model.dynamics.present, 2))

    def _distance(self, index: Runs, burn_in: int, offset: Floats) -> Floats:
        """From the satellites to the true position moved by offsets, (k, S), m."""
        position = displace(self.trajectory.position[self._samples(self.times(burn_in))][index], offset)
        satellites = self.geometry.position[self._first(burn_in) + index] - geodetic_to_ecef(position)[:, None]
        return np.sqrt(satellites[..., 0] ** 2 + satellites[..., 1] ** 2 + satellites[..., 2] ** 2)


def captured_ranges(present: Flags, spoof: Spoof, code: Floats, second: Floats) -> Floats:
    """What a spoofer adds to code and second observable of the satellites that there are and that it captures, (k, m).

    Args:
        present: slots that hold a satellite, (k, S).
        spoof: tells which are captured.
        code: what it adds to each, (k, S), m.
        second: likewise, m or m/s.
    """
    captured = present if spoof.satellites is None else present & spoof.satellites
    return np.concatenate([code * captured, second * captured], axis=1)


def disturbed_ranges(direction: Floats, multipath: Floats) -> Floats:
    """What multipath adds to the code, (k, K+1, m), so that a fix would err by ``multipath``, (k, K+1, 3), m.

    Args:
        direction: unit vectors to the satellites at epochs 0..K, (K+1, S, 3), ENU.
        multipath: its effect on fixes.
    """
    slots = direction.shape[1]
    added = np.zeros((*multipath.shape[:2], 2 * slots))
    for epoch in np.flatnonzero(multipath.any(axis=(0, 2))):
        added[:, epoch, :slots] = -along(direction[epoch][None], multipath[:, epoch])
    return added


def along(direction: Floats, vector: Floats) -> Floats:
    """Components of vectors (k, 3) along unit vectors (k, S, 3), (k, S)."""
    return (
        direction[..., 0] * vector[:, None, 0]
        + direction[..., 1] * vector[:, None, 1]
        + direction[..., 2] * vector[:, None, 2]
    )

