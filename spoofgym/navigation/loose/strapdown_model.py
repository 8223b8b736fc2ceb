"""A game in the strapdown fidelity: inertial samples, reference positions of the fixes, and the start."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from spoofgym.arrays import Floats, Runs
from spoofgym.geodesy import displace
from spoofgym.immutable import Immutable
from spoofgym.navigation.linear_model import antenna_arm
from spoofgym.navigation.loose.kernels import FixReference, Samples, StrapdownSteps
from spoofgym.navigation.tuning import FilterTuning, true_noise_density
from spoofgym.sensors.imu import ImuGrade
from spoofgym.sensors.receiver import Receiver
from spoofgym.timeline import Timeline
from spoofgym.trajectory import Trajectory

PART = 1.0
"""Length of the parts in which the covariance is carried over a long epoch, s; one may be half longer or shorter. The
error dynamics are constant over a part, so it must be short beside a turn."""


@dataclass(frozen=True)
class StrapdownModel(Immutable):
    """What N strapdown navigators have in common: epochs k = 0..K, of which 0 is the last clean one.

    The samples come from a true trajectory, with sensor errors added per run, or from a recorded log, whose samples
    have their own.

    Attributes:
        time: of the epochs, (K+1,), s.
        angular_rate: inertial samples, body R, F, U, (n, 3), rad/s.
        specific_force: of these samples, body R, F, U, (n, 3), m/s².
        step: duration of each sample, (n,), s.
        boundaries: samples boundaries[k]..boundaries[k+1] lead to epoch k, (K+2,).
        fix_position: of the antenna when the fix was taken, without receiver noise, (K+1, 3), latitude rad, longitude
            rad, height m.
        fix_velocity: of the antenna at that moment, ENU, (K+1, 3), m/s.
        true_position: against which the error is formed, (K+1, 3).
        true_velocity: against which its error is formed, ENU, (K+1, 3), m/s.
        lever_arm: of the antenna, body R, F, U, (3,), m.
        latency_samples: inertial samples between the fix and its epoch.
        measurement_covariance: the filter's R, (K+1, m, m).
        filter_density: the filter's process noise, (15,), unit²/s.
        true_noise: standard deviation density of the noise that acts on angular rate, specific force and position of
            each run, (9,).
        instability_sigma: of the biases, (6,); `instability_decay`: over an epoch.
        attitude: before epoch 0, body to ENU, (3, 3).
        velocity: before epoch 0, (3,) ENU, m/s.
        position: before epoch 0, (3,).
        prior_covariance: the filter's P before epoch 0, (15, 15).
    """

    time: Floats
    angular_rate: Floats
    specific_force: Floats
    step: Floats
    boundaries: NDArray[np.int64]
    fix_position: Floats
    fix_velocity: Floats
    true_position: Floats
    true_velocity: Floats
    lever_arm: Floats
    latency_samples: int
    measurement_covariance: Floats
    filter_density: Floats
    true_noise: Floats
    instability_sigma: Floats
    instability_decay: float
    attitude: Floats
    velocity: Floats
    position: Floats
    prior_covariance: Floats

    @property
    def dimension(self) -> int:
        """m, of the fix."""
        return self.measurement_covariance.shape[1]

    @property
    def num_epochs(self) -> int:
        """K."""
        return len(self.time) - 1

    def part(self, first: int, stop: int) -> StrapdownModel:
        """Epochs first..stop-1, with all samples and the start of the whole."""
        by_epoch = ("time", "fix_position", "fix_velocity", "true_position", "true_velocity", "measurement_covariance")
        cut = {name: getattr(self, name)[first:stop] for name in by_epoch}
        return replace(self, boundaries=self.boundaries[first : stop + 1], **cut)

    @cached_property
    def steps(self) -> StrapdownSteps:
        """What kernels carry runs with."""
        bounds, places = _parts(self.step, self.boundaries)
        return StrapdownSteps(
            Samples(self.angular_rate, self.specific_force, self.step, self.true_noise),
            bounds,
            places,
            self.latency_samples,
            self.filter_density,
            self.instability_sigma,
            self.instability_decay,
        )

    @cached_property
    def reference(self) -> FixReference:
        """What fixes are compared with."""
        latency = float(self.latency_samples * self.step[0])
        return FixReference(self.fix_position, self.fix_velocity, self.lever_arm, latency)

    @property
    def max_samples(self) -> int:
        """Inertial samples of the longest epoch."""
        return int(np.max(np.diff(self.boundaries)))


def _parts(step: Floats, boundaries: Runs) -> tuple[Runs, Runs]:
    """The samples of each epoch in parts of about `PART`; one where the epoch is not longer than one and a half.

    Args:
        step: of the samples, (n,), s.
        boundaries: samples boundaries[k]..boundaries[k+1] lead to epoch k, (K+2,).

    Returns:
        Bounds: samples bounds[p]..bounds[p+1] are part p, (P+1,); and places among them: parts places[k]..places[k+1]
        lead to epoch k, (K+2,).
    """
    ends = np.concatenate([[0.0], np.cumsum(step)])
    number = np.maximum(np.round(np.diff(ends[boundaries]) / PART), 1.0).astype(np.int64)
    if (number == 1).all():
        return boundaries, np.arange(len(boundaries))
    bounds, places = [boundaries[:1]], [0]
    for first, last, parts in zip(boundaries[:-1], boundaries[1:], number.tolist(), strict=True):
        cuts = np.linspace(ends[first], ends[last], parts + 1)[1:-1]
        # the sample that ends nearest to each cut
        inner = first + np.searchsorted(0.5 * (ends[first:last] + ends[first + 1 : last + 1]), cuts)
        bounds.append(np.unique([*inner[(inner > first) & (inner < last)], last]))
        places.append(places[-1] + len(bounds[-1]))
    return np.concatenate(bounds).astype(np.int64), np.array(places)


def strapdown_model(
    trajectory: Trajectory,
    grade: ImuGrade,
    receiver: Receiver,
    tuning: FilterTuning,
    true_position_random_walk: float,
    prior_covariance: Floats,
    timeline: Timeline,
) -> StrapdownModel:
    """The game on the part of ``trajectory`` from one interval before ``timeline.start`` to its end.

    Args:
        trajectory: the truth, sampled at the IMU rate.
        grade: of the IMU.
        receiver: gives epochs, lever arm and latency.
        tuning: gives the filter's noise.
        true_position_random_walk: what really acts on the position, m/√s.
        prior_covariance: the filter's P after epoch -1, (15, 15).
        timeline: of the game.
    """
    samples = receiver.samples_per_fix(trajectory.rate)
    first = round((timeline.start - timeline.interval) * trajectory.rate)
    boundaries = samples * np.arange(timeline.num_epochs + 2)
    ends = first + boundaries[1:]
    used = slice(first, int(ends[-1]))
    taken = ends - round(receiver.latency * trajectory.rate)
    arm = antenna_arm(trajectory.attitude[taken], receiver)
    return StrapdownModel(
        time=timeline.times,
        angular_rate=trajectory.angular_rate[used],
        specific_force=trajectory.specific_force[used],
        step=np.full(used.stop - first, 1.0 / trajectory.rate),
        boundaries=boundaries,
        fix_position=displace(trajectory.position[taken], arm),
        fix_velocity=trajectory.velocity[taken],
        true_position=trajectory.position[ends],
        true_velocity=trajectory.velocity[ends],
        lever_arm=np.array(receiver.lever_arm, dtype=float),
        latency_samples=round(receiver.latency * trajectory.rate),
        # not broadcast: a copy of such an array has another layout, for which the kernels would be compiled again
        measurement_covariance=np.tile(tuning.measurement_covariance, (len(ends), 1, 1)),
        filter_density=tuning.noise_density(grade),
        true_noise=np.sqrt(true_noise_density(grade, true_position_random_walk)),
        instability_sigma=grade.instability_sigma,
        instability_decay=float(np.exp(-receiver.interval / grade.correlation_time)),
        attitude=trajectory.attitude[first],
        velocity=trajectory.velocity[first],
        position=trajectory.position[first],
        prior_covariance=prior_covariance,
    )
