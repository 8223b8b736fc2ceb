"""The tightly coupled filter along a true trajectory, one step per epoch: Φ, Q, H, R, and its gains.

As for the loosely coupled filter (`linear_model`), neither Φ nor the gains depend on what a spoofer does, so they are
computed once along the truth. Satellites set and rise on the way: their slots forget.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spoofgym.arrays import Floats, Runs
from spoofgym.immutable import Immutable
from spoofgym.navigation.error_model import NUM_NAVIGATION
from spoofgym.navigation.linear_model import ErrorDynamics, semidefinite_factor
from spoofgym.navigation.tight.kalman import FilterSteps, Ranges
from spoofgym.navigation.tight.recursion import covariance_recursion, empty_kept
from spoofgym.navigation.tight.states import (
    BIAS,
    CLOCK,
    DRIFT,
    INERTIAL,
    NUM_INERTIAL,
    PER_SATELLITE,
    TROPOSPHERE,
    num_states,
    observation_columns,
    observation_values,
    slot_states,
)
from spoofgym.navigation.tight.truth import ErrorSteps
from spoofgym.sensors.geometry import SatelliteGeometry
from spoofgym.sensors.imu import ImuGrade
from spoofgym.sensors.ranging import RangeErrors, clock_noise


@dataclass(frozen=True)
class TightDynamics(Immutable):
    """What acts on the error state, epoch by epoch, and what observes it; leading axis: epochs.

    Attributes:
        time: of the epochs, (E,), s.
        interval: usual time between them, s, over which all but the clock's offset are carried.
        intervals: time from the epoch before, (E,), s.
        clock_jump: variance that a step of the receiver's clock, of a size not known, adds to its offset, (E,), m².
        satellite: number of the satellite in each slot, -1 = empty, (E, S).
        line_of_sight: unit vectors to the satellites, (E, S, 3), ENU.
        transition: first nine rows of Φ from the epoch before, (E, 9, 15).
        process_noise: Q of the nine navigation states, (E, 9, 9).
        decay: diagonal of Φ, (n,); the first nine are not read.
        variance: diagonal of Q from the tenth state on, (n,), without the clock's.
        clock_noise: Q of the clock, (2, 2), m and m/s.
        started: whether a slot holds another satellite than at the epoch before, (E, S).
        satellite_sigma: prior of the states of a new satellite, (5,), m.
        columns: places of the entries of H, (m, 9).
        values: the entries, (E, m, 9).
        noise_variance: diagonal of R, (E, m).
    """

    time: Floats
    interval: float
    intervals: Floats
    clock_jump: Floats
    satellite: NDArray[np.int64]
    line_of_sight: Floats
    transition: Floats
    process_noise: Floats
    decay: Floats
    variance: Floats
    clock_noise: Floats
    started: NDArray[np.bool_]
    satellite_sigma: Floats
    columns: NDArray[np.int64]
    values: Floats
    noise_variance: Floats

    @property
    def num_states(self) -> int:
        """n, of the error state."""
        return len(self.decay)

    @property
    def dimension(self) -> int:
        """m, of the measurements of all slots."""
        return len(self.columns)

    @property
    def num_slots(self) -> int:
        """S."""
        return self.satellite.shape[1]

    @property
    def num_epochs(self) -> int:
        """Epochs after the first one."""
        return len(self.time) - 1

    @property
    def present(self) -> NDArray[np.bool_]:
        """Whether a slot holds a satellite, (E, S)."""
        return self.satellite >= 0

    @cached_property
    def transition_columns(self) -> Floats:
        """The nine rows of each Φ, stored by columns, (E, 15, 9)."""
        return np.ascontiguousarray(self.transition.transpose(0, 2, 1))

    @cached_property
    def noise_columns(self) -> Floats:
        """A square root of each Q of the navigation states, stored by columns, (E, 9, 9)."""
        return np.ascontiguousarray([semidefinite_factor(q).T for q in self.process_noise])

    @cached_property
    def clock_factor(self) -> Floats:
        """A square root of the clock's Q, (2, 2)."""
        return semidefinite_factor(self.clock_noise)

    @cached_property
    def noise_sigma(self) -> Floats:
        """Square root of `variance`, (n,)."""
        return np.sqrt(self.variance)

    @cached_property
    def filter_steps(self) -> FilterSteps:
        """What kernels carry the filter's P with."""
        return FilterSteps(
            transition=self.transition,
            process_noise=self.process_noise,
            decay=self.decay,
            variance=self.variance,
            clock_noise=self.clock_noise,
            intervals=self.intervals,
            clock_jump=self.clock_jump,
            started=np.ascontiguousarray(self.started),
            satellite_sigma=self.satellite_sigma,
        )

    @cached_property
    def error_steps(self) -> ErrorSteps:
        """What kernels carry the true error with."""
        return ErrorSteps(
            transition_columns=self.transition_columns,
            noise_columns=self.noise_columns,
            decay=self.decay,
            noise_sigma=self.noise_sigma,
            clock_factor=self.clock_factor,
            intervals=self.intervals,
            started=np.ascontiguousarray(self.started),
            satellite_sigma=self.satellite_sigma,
        )

    @cached_property
    def ranges(self) -> Ranges:
        """H and R for kernels."""
        return Ranges(columns=self.columns, values=self.values, variance=self.noise_variance)

    def part(self, first: int, last: int) -> TightDynamics:
        """Epochs first..last-1 of these."""
        whole = {"interval", "decay", "variance", "clock_noise", "satellite_sigma", "columns"}
        by_epoch = [item.name for item in fields(TightDynamics) if item.name not in whole]
        return replace(self, **{name: getattr(self, name)[first:last] for name in by_epoch})


