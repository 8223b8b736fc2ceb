"""The flight of Shadmehri and Mahboobi Esfanjani (2025): 30 s straight and level, inertial samples at 160 Hz.

Velocity, rates, R, the noise of the inertial sensors, the initial uncertainty and the duration follow the paper, whose
attack begins at 20 s and lasts 5 s. It does not say what noise the receiver has: that is a toolbox's model. Ours are
the place, the two kinds of noise and the figures of the Gauss-Markov one.
"""

from __future__ import annotations

import math
from functools import lru_cache

from spoofgym import validation
from spoofgym.navigation.loose.adaptation import Adaptation
from spoofgym.navigation.loose.family import LooseFamily
from spoofgym.navigation.tuning import FilterTuning
from spoofgym.scenario import Scenario
from spoofgym.scenarios.limits import SPEEDS
from spoofgym.sensors.imu import grade
from spoofgym.sensors.receiver import RATES, Receiver
from spoofgym.specification import spell_changed
from spoofgym.trajectory import Straight, Trajectory, fly
from spoofgym.truth import SimulatedTruth

START = (math.radians(35.69), math.radians(51.31), 3000.0)
"""Near Tehran: latitude rad, longitude rad, height m."""

IMU_RATE = 160.0
DURATION = 30.0
EAST_TO_NORTH = 4.0
"""200 m/s east and 50 m/s north: the heading stays when the speed is another."""

SIGMA = (3.7, 3.7, 6.0)
"""R of the filter, 1 sigma (E, N, U), m."""

MARKOV_SIGMA = (1.6, 1.6, 3.0)
MARKOV_TIME = -0.1 / math.log(0.999)
"""A factor of 0.999 per sample at 10 Hz: 100 s."""

NOISES = ("white", "markov")
FILTERS = ("common", "self-tuning")


@lru_cache(maxsize=8)
def shadmehri_trajectory(speed: float) -> Trajectory:
    """True motion of the flight, 4800 IMU steps at 160 Hz.

    Args:
        speed: of the eastern component, m/s; the northern one is a quarter of it.
    """
    return fly(
        [Straight(DURATION)],
        position=START,
        speed=math.hypot(speed, speed / EAST_TO_NORTH),
        heading=math.atan2(EAST_TO_NORTH, 1.0),
        rate=IMU_RATE,
    )


def shadmehri_flight(
    filter: str = "common",
    noise: str = "white",
    rate: float = 10.0,
    speed: float = 200.0,
    onset: float | None = None,
    window: int | None = None,
    guard: str | None = None,
    guidance: str | None = None,
) -> Scenario:
    """The flight as a game that ends at 30 s, with a filter of constant R and Q or one that tunes itself.

    The paper's attack is ``ramp:RATE,direction=45,onset=20`` with √2 times its rate: it spoofs east and north at that
    rate each. The filter of constant R is matched where the noise is white. The windows of a self-tuning filter begin
    to fill with the burn-in of the detectors, or else with the game.

    Args:
        filter: ``common`` or ``self-tuning``.
        noise: of the receiver: ``white`` with the filter's own R, or ``markov``, first-order Gauss-Markov with 1.6, 1.6
            and 3 m and 100 s, while the filter keeps R.
        rate: of the fixes, Hz; up to the IMU's 160.
        speed: eastern component of the velocity, m/s; the northern one is a quarter of it.
        onset: time of epoch 0, s; None = the second fix of the flight, the first possible one. Detectors that need a
            burn-in need a later one where the filter is not matched.
        window: w of the self-tuning filter, fixes; None = 50.
        guard: of its recursion, see `Adaptation`; None = as published.
        guidance: how the vehicle is steered by its own estimate: ``first-order:T``, or ``second-order:T/damping=D``,
            with ``axes=lateral`` or ``axes=horizontal`` and ``corridor=WIDTH`` after further slashes (s, m); None = it
            keeps its path whatever it estimates.

    Raises:
        ValueError: an unknown filter, noise or guard, a window or a guard for the common filter, a number out of range,
            or a game outside the flight.
    """
    owner = "shadmehri-flight"
    validation.one_of(owner, "filter", filter, FILTERS)
    validation.one_of(owner, "noise", noise, NOISES)
    speed = validation.between(owner, "speed", speed, *SPEEDS)
    rate = validation.between(owner, "rate", rate, *RATES)
    if filter == "common" and (window is not None or guard is not None):
        raise ValueError(f"{owner}: window and guard are of filter 'self-tuning', got filter 'common'")
    default, white = Adaptation(), noise == "white"
    window = default.window if window is None else validation.epochs(owner, "window", window)
    guard = default.guard if guard is None else validation.text(owner, "guard", guard)
    first = 2.0 / rate
    start = first if onset is None else validation.between(owner, "onset", onset, first, DURATION - 1.0 / rate)
    name = spell_changed(
        owner,
        shadmehri_flight,
        filter=filter,
        noise=noise,
        rate=rate,
        speed=speed,
        onset=None if start == first else start,
        window=None if window == default.window else window,
        guard=None if guard == default.guard else guard,
    )
    receiver = Receiver(
        rate=rate,
        white_sigma=SIGMA if white else (0.0, 0.0, 0.0),
        markov_sigma=(0.0, 0.0, 0.0) if white else MARKOV_SIGMA,
        markov_time=0.0 if white else MARKOV_TIME,
    )
    truth = SimulatedTruth(
        name=name,
        trajectory=shadmehri_trajectory(speed),
        rate=rate,
        onset=start,
        horizon=math.floor((DURATION - start) * rate + 1e-6),
    )
    family = LooseFamily(
        truth=truth,
        grade=grade("navigation"),
        receiver=receiver,
        tuning=FilterTuning(measurement_sigma=SIGMA),
        true_position_random_walk=FilterTuning().position_random_walk,
        adaptation=Adaptation(window, guard) if filter == "self-tuning" else None,
    )
    made = Scenario(family=family, drag_off_rate=(5.0, 5.0, 5.0), error_scale=10.0, defender_scale=10.0)
    return made.guided(guidance, "horizontal")
