"""A scenario of one's own: a simulated trajectory, an IMU, a receiver, and a filter that fits them."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.navigation.aids import make_aids
from spoofgym.navigation.loose.aided.family import with_aids
from spoofgym.navigation.loose.family import LooseFamily
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.scenario import Scenario
from spoofgym.scenarios.limits import MOST_EPOCHS
from spoofgym.sensors.imu import ImuGrade, grade, require_grade
from spoofgym.sensors.receiver import Receiver
from spoofgym.trajectory import Trajectory
from spoofgym.truth import SimulatedTruth


def simulated(
    name: str,
    trajectory: Trajectory,
    *,
    onset: float,
    horizon: int,
    imu: str | ImuGrade = "tactical",
    receiver: Receiver | None = None,
    tuning: FilterTuning | None = None,
    drag_off_rate: float = 4.0,
    error_scale: float = 10.0,
    aids: str | None = None,
) -> Scenario:
    """A scenario with a loosely coupled filter on a trajectory of one's own.

    `Scenario.changed` sets the other rules of the game: ``simulated(...).changed(depth_table=(0, 5, 10))``.

    Args:
        name: of the scenario. If programs are to find it, the name under which it is registered.
        trajectory: the true motion, from `spoofgym.trajectory.fly` or `fly_through`.
        onset: time of the last clean epoch, s. The filter runs from the start of the trajectory on. Detectors need as
            many clean epochs before the onset as they look back.
        horizon: epochs of the game.
        imu: name of a grade in `spoofgym.sensors.imu.GRADES`, or an `ImuGrade`.
        receiver: of the fixes; None = `Receiver()`, 1 Hz with 3.7 m and 6 m.
        tuning: what the filter believes; None = `matched_tuning` of the receiver.
        drag_off_rate: the largest rate at which a spoofer moves the position along each axis, m/s.
        error_scale: metres of navigation error that make a spoofer's reward of 1.
        aids: what corrects the filter beside GNSS, e.g. ``barometer+wheel-speed:rate=10``; None = nothing.

    Raises:
        ValueError: naming what does not fit: an unknown grade, a receiver whose rate does not divide that of the
            trajectory, or a game outside the trajectory.
        TypeError: a trajectory or a receiver that is none.
    """
    owner = f"scenario {validation.text('scenario', 'name', name)!r}"
    validation.instance(owner, "trajectory", trajectory, Trajectory, "a Trajectory, as fly() returns")
    horizon = validation.whole(owner, "horizon", horizon, 1, MOST_EPOCHS)
    onset = validation.above(owner, "onset", onset)
    if not isinstance(imu, ImuGrade):
        require_grade(owner, "imu", imu)
        imu = grade(imu)
    fixes = Receiver() if receiver is None else receiver
    validation.instance(owner, "receiver", fixes, Receiver, "a Receiver")
    believed = matched_tuning(fixes) if tuning is None else tuning
    rate = validation.above(owner, "drag_off_rate", drag_off_rate)
    sensors = make_aids(owner, aids)
    family = LooseFamily(
        truth=SimulatedTruth(name=name, trajectory=trajectory, rate=fixes.rate, onset=onset, horizon=horizon),
        grade=imu,
        receiver=fixes,
        tuning=believed,
        true_position_random_walk=believed.position_random_walk,
    )
    return Scenario(family=with_aids(family, sensors), drag_off_rate=(rate, rate, rate), error_scale=error_scale)


def matched_tuning(receiver: Receiver) -> FilterTuning:
    """The tuning of a filter that knows its receiver: R is the variance of a fix, slow noise included.

    Raises:
        ValueError: a receiver without any noise.
    """
    position = np.hypot(receiver.white_sigma, receiver.markov_sigma).tolist()
    return FilterTuning(
        position_sigma=tuple(position),
        measurement_sigma=(*position, *(receiver.velocity_sigma or ())),
        initial_scale=1.0,
    )