class TightGains(NamedTuple):
    """The arrays of a `TightModel` that kernels form innovations with where gains are shared.

    Attributes:
        columns: places of the entries of H, (m, 9).
        values: the entries, (K+1, m, 9).
        innovation_factor: lower L with S = L L', (K+1, m, m).
        whitened_gain: U' = L⁻¹ H P, (K+1, m, n).
    """

    columns: Runs
    values: Floats
    innovation_factor: Floats
    whitened_gain: Floats


@dataclass(frozen=True)
class TightModel(Immutable):
    """A game of the tightly coupled filter: epochs k = 0..K, of which 0 is the last clean one; every range used.

    Attributes:
        dynamics: of these epochs.
        prior_covariance: the filter's P after epoch -1, (n, n).
        covariance: the filter's P at epoch k before the ranges, (K+1, n, n).
        innovation_covariance: S, (K+1, m, m).
        innovation_factor: lower L with S = L L', (K+1, m, m).
        whitened_gain: U' = L⁻¹ H P, (K+1, m, n).
        position_response: L⁻¹ H on the states of the position, (K+1, m, 3), 1/m.
    """

    dynamics: TightDynamics
    prior_covariance: Floats
    covariance: Floats
    innovation_covariance: Floats
    innovation_factor: Floats
    whitened_gain: Floats
    position_response: Floats

    @property
    def time(self) -> Floats:
        """Of the epochs, (K+1,), s."""
        return self.dynamics.time

    @property
    def dimension(self) -> int:
        """m."""
        return self.dynamics.dimension

    @property
    def num_epochs(self) -> int:
        """K."""
        return self.dynamics.num_epochs

    @cached_property
    def gains(self) -> TightGains:
        """What kernels form innovations with where gains are shared."""
        return TightGains(
            self.dynamics.columns, self.dynamics.values, self.innovation_factor, self.whitened_gain
        )

    @cached_property
    def separation_transition(self) -> Floats:
        """Φ of the fifteen states that inertial coasting needs, (K+1, 15, 15)."""
        dynamics = self.dynamics
        whole = np.zeros((len(self.time), NUM_INERTIAL, NUM_INERTIAL))
        whole[:, :NUM_NAVIGATION] = dynamics.transition
        biases = range(BIAS.start, BIAS.stop)
        whole[:, biases, biases] = dynamics.decay[BIAS]
        return whole

    @cached_property
    def separation_noise(self) -> Floats:
        """Q of the fifteen states that inertial coasting needs, (K+1, 15, 15)."""
        dynamics = self.dynamics
        whole = np.zeros((len(self.time), NUM_INERTIAL, NUM_INERTIAL))
        whole[:, :NUM_NAVIGATION, :NUM_NAVIGATION] = dynamics.process_noise
        biases = range(BIAS.start, BIAS.stop)
        whole[:, biases, biases] = dynamics.variance[BIAS]
        return whole


