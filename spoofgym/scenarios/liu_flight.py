"""The flight of Liu et al. (2018): 1100 s near Xi'an, 100 Hz.

The paper prints no trajectory but its end state (appendix C), which the flight ends in. Speed, height, turns and the
shapes of the manoeuvres are ours.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

from spoofgym import validation
from spoofgym.navigation.aids import IN_THE_AIR, Aid, make_aids, spell_aids
from spoofgym.navigation.family import COUPLINGS, FilterFamily
from spoofgym.navigation.loose.aided.family import with_aids
from spoofgym.navigation.loose.family import LooseFamily
from spoofgym.navigation.tight.aided.family import with_aids as with_aids_on_ranges
from spoofgym.navigation.tight.family import TightFamily
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.scenario import ALERT_LIMITS, Scenario
from spoofgym.scenarios.flight_rules import flight_rules
from spoofgym.scenarios.limits import MOST_EPOCHS, SIGMAS
from spoofgym.sensors.constellation import gps_24
from spoofgym.sensors.imu import grade, require_grade
from spoofgym.sensors.range_fix import MASK, range_fix_along
from spoofgym.sensors.ranging import LIU
from spoofgym.sensors.receiver import RATES, ZERO, Receiver
from spoofgym.specification import spell_changed
from spoofgym.trajectory import Accelerate, Climb, Straight, Trajectory, Turn, fly
from spoofgym.truth import SimulatedTruth
from spoofgym.validation import written

LIU_END = (math.radians(34.6887), math.radians(108.1915), 2283.0)
"""End of the flight: latitude rad, longitude rad, height m."""

LIU_START = (math.radians(33.8234015845), math.radians(107.8269216824), 783.0)
"""The start from which the manoeuvres lead to the end, within a millimetre."""

LIU_MANOEUVRES = (
    Straight(20.0),
    Accelerate(50.0, 60.0),
    Climb(700.0, 70.0),
    Turn(math.radians(-90.0), 90.0),
    Climb(800.0, 90.0),
    Turn(math.radians(90.0), 90.0),
    Straight(60.0),
    Turn(math.radians(-180.0), 180.0),
    Straight(20.0),
    Turn(math.radians(90.0), 90.0),
    Straight(330.0),
)
"""Turns begin at 150, 330, 480 and 680 s; from 770 s straight and level, north at 150 m/s."""

DRAG_OFF_RATES = {"loose": 4.0, "tight": 0.25}
"""Largest rate of a spoofed position, m/s per axis, by coupling; ours. A range rate, good to 5 cm/s, shows at once what
a fix hides."""
NOISES = ("white", "ranges")


def liu_trajectory() -> Trajectory:
    """True motion of the Liu flight: 100 to 150 m/s, 783 to 2283 m, turns of -90, +90, -180 and +90 degrees.

    Returns:
        110,000 IMU steps at 100 Hz.
    """
    return fly(LIU_MANOEUVRES, position=LIU_START, speed=100.0, heading=math.radians(90.0))


@lru_cache(maxsize=1)
def _trajectory() -> Trajectory:
    return liu_trajectory()


def liu_flight(
    horizon: int = 120,
    onset: float = 800.0,
    rate: float = 1.0,
    imu: str = "navigation",
    markov_sigma: float = 0.0,
    markov_time: float = 0.0,
    sigma: float = 3.7,
    noise: str = "white",
    coupling: str = "loose",
    drag_off_rate: float | None = None,
    horizontal_alert_limit: float = ALERT_LIMITS[0],
    vertical_alert_limit: float = ALERT_LIMITS[1],
    guidance: str | None = None,
    aids: str | None = None,
) -> Scenario:
    """The Liu flight: aviation-grade INS and a single-frequency GPS receiver.

    Settings of the filter: Liu 2018, table 1 and appendix D. The position random walk that the filter believes in (1
    m/√h) really acts on the INS. By default the noise of the fixes is white with the filter's own R, so that the filter
    is matched; with ``noise=ranges`` fixes are made from the ranges to the 24-slot constellation, which starts at
    00:00:00 on 1 July 1993, with the errors of table 1, and the filter keeps its R.

    Args:
        horizon: epochs of the game.
        onset: time of the last clean fix, s.
        rate: of the fixes, Hz.
        imu: name of the IMU grade.
        markov_sigma: first-order Gauss-Markov receiver noise in the horizontal axes, m; the vertical has R's ratio;
            unknown to the filter.
        markov_time: its correlation time, s.
        sigma: the filter's R and the white noise of the fix per horizontal axis, m; the vertical keeps the paper's
            ratio, 6 / 3.7.
        noise: of the fixes: ``white``, or ``ranges``.
        coupling: ``loose``: the filter takes fixes; ``tight``: it takes code and rate of every range itself, with the
            errors of table 1.
        drag_off_rate: largest rate of the spoofed position per axis, and of the spoofed clock, m/s; None = 4 where the
            filter takes fixes, 0.25 where it takes ranges.
        horizontal_alert_limit: position error from which the navigation is hazardous, m.
        vertical_alert_limit: m.
        guidance: how the vehicle is steered by its own estimate: ``first-order:T``, or ``second-order:T/damping=D``,
            with ``axes=lateral`` or ``axes=horizontal`` and ``corridor=WIDTH`` after further slashes (s, m); None = it
            keeps its path whatever it estimates.
        aids: what corrects the filter beside GNSS: ``barometer``, ``magnetometer``, or both joined by ``+``, each with
            ``/`` in place of the commas between its options; None = nothing. A filter of ranges reads them at its
            epochs.

    Raises:
        ValueError: an unknown name, a number out of range, a game outside the flight, or options that do not go
            together.
    """
    owner = "liu-flight"
    validation.one_of(owner, "noise", noise, NOISES)
    validation.one_of(owner, "coupling", coupling, COUPLINGS)
    require_grade(owner, "imu", imu)
    horizon = validation.whole(owner, "horizon", horizon, 1, MOST_EPOCHS)
    onset = validation.above(owner, "onset", onset)
    rate = validation.between(owner, "rate", rate, *RATES)
    sigma = validation.between(owner, "sigma", sigma, *SIGMAS)
    markov_sigma = validation.non_negative(owner, "markov_sigma", markov_sigma, SIGMAS[1])
    markov_time = validation.zero_or_above(owner, "markov_time", markov_time)
    usual = DRAG_OFF_RATES[coupling]
    rules = flight_rules(owner, drag_off_rate, usual, horizontal_alert_limit, vertical_alert_limit)
    sensors = make_aids(owner, aids, IN_THE_AIR)
    coloured = markov_sigma != 0.0 or markov_time != 0.0
    if coloured and not (markov_sigma and markov_time):
        raise ValueError(
            f"{owner}: markov_sigma and markov_time go together, got {written(markov_sigma)} m with "
            f"{written(markov_time)} s"
        )
    name = spell_changed(
        owner,
        liu_flight,
        horizon=horizon,
        onset=onset,
        rate=rate,
        imu=imu,
        markov_sigma=markov_sigma,
        markov_time=markov_time,
        sigma=sigma,
        noise=noise,
        coupling=coupling,
        drag_off_rate=None if rules.fastest == usual else rules.fastest,
        horizontal_alert_limit=rules.alert_limits[0],
        vertical_alert_limit=rules.alert_limits[1],
        aids=spell_aids(sensors),
    )
    if coupling == "tight" and (noise != "white" or coloured or sigma != 3.7):
        raise ValueError(f"{owner}: noise, sigma, markov_sigma, markov_time are of fixes; coupling=tight has none")
    if noise == "ranges" and coloured:
        raise ValueError(f"{owner}: markov_sigma and markov_time go with noise=white; errors of ranges have their own")
    truth = SimulatedTruth(name=name, trajectory=_trajectory(), rate=rate, onset=onset, horizon=horizon)
    fixes = _Fixes(sigma, markov_sigma, markov_time, noise, sensors)
    return rules.scenario(FAMILIES[coupling](truth, imu, fixes)).guided(guidance, "horizontal")


@dataclass(frozen=True)
class _Fixes:
    """What a user says of the fixes; as in `liu_flight`."""

    sigma: float
    markov_sigma: float
    markov_time: float
    noise: str
    aids: tuple[Aid, ...]


def _loose(truth: SimulatedTruth, imu: str, fixes: _Fixes) -> LooseFamily:
    """The filter that takes fixes."""
    white = (fixes.sigma, fixes.sigma, 6.0 * (fixes.sigma / 3.7))
    receiver = Receiver(
        rate=truth.rate,
        white_sigma=white,
        markov_sigma=(fixes.markov_sigma, fixes.markov_sigma, fixes.markov_sigma * white[2] / white[0]),
        markov_time=fixes.markov_time,
    )
    ranges = None
    if fixes.noise == "ranges":
        receiver = Receiver(rate=truth.rate, white_sigma=ZERO)
        ranges = range_fix_along(LIU, gps_24(), truth.trajectory, truth.rate)
    family = LooseFamily(
        truth=truth,
        grade=grade(imu),
        receiver=receiver,
        tuning=FilterTuning(measurement_sigma=white),
        true_position_random_walk=FilterTuning().position_random_walk,
        ranges=ranges,
    )
    return with_aids(family, fixes.aids)


def _tight(truth: SimulatedTruth, imu: str, fixes: _Fixes) -> TightFamily:
    """The filter that takes code and rate of every range."""
    family = TightFamily(
        truth=truth,
        grade=grade(imu),
        errors=LIU,
        constellation=gps_24(),
        start_time=0.0,
        mask=MASK,
        tuning=FilterTuning(),
        observable="rate",
    )
    return with_aids_on_ranges(family, fixes.aids)


FAMILIES: dict[str, Callable[[SimulatedTruth, str, _Fixes], FilterFamily]] = {"loose": _loose, "tight": _tight}
"""What makes the filter, by coupling."""
