"""The ground robot of Song et al. (2021): 300 s around a badminton court at 0.5 m/s, GNSS at 1 Hz, odometer at 10 Hz.

Court, speed, duration, rates, the encoder's 495 counts, the initial yaw of 248 deg and the 0.59 m of the receiver
follow the paper. Its data are not published. Ours are the radius of the corners and the sense of the turns, the wheels,
the errors of wheels and yaw (`spoofgym.sensors.odometer.GRADES`), what the filter believes, and the spectrum of the
receiver's error. Standing still is the paper's data set Ψ1.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.navigation.credible.family import CredibleFamily
from spoofgym.navigation.credible.kalman import CredibleTuning
from spoofgym.navigation.credible.runs import ANCHORING, AuxiliaryRule
from spoofgym.navigation.credible.truth import PlanarTruth
from spoofgym.scenario import Scenario
from spoofgym.scenarios.limits import MOST_EPOCHS, SIGMAS
from spoofgym.sensors.imu import DEGREE_PER_HOUR, MICRO_G
from spoofgym.sensors.odometer import GRADES, Odometer, PlanarMotion, odometer_grade
from spoofgym.sensors.receiver import Receiver
from spoofgym.specification import spell_changed

COURT = (13.4, 6.1)
"""Sides of the rectangle, m."""
SPEED = 0.5
"""Of the robot, m/s. It is also the spoofer's limit on each axis: the mean of the paper's slow change."""
CORNER = 0.5
"""Radius of the corners, m."""
START_YAW = math.radians(248.0)
"""Along a long side, clockwise from north; the corners are right turns."""

RATE = 1.0
"""Of the fixes, Hz."""
SIGMA = 0.59
WHITE_SHARE = 0.15 / math.hypot(0.85, 0.15)
"""Of the receiver's sigma, where most of it is slow."""
MARKOV_TIME = 60.0

ACCELERATION = 0.5 / SIGMA
AUXILIARY = 0.49 / SIGMA
"""What the filter believes, over the sigma of the fix: its gains do not depend on that. Together they are tuned to the
lag of the paper's filter behind a drag-off, 5.5 s: (107.73 - 103.84) m at 0.707 m/s."""

IMU_BIAS = (5.0 * 3600.0 * DEGREE_PER_HOUR,) * 3 + (60e3 * MICRO_G,) * 3
"""Offsets that the data sheet of the MPU-9250 allows, rad/s and m/s²; the filter estimates none."""

NOISES = ("markov", "white")
DEPTHS = (0, 2, 5, 10, 20, 30)
"""Depth table; ours: the paper's detectors take 1 to 27 s."""


def rectangle(times: Floats, step: float) -> PlanarMotion:
    """Round and round the court, its corners rounded; at time 0 the robot is at the beginning of a long side.

    Args:
        times: of the samples, (J+1,), s; they may be negative.
        step: between them, s.
    """
    straights = np.tile(np.array(COURT) - 2.0 * CORNER, 2)
    corner = 0.5 * math.pi * CORNER
    lengths = np.column_stack([straights, np.full(4, corner)]).ravel()
    begins = np.concatenate([[0.0], np.cumsum(lengths)])
    yaws = START_YAW + 0.5 * math.pi * np.repeat(np.arange(4), 2)
    ends = np.array([_arc(yaw, length, turn) for yaw, length, turn in zip(yaws, lengths, (0.0, 1.0) * 4, strict=True)])
    corners = np.concatenate([np.zeros((1, 2)), np.cumsum(ends, axis=0)])
    lap, way = np.divmod(SPEED * times, begins[-1])
    piece = np.minimum(np.searchsorted(begins, way, side="right") - 1, len(lengths) - 1)
    inside, turning = way - begins[piece], piece % 2
    yaw = yaws[piece] + 2.0 * math.pi * lap + turning * inside / CORNER
    moved = [_arc(yaws[p], s, float(turn)) for p, s, turn in zip(piece, inside, turning, strict=True)]
    return PlanarMotion(
        position=corners[piece] + np.array(moved),
        yaw=yaw,
        velocity=SPEED * np.column_stack([np.sin(yaw), np.cos(yaw)]),
        travel=np.full(len(times) - 1, SPEED * step),
    )


def _arc(yaw: float, length: float, turn: float) -> Floats:
    """Displacement along a straight (turn 0) or a right turn of radius `CORNER` (turn 1), (2,), m."""
    if turn == 0.0:
        return length * np.array([math.sin(yaw), math.cos(yaw)])
    after = yaw + length / CORNER
    return CORNER * np.array([math.cos(yaw) - math.cos(after), math.sin(after) - math.sin(yaw)])


def standstill(times: Floats, step: float) -> PlanarMotion:
    """No motion at all; arguments as in `rectangle`."""
    nowhere = np.zeros((len(times), 2))
    return PlanarMotion(nowhere, np.full(len(times), START_YAW), nowhere, np.zeros(len(times) - 1))