def tight_dynamics(
    inertial: ErrorDynamics,
    grade: ImuGrade,
    errors: RangeErrors,
    geometry: SatelliteGeometry,
    interval: float,
    observable: str,
) -> TightDynamics:
    """The model of truth and filter alike on consecutive epochs.

    A bias whose data sheet gives an instability alone is first-order Gauss-Markov; one that also has a constant part is
    a random walk of the instability's driving noise, as in the loosely coupled filter.

    Args:
        inertial: Φ and Q of the navigation states, without the instability of the biases, over the epochs.
        grade: of the IMU.
        errors: of the ranges.
        geometry: of the epochs.
        interval: between them, s.
        observable: ``carrier`` or ``rate``, beside the code.
    """
    slots = geometry.num_slots
    states = slot_states(slots)
    decay, variance = np.ones(num_states(slots)), np.zeros(num_states(slots))
    decay[BIAS], variance[BIAS] = _bias_process(grade, interval)
    sigma, time = _satellite_processes(errors, observable)
    for a in range(PER_SATELLITE):
        decay[states[:, a]] = np.exp(-interval / time[a])
        variance[states[:, a]] = sigma[a] ** 2 * -np.expm1(-2.0 * interval / time[a])
    decay[TROPOSPHERE] = np.exp(-interval / errors.troposphere_time)
    variance[TROPOSPHERE] = errors.troposphere_sigma**2 * -np.expm1(-2.0 * interval / errors.troposphere_time)
    second = errors.carrier_noise if observable == "carrier" else errors.rate_noise
    noise = np.repeat([errors.code_noise**2, second**2], slots)
    return TightDynamics(
        time=geometry.time,
        interval=interval,
        intervals=np.full(len(geometry.time), interval),
        clock_jump=np.zeros(len(geometry.time)),
        satellite=geometry.satellite,
        line_of_sight=geometry.line_of_sight,
        transition=np.ascontiguousarray(inertial.transition[:, :NUM_NAVIGATION]),
        process_noise=np.ascontiguousarray(inertial.process_noise[:, :NUM_NAVIGATION, :NUM_NAVIGATION]),
        decay=decay,
        variance=variance,
        clock_noise=clock_noise(errors.clock_h0, errors.clock_h2, interval),
        started=geometry.started,
        satellite_sigma=sigma,
        columns=observation_columns(slots, observable),
        values=observation_values(geometry, observable),
        noise_variance=np.where(np.tile(geometry.present, 2), noise, 1.0),
    )


def _bias_process(grade: ImuGrade, interval: float) -> tuple[float, Floats]:
    """Decay and driving variance of the six biases over an epoch."""
    decay = np.exp(-interval / grade.correlation_time) if not np.any(grade.bias_sigma) else 1.0
    instability = grade.instability_sigma**2
    if decay == 1.0:
        return 1.0, 2.0 * instability * interval / grade.correlation_time
    return float(decay), instability * (1.0 - decay**2)


def bias_variance(grade: ImuGrade, interval: float, epochs: int) -> Floats:
    """Variance of the true biases so many epochs after power-on, (6,), (rad/s)² and (m/s²)²."""
    decay, variance = _bias_process(grade, interval)
    beginning = grade.bias_sigma**2 + grade.instability_sigma**2
    return beginning if decay < 1.0 else beginning + epochs * variance


def _satellite_processes(errors: RangeErrors, observable: str) -> tuple[Floats, Floats]:
    """Stationary sigma, m, and correlation time, s, of the five states of a satellite; the ambiguity is constant."""
    carrier = 1.0 if observable == "carrier" else 0.0
    sigma = [
        carrier * errors.ambiguity_sigma,
        errors.code_multipath_sigma,
        carrier * errors.carrier_multipath_sigma,
        errors.ionosphere_sigma,
        errors.ephemeris_sigma,
    ]
    time = [
        np.inf,
        errors.code_multipath_time,
        errors.carrier_multipath_time,
        errors.ionosphere_time,
        errors.ephemeris_time,
    ]
    return np.array(sigma), np.array(time)


def cold_covariance(
    inertial_sigma: Floats, clock_sigma: tuple[float, float], errors: RangeErrors, slots: int
) -> Floats:
    """The filter's P at power-on, (n, n); a slot gets its prior from the satellite that starts there.

    Args:
        inertial_sigma: of the fifteen states, (15,).
        clock_sigma: of offset and rate, m and m/s.
        errors: of the ranges.
        slots: S.
    """
    sigma = np.zeros(num_states(slots))
    sigma[INERTIAL] = inertial_sigma
    sigma[CLOCK], sigma[DRIFT] = clock_sigma
    sigma[TROPOSPHERE] = errors.troposphere_sigma
    return np.diag(sigma**2)


def settle(dynamics: TightDynamics, covariance: Floats) -> Floats:
    """The filter's P after all epochs of ``dynamics``, every range used, (n, n)."""
    settled, nothing = covariance.copy(), empty_kept(0, dynamics.dimension, dynamics.num_states)
    covariance_recursion(dynamics.filter_steps, dynamics.ranges, settled, nothing)
    return settled


def tight_model(dynamics: TightDynamics, prior_covariance: Floats) -> TightModel:
    """The game on the epochs of ``dynamics``, every range used.

    Args:
        dynamics: of the K+1 epochs.
        prior_covariance: the filter's P after epoch -1, (n, n).
    """
    kept = empty_kept(len(dynamics.time), dynamics.dimension, dynamics.num_states)
    covariance_recursion(dynamics.filter_steps, dynamics.ranges, prior_covariance.copy(), kept)
    return TightModel(dynamics, prior_covariance, **kept._asdict())
