"""The tightly coupled filter on a simulated trajectory: it takes the ranges to satellites."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from spoofgym.arrays import Floats, Runs
from spoofgym.burn_in_cache import kept_by_burn_in
from spoofgym.geodesy import displace, geodetic_to_ecef
from spoofgym.navigation.facts import FilterFacts
from spoofgym.navigation.family import FIDELITIES
from spoofgym.navigation.interface import Demands, Navigator
from spoofgym.navigation.linear_model import LinearModel, error_dynamics, semidefinite_factor
from spoofgym.navigation.loose.strapdown_model import StrapdownModel, strapdown_model
from spoofgym.navigation.spoof import Spoof
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
from spoofgym.navigation.tight.ranges import RangeFamily, along, captured_ranges, disturbed_ranges
from spoofgym.navigation.tight.shared_gains import TightNavigator
from spoofgym.navigation.tight.states import BIAS, OBSERVABLES
from spoofgym.navigation.tight.strapdown import TightStrapdownNavigator
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.parallel import RunSlices
from spoofgym.sensors.geometry import Constellation, SatelliteGeometry, view
from spoofgym.sensors.imu import ImuGrade
from spoofgym.sensors.ranging import RangeErrors
from spoofgym.sensors.receiver import Receiver
from spoofgym.streams import RunStreams
from spoofgym.truth import SimulatedTruth


@dataclass(frozen=True, kw_only=True, eq=False)
class TightFamily(RangeFamily):
    """Tightly coupled filters on a simulated trajectory.

    They are matched: every error of the IMU and of the ranges acts as the filter believes.

    Attributes:
        truth: the true motion.
        grade: of the IMU.
        errors: of the ranges.
        constellation: where the satellites are.
        start_time: the constellation's time at the start of the trajectory, s.
        mask: elevation below which a satellite is not used, rad.
        observable: ``carrier`` or ``rate``, beside the code.
        tuning: the filter's initial uncertainty and process noise; its measurement noise is not read.
        clock_sigma: initial uncertainty of the receiver's clock, m and m/s.
    """

    truth: SimulatedTruth
    grade: ImuGrade
    errors: RangeErrors
    constellation: Constellation
    start_time: float
    mask: float
    tuning: FilterTuning
    observable: str = "carrier"
    clock_sigma: tuple[float, float] = (10.0, 1.0)

    fidelities = FIDELITIES
    matched = True
    random = True

    def __post_init__(self) -> None:
        if self.observable not in OBSERVABLES:
            raise ValueError(f"observable must be one of {', '.join(OBSERVABLES)}, got {self.observable!r}")

    @property
    def slots(self) -> int:
        """S, satellites that are tracked at most."""
        return self.geometry.num_slots

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
            range_model=self.tight_model,
            observable=self.observable,
            matched=self.matched,
        )

    @cached_property
    def geometry(self) -> SatelliteGeometry:
        """The satellites in view at every epoch from the start of the trajectory to the end of the game."""
        truth, interval = self.truth, self.truth.interval
        times = np.asarray(interval * np.arange(1, round(truth.timeline.end / interval) + 1), dtype=np.float64)
        position = truth.trajectory.position[truth.samples(times)]
        return view(self.constellation, position, self.start_time + times, self.mask)

    @cached_property
    def _dynamics(self) -> TightDynamics:
        return self._make_dynamics()

    def _make_dynamics(self) -> TightDynamics:
        """What acts on the error at every epoch of `geometry`."""
        # the instability of the biases acts once per epoch, on states of its own
        steady = replace(self.grade, gyro_instability=0.0, accelerometer_instability=0.0)
        inertial = error_dynamics(
            self.truth.trajectory,
            steady,
            Receiver(rate=self.truth.rate),
            self.tuning,
            self.tuning.position_random_walk,
            len(self.geometry.time),
        )
        dynamics = tight_dynamics(
            inertial, self.grade, self.errors, self.geometry, self.truth.interval, self.observable
        )
        return replace(dynamics, time=self.geometry.time - self.start_time)

    def _first(self, burn_in: int) -> int:
        """Place of epoch -burn_in among those of the trajectory.

        Raises:
            ValueError: the trajectory does not reach back that far.
        """
        first = self.truth.first(burn_in)
        if first < 0:
            raise ValueError(
                f"scenario {self.truth.name!r}: a burn-in of {burn_in} epochs reaches before the trajectory, which has "
                f"{first + burn_in} before the game: take detectors with a shorter memory, or a later onset"
            )
        return first

    def _cold(self) -> Floats:
        """The filter's P at power-on, (n, n)."""
        inertial = self.tuning.initial_scale * self.tuning.initial_sigma(self.grade)
        return cold_covariance(inertial, self.clock_sigma, self.errors, self.slots)

    @kept_by_burn_in
    def tight_model(self, burn_in: int = 0) -> TightModel:
        """The game in the linear fidelity, from epoch -burn_in on, every range used."""
        first = self._first(burn_in)
        dynamics = self._dynamics
        prior = settle(dynamics.part(0, first), self._cold())
        return tight_model(dynamics.part(first, first + self.truth.horizon + burn_in + 1), prior)

    def linear_model(self, burn_in: int = 0) -> LinearModel:
        """A tightly coupled filter has none.

        Raises:
            ValueError: always.
        """
        raise ValueError(
            f"scenario {self.truth.name!r} is tightly coupled: it has a tight_model, not a linear_model"
        )

    def navigator(
        self, fidelity: str, demands: Demands, burn_in: int, num_runs: int, slices: RunSlices
    ) -> Navigator:
        """A navigator whose model starts ``burn_in`` epochs before epoch 0; arguments as in `FilterFamily`."""
        model = self.tight_model(burn_in)
        if fidelity == "linear":
            kind = TightOwnNavigator if demands.excludes else TightNavigator
            return kind(model, num_runs, slices, demands)
        inertial, satellites = self._strapdown(burn_in)
        return TightStrapdownNavigator(inertial, model, satellites, num_runs, slices, demands)

    def _strapdown(self, burn_in: int) -> tuple[StrapdownModel, Floats]:
        """The inertial part of the game from epoch -burn_in on, and where the satellites are, (K+1, S, 3), m."""
        timeline = self.truth.timeline_from(burn_in)
        inertial = strapdown_model(
            self.truth.trajectory,
            self.grade,
            Receiver(rate=self.truth.rate),
            self.tuning,
            self.tuning.position_random_walk,
            self.tight_model(burn_in).prior_covariance,
            timeline,
        )
        first = self._first(burn_in)
        return inertial, self.geometry.position[first : first + timeline.num_epochs + 1]

    @kept_by_burn_in
    def _initial_factors(self, burn_in: int) -> tuple[Floats, Floats]:
        """Square roots of the covariance of the error, (n, n), and of the estimated biases, (6, 6)."""
        prior = self.tight_model(burn_in).prior_covariance
        biases = bias_variance(self.grade, self.truth.timeline.interval, self._first(burn_in))
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

    def disturbed(self, multipath: Floats, burn_in: int, clock: Floats | None = None) -> Floats:
        """What disturbances add to the code at epochs 0..K, (k, K+1, m), so that a fix would err by ``multipath``."""
        dynamics = self.tight_model(burn_in).dynamics
        return disturbed_ranges(dynamics.line_of_sight[burn_in:], multipath, dynamics.present[burn_in:], clock)

    def satellites(self, index: Runs, burn_in: int) -> Runs:
        """Number of the satellite in each slot, (k, S); -1 = none."""
        return self.tight_model(burn_in).dynamics.satellite[index]

    def _distance(self, index: Runs, burn_in: int, offset: Floats) -> Floats:
        """From the satellites to the true position moved by offsets, (k, S), m."""
        position = displace(self.truth.position(burn_in)[index], offset)
        satellites = self.geometry.position[self._first(burn_in) + index] - geodetic_to_ecef(position)[:, None]
        return np.sqrt(satellites[..., 0] ** 2 + satellites[..., 1] ** 2 + satellites[..., 2] ** 2)
