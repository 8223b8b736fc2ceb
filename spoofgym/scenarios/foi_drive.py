"""The drive of FOI-R-5687: 250 s at 20 m/s with two turns, a fibre-optic IMU and a receiver that doubts itself.

The report simulates a KVH 1775 and records a receiver in the loop of a GNSS simulator. Speed, duration and the times of
the turns follow it. It gives neither the rates of the sensors nor the filter's initial uncertainty and process noise.
Ours are the rates (50 and 1 Hz), the place, the angles of the turns (-60 degrees each, which fit its attack errors
best), the shapes of the manoeuvres, and a start that is levelled to 20 arcseconds with a heading known to 180: the
report's tests let the INS run free from a well aligned start. The lag of the receiver's own filter, an eighth of a
second, is left out.
"""

from __future__ import annotations

import math
from functools import lru_cache

from spoofgym import validation
from spoofgym.navigation.aids import ON_THE_ROAD, make_aids, spell_aids
from spoofgym.navigation.loose.aided.family import with_aids
from spoofgym.navigation.loose.family import LooseFamily
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.scenario import Scenario
from spoofgym.scenarios.limits import MOST_EPOCHS, NOISE_FACTORS
from spoofgym.sensors.imu import grade, require_grade
from spoofgym.sensors.receiver import Receiver
from spoofgym.specification import spell_changed
from spoofgym.trajectory import Accelerate, Straight, Trajectory, Turn, fly
from spoofgym.truth import SimulatedTruth

FOI_START = (math.radians(58.41), math.radians(15.62), 60.0)
"""Near Linköping: latitude rad, longitude rad, height m."""

CREEP = 0.01
"""Speed of the vehicle while it stands still in the report, m/s: a heading needs a velocity."""

FOI_MANOEUVRES = (
    Straight(10.0),
    Accelerate(20.0 - CREEP, 10.0),
    Straight(90.0),
    Turn(math.radians(-60.0), 10.0),
    Straight(45.0),
    Turn(math.radians(-60.0), 10.0),
    Straight(75.0),
)
"""Still to 10 s, 20 m/s from 20 s on, turns begin at 110 and 165 s, end at 250 s."""

STANDSTILL = 0.01
"""Initial uncertainty of the velocity, m/s: the filter begins on a vehicle that stands still."""

RECEIVERS = ("white", "foi")

DEPTHS = (0, 3, 5, 8, 12, 16, 20, 25, 30, 40, 50)
"""Depth table: with the five depths of other scenarios a defender that estimates the onset loses 7 % by rounding."""


@lru_cache(maxsize=1)
def foi_trajectory() -> Trajectory:
    """True motion of the drive, 12,500 IMU steps at 50 Hz, of which the first 500 creep."""
    return fly(FOI_MANOEUVRES, position=FOI_START, speed=CREEP, heading=math.radians(90.0), rate=50.0)


def foi_drive(
    horizon: int = 230,
    onset: float = 20.0,
    imu: str = "fog",
    receiver: str = "white",
    process_noise: float = 1.0,
    bias_states: bool = True,
    guidance: str | None = None,
    aids: str | None = None,
) -> Scenario:
    """The drive as a game from 20 s to 250 s.

    With the receiver ``white`` its error is white, 1 m per axis, and the filter's R is just that: the filter is
    matched, and detectors have the false-alarm rates that theory gives. With ``foi`` the error is small and slow
    (Gauss-Markov, 0.6 m and 60 s, and 0.1 m white) while R is (3 m)², as the report's receiver over-states its
    covariance: tests of the innovation are then nearly deaf at thresholds of theory, and the report sets them by
    experience.

    Args:
        horizon: epochs of the game.
        onset: time of the last clean fix, s.
        imu: name of the IMU grade.
        receiver: ``white`` or ``foi``.
        process_noise: factor on the variance of the filter's inertial process noise. The report does not give it, and
            it decides whether GNSS is ever used again after an attack.
        bias_states: whether the filter estimates the IMU's biases; the report's has nine states.
        guidance: how the vehicle is steered by its own estimate: ``first-order:T``, or ``second-order:T/damping=D``,
            with ``axes=lateral`` or ``axes=horizontal`` and ``corridor=WIDTH`` after further slashes (s, m); None = it
            keeps its path whatever it estimates.
        aids: what corrects the filter beside GNSS: ``barometer``, ``magnetometer``, ``wheel-speed`` and
            ``zero-velocity``, those that there are joined by ``+``, each with ``/`` in place of the commas between its
            options; None = nothing.

    Raises:
        ValueError: an unknown IMU or receiver, a factor that is not positive, or a game outside the drive.
    """
    owner = "foi-drive"
    horizon = validation.whole(owner, "horizon", horizon, 1, MOST_EPOCHS)
    onset = validation.above(owner, "onset", onset)
    require_grade(owner, "imu", imu)
    validation.one_of(owner, "receiver", receiver, RECEIVERS)
    process_noise = validation.between(owner, "process_noise", process_noise, *NOISE_FACTORS)
    bias_states = validation.boolean(owner, "bias_states", bias_states)
    sensors = make_aids(owner, aids, ON_THE_ROAD)
    white = receiver == "white"
    sigma = (1.0, 1.0, 1.0) if white else (3.0, 3.0, 3.0)
    name = spell_changed(
        owner,
        foi_drive,
        horizon=horizon,
        onset=onset,
        imu=imu,
        receiver=receiver,
        process_noise=process_noise,
        bias_states=bias_states,
        aids=spell_aids(sensors),
    )
    fixes = Receiver(
        white_sigma=(1.0, 1.0, 1.0) if white else (0.1, 0.1, 0.1),
        markov_sigma=(0.0, 0.0, 0.0) if white else (0.6, 0.6, 0.6),
        markov_time=0.0 if white else 60.0,
    )
    tuning = FilterTuning(
        velocity_sigma=(STANDSTILL, STANDSTILL, STANDSTILL),
        position_sigma=sigma,
        initial_scale=1.0,
        position_random_walk=0.0,
        process_noise_scale=process_noise,
        measurement_sigma=sigma,
        bias_states=bias_states,
    )
    truth = SimulatedTruth(
        name=name, trajectory=foi_trajectory(), rate=fixes.rate, onset=onset, horizon=horizon
    )
    family = LooseFamily(
        truth=truth, grade=grade(imu), receiver=fixes, tuning=tuning, true_position_random_walk=0.0
    )
    return Scenario(
        family=with_aids(family, sensors),
        drag_off_rate=(4.0, 4.0, 4.0),
        error_scale=10.0,
        defender_scale=10.0,
        depth_table=DEPTHS,
    ).guided(guidance, "lateral")