PATHS: dict[str, tuple[Callable[[Floats, float], PlanarMotion], float]] = {
    "rectangle": (rectangle, SPEED),
    "static": (standstill, 0.0),
}
"""The motion and its speed, m/s, by ``data``."""


def _receiver(noise: str, sigma: float) -> Receiver:
    """A receiver whose fixes err by sigma per axis, m, with one of `NOISES`; the error of the height is white."""
    if noise == "white":
        return Receiver(rate=RATE, white_sigma=(sigma,) * 3, markov_sigma=(0.0,) * 3, markov_time=0.0)
    white, slow = WHITE_SHARE * sigma, math.sqrt(1.0 - WHITE_SHARE**2) * sigma
    return Receiver(
        rate=RATE, white_sigma=(white, white, sigma), markov_sigma=(slow, slow, 0.0), markov_time=MARKOV_TIME
    )


def _tuning(encoders: Odometer, sigma: float) -> CredibleTuning:
    """What the filter believes; ``sigma`` of a fix per axis, m."""
    return CredibleTuning(
        step=encoders.step,
        samples=round(encoders.rate / RATE),
        acceleration=ACCELERATION * sigma,
        auxiliary_sigma=AUXILIARY * sigma,
        fix_sigma=sigma,
        height_sigma=sigma,
    )


def song_robot(
    data: str = "rectangle",
    noise: str = "markov",
    sigma: float = SIGMA,
    odometer: str = "set-a",
    auxiliary: str = "anchored",
    credit: int = 5,
    horizon: int = 300,
    onset: float = 0.0,
    guidance: str | None = None,
) -> Scenario:
    """The robot as a game from ``onset`` on; the paper's attacks begin at 150 s, or at 50 and 150 s.

    Args:
        data: ``rectangle`` (Ψ2) or ``static`` (Ψ1).
        noise: of the receiver, per axis with the same sigma in height, where it is always white: ``white``, or
            ``markov``, a Gauss-Markov part of 60 s with a white part of 17 % of sigma. A cheap receiver's error is
            slow; at the paper's thresholds white noise of this size alarms in most clean games.
        sigma: of a fix per axis, m, the receiver's and the filter's alike. 0.59 m is the paper's "1σ positioning
            accuracy" read as that; in its tables it is the standard deviation of the norm of the error in 300 s, which
            is smaller.
        odometer: grade of the errors of wheels and yaw: ``set-a``, ``set-b`` or ``table-1``.
        auxiliary: when the position by odometer and INS is set to the filter's: ``anchored``, ``credited`` or ``free``,
            see `AuxiliaryRule`.
        credit: fixes used in a row, with ``credited``.
        horizon: epochs of the game.
        onset: time of epoch 0, s.
        guidance: how the vehicle is steered by its own estimate: ``first-order:T``, or ``second-order:T/damping=D``,
            with ``axes=lateral`` or ``axes=horizontal`` and ``corridor=WIDTH`` after further slashes (s, m); None = it
            keeps its path whatever it estimates.

    Raises:
        ValueError: an unknown name, or a number out of range.
    """
    owner = "song-robot"
    validation.one_of(owner, "data", data, tuple(PATHS))
    validation.one_of(owner, "noise", noise, NOISES)
    validation.one_of(owner, "odometer", odometer, tuple(GRADES))
    sigma = validation.between(owner, "sigma", sigma, *SIGMAS)
    horizon = validation.whole(owner, "horizon", horizon, 1, MOST_EPOCHS)
    onset = validation.finite(owner, "onset", onset)
    rule = AuxiliaryRule(
        anchoring=validation.one_of(owner, "auxiliary", auxiliary, ANCHORING),
        credit=validation.epochs(owner, "credit", credit),
    )
    if auxiliary != "credited" and credit != 5:
        raise ValueError(f"{owner}: credit {credit} is of auxiliary 'credited', got auxiliary {auxiliary!r}")
    encoders, receiver = Odometer(), _receiver(noise, sigma)
    name = spell_changed(
        owner,
        song_robot,
        data=data,
        noise=noise,
        sigma=sigma,
        odometer=odometer,
        auxiliary=auxiliary,
        credit=rule.credit,
        horizon=horizon,
        onset=onset,
    )
    tuning = _tuning(encoders, sigma)
    path, speed = PATHS[data]
    truth = PlanarTruth(
        name=name,
        path=path,
        speed=speed,
        interval=receiver.interval,
        step=encoders.step,
        samples=tuning.samples,
        onset=onset,
        horizon=horizon,
    )
    family = CredibleFamily(
        truth=truth,
        odometer=encoders,
        grade=odometer_grade(odometer),
        receiver=receiver,
        tuning=tuning,
        rule=rule,
        imu_bias=IMU_BIAS,
    )
    rates = (SPEED, SPEED, SPEED)
    return Scenario(
        family=family, drag_off_rate=rates, error_scale=5.0, defender_scale=1.0, harm_cap=20.0, depth_table=DEPTHS
    ).guided(guidance, "lateral")
