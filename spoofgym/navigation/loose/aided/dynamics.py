"""Errors along a true trajectory in steps that end wherever an aid measures, and what the aids observe there."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.navigation.aids.aid import Aid, Place
from spoofgym.navigation.aids.aid_set import AidSet, Readings, in_turn
from spoofgym.navigation.error_model import NUM_INERTIAL
from spoofgym.navigation.linear_model import ErrorDynamics, error_dynamics
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.sensors.imu import ImuGrade
from spoofgym.sensors.receiver import Receiver
from spoofgym.trajectory import Trajectory

STEADY = 1e-9
"""Relative difference up to which rates are multiples of each other."""


def steps_per_epoch(owner: str, aids: tuple[Aid, ...], receiver: Receiver, imu_rate: float) -> int:
    """Steps of equal length into which an epoch is cut, so that every reading stands at the end of one.

    Raises:
        ValueError: the fastest of receiver and aids is no multiple of the others, or does not divide the IMU's rate.
    """
    fastest = max(receiver.rate, *(aid.rate for aid in aids))
    for what, rate in (("the receiver", receiver.rate), *((aid.kind, aid.rate) for aid in aids)):
        if not _whole(fastest / rate):
            raise ValueError(
                f"{owner}: aids: the fastest rate, {fastest:g} Hz, must be a whole multiple of every other, got "
                f"{rate:g} Hz of {what}"
            )
    if not _whole(imu_rate / fastest):
        raise ValueError(f"{owner}: aids: {fastest:g} Hz must divide the IMU's {imu_rate:g} Hz into whole samples")
    return round(fastest / receiver.rate)


def _whole(ratio: float) -> bool:
    return abs(ratio - round(ratio)) <= STEADY * ratio and round(ratio) >= 1


def readings_along(aids: tuple[Aid, ...], trajectory: Trajectory, step_rate: float, steps: int) -> list[Readings]:
    """What each aid reads without error, at every step after whose end it measures: multiples of its own interval.

    Args:
        aids: of the filter.
        trajectory: the truth.
        step_rate: steps per second.
        steps: S, from the start of the trajectory on.
    """
    samples, found = round(trajectory.rate / step_rate), []
    for aid in aids:
        every = round(step_rate / aid.rate)
        moment = np.arange(every - 1, steps, every)
        place = place_at(trajectory, samples * (moment + 1))
        there = aid.measures(place)
        found.append(Readings(moment[there], aid.read(at(place, there))))
    return found


def place_at(trajectory: Trajectory, samples: Runs) -> Place:
    """The truth at samples of a trajectory."""
    return Place(trajectory.attitude[samples], trajectory.velocity[samples], trajectory.position[samples])


def at(place: Place, chosen: Flags | Runs) -> Place:
    """Some of the places."""
    return Place(place.attitude[chosen], place.velocity[chosen], place.position[chosen])


@dataclass(frozen=True, eq=False)
class AidedDynamics:
    """What acts on an error, step by step; U steps make an epoch. Leading axis: steps S, or measurements of aids B.

    Attributes:
        steps: Φ (S, 15, 15), the filter's Q (S, 15, 15) and the true noise (S, 9, 9) of each.
        per_epoch: U.
        observation: H of the fix at every epoch's end, (S / U, m, 9).
        walk: standard deviation of what the states of the aids walk in a step, (a,).
        step: after which each measurement comes, (B,).
        aid: which aid it is of, (B,).
        aid_observation: its H, (B, R, n), zero beyond its rows.
    """

    steps: ErrorDynamics
    per_epoch: int
    observation: Floats
    walk: Floats
    step: Runs
    aid: Runs
    aid_observation: Floats

    def epochs(self, first: int, last: int) -> AidedDynamics:
        """What acts in epochs first..last-1, counted from 0 at the first fix of the trajectory."""
        begin, end = first * self.per_epoch, last * self.per_epoch
        inside = slice(*np.searchsorted(self.step, [begin, end]).tolist())
        steps = self.steps
        return AidedDynamics(
            ErrorDynamics(
                steps.transition[begin:end],
                steps.process_noise[begin:end],
                steps.true_noise[begin:end],
                steps.observation[begin:end],
            ),
            self.per_epoch,
            self.observation[first:last],
            self.walk,
            self.step[inside] - begin,
            self.aid[inside],
            self.aid_observation[inside],
        )

    @property
    def num_epochs(self) -> int:
        """Of the fixes."""
        return len(self.observation)

    @property
    def num_states(self) -> int:
        """n, with those of the aids."""
        return NUM_INERTIAL + len(self.walk)

    @property
    def first_measurement(self) -> Runs:
        """Measurements first[s]..first[s+1]-1 come after step s, (S + 1,)."""
        return np.searchsorted(self.step, np.arange(len(self.steps.transition) + 1)).astype(np.int64)

    def filter_noise(self, step: int) -> Floats:
        """The filter's Q of a step, (n, n)."""
        noise = np.zeros((self.num_states, self.num_states))
        noise[:NUM_INERTIAL, :NUM_INERTIAL] = self.steps.process_noise[step]
        noise[range(NUM_INERTIAL, self.num_states), range(NUM_INERTIAL, self.num_states)] = self.walk**2
        return noise


def aided_dynamics(
    owner: str,
    aids: AidSet,
    trajectory: Trajectory,
    grade: ImuGrade,
    receiver: Receiver,
    tuning: FilterTuning,
    true_position_random_walk: float,
    num_epochs: int,
) -> AidedDynamics:
    """The dynamics from the start of the trajectory over ``num_epochs`` fixes.

    Args:
        owner: of the aids, for messages.
        aids: of the filter.
        trajectory: the truth, sampled at the IMU rate.
        grade: of the IMU.
        receiver: of the fixes, without latency.
        tuning: gives the filter's process noise.
        true_position_random_walk: what really acts on the position, m/√s.
        num_epochs: E.

    Raises:
        ValueError: rates that do not fit each other.
    """
    cut = steps_per_epoch(owner, aids.aids, receiver, trajectory.rate)
    faster = replace(receiver, rate=cut * receiver.rate)
    steps = error_dynamics(trajectory, grade, faster, tuning, true_position_random_walk, cut * num_epochs)
    readings = readings_along(aids.aids, trajectory, faster.rate, cut * num_epochs)
    aid, places = in_turn(readings)
    step = np.empty(len(aid), dtype=np.int64)
    observation = np.zeros((len(aid), aids.most_rows, NUM_INERTIAL + aids.num_states))
    samples = round(trajectory.rate / faster.rate)
    for j, (each, of_aid) in enumerate(zip(readings, places, strict=True)):
        place = place_at(trajectory, samples * (each.moment + 1))
        step[of_aid] = each.moment
        rows = aids.whole_rows(j, aids.aids[j].observe(place, each.value))
        observation[of_aid, : rows.shape[1]] = rows
    return AidedDynamics(
        steps=steps,
        per_epoch=cut,
        observation=steps.observation[cut - 1 :: cut],
        walk=aids.walk * math.sqrt(1.0 / faster.rate),
        step=step,
        aid=aid,
        aid_observation=observation,
    )
