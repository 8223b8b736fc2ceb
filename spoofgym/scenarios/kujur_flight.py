"""The flight of Kujur, Khanafseh and Pervan (2024): straight and level, en route, over Chicago.

Place, speed, height, the rate of 2 Hz, the constellation, the errors of the ranges and the longest window of 180 s
follow the paper. Ours are the heading, the settling time, the elevation mask, the initial uncertainties, and the grades
of the IMU, whose table is missing in the text that we have.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from spoofgym import validation
from spoofgym.navigation.aids import IN_THE_AIR, Aid, make_aids, spell_aids
from spoofgym.navigation.family import COUPLINGS, FilterFamily
from spoofgym.navigation.loose.family import LooseFamily
from spoofgym.navigation.tight.aided.family import with_aids
from spoofgym.navigation.tight.family import TightFamily
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.scenario import ALERT_LIMITS, Scenario
from spoofgym.scenarios.flight_rules import flight_rules
from spoofgym.sensors.constellation import gps_24
from spoofgym.sensors.imu import grade, require_grade
from spoofgym.sensors.range_fix import range_fix_along
from spoofgym.sensors.ranging import KUJUR
from spoofgym.sensors.receiver import ZERO, Receiver
from spoofgym.specification import spell_changed
from spoofgym.trajectory import Straight, Trajectory, fly
from spoofgym.truth import SimulatedTruth
from spoofgym.validation import written

START = (math.radians(41.0 + 50.0 / 60.0 + 10.0 / 3600.0), -math.radians(87.0 + 37.0 / 60.0 + 30.0 / 3600.0), 12192.0)
"""Latitude rad, longitude rad, height m (40,000 ft)."""
SPEED = 454.0 * 1852.0 / 3600.0
"""454 knots, m/s."""
RATE = 2.0
LONGEST = 7200.0
"""Of the flight, s: its samples stay in memory."""
MASK = math.radians(5.0)
TUNING = FilterTuning(position_random_walk=0.0, initial_scale=1.0, position_sigma=(10.0, 10.0, 10.0))
HOUR = 4.0
"""Of the constellation's day: eight satellites are then in view all along the flight."""
DRAG_OFF_RATES = {"loose": 4.0, "tight": 0.25}
"""Largest rate of a spoofed position, m/s per axis, by coupling; ours. A carrier shows at once what a fix hides: a step
of half a metre is always detected, so that a unit of 4 m/s would leave a spoofer nothing to choose."""


@lru_cache(maxsize=4)
def kujur_trajectory(duration: float) -> Trajectory:
    """True motion: north at 454 knots and 40,000 ft, sampled at 100 Hz.

    Args:
        duration: s.
    """
    return fly([Straight(duration)], position=START, speed=SPEED, heading=0.0)


def kujur_flight(
    coupling: str = "tight",
    horizon: int = 120,
    onset: float = 900.0,
    hour: float = HOUR,
    imu: str = "kujur-navigation",
    horizontal_alert_limit: float = ALERT_LIMITS[0],
    vertical_alert_limit: float = ALERT_LIMITS[1],
    drag_off_rate: float | None = None,
    guidance: str | None = None,
    aids: str | None = None,
) -> Scenario:
    """The flight as a game on a filter that has settled for 15 minutes.

    Args:
        coupling: ``tight``: the filter takes code and carrier of every satellite; ``loose``: it takes least-squares
            fixes from the code alone. Its R is diagonal, with the variances that all errors of the ranges together
            give a fix of epoch 0, as if they were white (ours, after Liu 2018, whose R is that sum, too).
        horizon: epochs of the game, half a second each.
        onset: time of the last clean epoch, s.
        hour: of the constellation's day at which the flight starts, from 0 to 24.
        imu: name of the IMU grade.
        horizontal_alert_limit: position error from which the navigation is hazardous, m.
        vertical_alert_limit: m.
        drag_off_rate: largest rate of the spoofed position per axis, and of the spoofed clock, m/s; None = 0.25 where
            the filter takes ranges, 4 where it takes fixes.
        guidance: how the vehicle is steered by its own estimate: ``first-order:T``, or ``second-order:T/damping=D``,
            with ``axes=lateral`` or ``axes=horizontal`` and ``corridor=WIDTH`` after further slashes (s, m); None = it
            keeps its path whatever it estimates.
        aids: what corrects the filter of ranges beside GNSS, at its epochs: ``barometer``, ``magnetometer``, or both
            joined by ``+``, each with ``/`` in place of the commas between its options; None = nothing.

    Raises:
        ValueError: an unknown coupling, IMU or aid, a number out of range, or aids of a filter that takes fixes.
    """
    owner = "kujur-flight"
    validation.one_of(owner, "coupling", coupling, COUPLINGS)
    require_grade(owner, "imu", imu)
    horizon = validation.whole(owner, "horizon", horizon, 1, round(LONGEST * RATE))
    onset = validation.above(owner, "onset", onset, largest=LONGEST)
    if onset + horizon / RATE > LONGEST:
        raise ValueError(
            f"{owner}: onset and horizon must end the game by {written(LONGEST)} s, got onset {written(onset)} s with "
            f"a horizon of {horizon} epochs at {written(RATE)} Hz"
        )
    hour = validation.hour(owner, "hour", hour)
    sensors = make_aids(owner, aids, IN_THE_AIR)
    if sensors and coupling != "tight":
        raise ValueError(f"{owner}: aids do not go together with fixes that are made from ranges: take coupling=tight")
    usual = DRAG_OFF_RATES[coupling]
    rules = flight_rules(owner, drag_off_rate, usual, horizontal_alert_limit, vertical_alert_limit)
    name = spell_changed(
        owner,
        kujur_flight,
        coupling=coupling,
        horizon=horizon,
        onset=onset,
        hour=hour,
        imu=imu,
        horizontal_alert_limit=rules.alert_limits[0],
        vertical_alert_limit=rules.alert_limits[1],
        drag_off_rate=None if rules.fastest == usual else rules.fastest,
        aids=spell_aids(sensors),
    )
    truth = SimulatedTruth(
        name=name,
        trajectory=kujur_trajectory(onset + horizon / RATE),
        rate=RATE,
        onset=onset,
        horizon=horizon,
    )
    return rules.scenario(FAMILIES[coupling](truth, hour, imu, sensors)).guided(guidance, "horizontal")


def _tight(truth: SimulatedTruth, hour: float, imu: str, aids: tuple[Aid, ...]) -> TightFamily:
    """The filter that takes code and carrier of every satellite."""
    family = TightFamily(
        truth=truth,
        grade=grade(imu),
        errors=KUJUR,
        constellation=gps_24(),
        start_time=3600.0 * hour,
        mask=MASK,
        tuning=TUNING,
    )
    return with_aids(family, aids)


def _loose(truth: SimulatedTruth, hour: float, imu: str, aids: tuple[Aid, ...]) -> LooseFamily:
    """The filter that takes least-squares fixes from the code."""
    ranges = range_fix_along(KUJUR, gps_24(), truth.trajectory, RATE, 3600.0 * hour, MASK)
    east, north, up = np.sqrt(np.diag(ranges.covariance(truth.first(0)))).tolist()
    return LooseFamily(
        truth=truth,
        grade=grade(imu),
        receiver=Receiver(rate=RATE, white_sigma=ZERO),
        tuning=replace(TUNING, measurement_sigma=(east, north, up)),
        true_position_random_walk=TUNING.position_random_walk,
        ranges=ranges,
    )


FAMILIES: dict[str, Callable[[SimulatedTruth, float, str, tuple[Aid, ...]], FilterFamily]] = {
    "loose": _loose,
    "tight": _tight,
}
"""What makes the filter, by coupling."""
