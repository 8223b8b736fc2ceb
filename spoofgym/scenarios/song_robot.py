"""The ground robot of Song et al. (2021): 300 s around a badminton court at 0.5 m/s, GNSS at 1 Hz, odometer at 10 Hz.

Court, speed, duration, rates, the encoder's 495 counts, the initial yaw of 248 deg and the 0.59 m of the receiver
follow the paper. Its data are not published. Ours are the radius of the corners and the sense of the turns, the wheels,
the errors of wheels and yaw (`spoofgym.sensors.odometer.GRADES`), what the filter believes, and the spectrum of the
receiver's error. Standing still is the paper's data set Ψ1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.burn_in_cache import kept_by_burn_in
from spoofgym.navigation.credible.kalman import CredibleTuning, credible_linear_model, standing_start
from spoofgym.navigation.credible.runs import ANCHORING, AuxiliaryRule, CredibleModel, CredibleNavigator
from spoofgym.navigation.facts import LINEAR_MODEL, ODOMETER, FilterFacts
from spoofgym.navigation.interface import Demands
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.navigation.loose.warm_start import COLOUR, NUM_JOINT
from spoofgym.parallel import RunSlices
from spoofgym.scenario import Scenario
from spoofgym.scenarios.limits import MOST_EPOCHS, SIGMAS
from spoofgym.sensors.imu import DEGREE_PER_HOUR, MICRO_G
from spoofgym.sensors.odometer import GRADES, Odometer, OdometerGrade, PlanarMotion, odometer_grade
from spoofgym.sensors.receiver import Receiver, draw_noise
from spoofgym.specification import spell
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline

COURT = (13.4, 6.1)
"""Sides of the rectangle, m."""
SPEED = 0.5
"""Of the robot, m/s; the spoofer's limit on each axis, too, which is the mean of the paper's slow change."""
CORNER = 0.5
"""Radius of the corners, m."""
START_YAW = math.radians(248.0)
"""Along a long side, clockwise from north; the corners are right turns."""

SIGMA = 0.59
WHITE_SHARE = 0.15 / math.hypot(0.85, 0.15)
"""Of the receiver's sigma, where most of it is slow."""
MARKOV_TIME = 60.0

ACCELERATION = 0.5 / SIGMA
AUXILIARY = 0.49 / SIGMA
"""What the filter believes, over the sigma of the fix: its gains do not depend on that. Together they are tuned to the
lag of the paper's filter behind a drag-off, 5.5 s: (107.73 - 103.84) m at 0.707 m/s."""

IMU_BIAS = np.repeat([5.0 * 3600.0 * DEGREE_PER_HOUR, 60e3 * MICRO_G], 3)
"""Offsets that the data sheet of the MPU-9250 allows, rad/s and m/s²; the filter estimates none."""

DATA = ("rectangle", "static")
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


def standstill(times: Floats) -> PlanarMotion:
    """No motion at all."""
    nowhere = np.zeros((len(times), 2))
    return PlanarMotion(nowhere, np.full(len(times), START_YAW), nowhere, np.zeros(len(times) - 1))


@dataclass(frozen=True, kw_only=True, eq=False)
class SongRobot(Scenario):
    """A robot in the plane with the credible filter, in the linear fidelity.

    The filter is linear, and so is what an offset does to it (`linear_model`); but its model is wrong (it takes an
    auxiliary position that drifts for independent measurements), so that its clean innovations are not white.

    Attributes:
        name: the specification that builds it.
        data: ``rectangle`` or ``static``.
        odometer: the encoders.
        grade: of their errors and the yaw's.
        receiver: of the fixes.
        tuning: what the filter believes.
        rule: for the auxiliary position.
        onset: time of epoch 0, s.
        horizon: epochs of the game.
    """

    fidelities = ("linear",)
    offers = (ODOMETER, LINEAR_MODEL)
    matched = False
    dimension = 3
    drag_off_rate = (SPEED, SPEED, SPEED)
    error_scale = 5.0
    defender_scale = 1.0
    depth_table = DEPTHS

    name: str
    data: str
    odometer: Odometer
    grade: OdometerGrade
    receiver: Receiver
    tuning: CredibleTuning
    rule: AuxiliaryRule
    onset: float
    horizon: int

    @property
    def timeline(self) -> Timeline:  # type: ignore[override]
        """The epochs of the game."""
        return Timeline.steady(self.onset, self.receiver.interval, self.horizon)

    @property
    def bias_sigma(self) -> Floats:
        """Data-sheet bias of the IMU, (6,), rad/s and m/s²."""
        return IMU_BIAS

    @property
    def fix_sigma(self) -> float:
        """Of the receiver's whole error per horizontal axis, 1 sigma, m."""
        return math.hypot(self.receiver.white_sigma[0], self.receiver.markov_sigma[0])

    @property
    def facts(self) -> FilterFacts:
        """What the designer of the filter knows."""
        speed = 0.0 if self.data == "static" else SPEED
        drift = self.grade.drift_sigma(speed, self.receiver.interval, self.horizon * self.receiver.interval)
        return FilterFacts(
            self.name,
            self.timeline.interval,
            self.bias_sigma,
            self.offers,
            self.linear_model,
            self.fix_sigma,
            drift,
        )

    def times(self, burn_in: int) -> Floats:
        """Scenario time of the epochs -burn_in..K, s."""
        start = self.onset - burn_in * self.receiver.interval
        return Timeline.steady(start, self.receiver.interval, self.horizon + burn_in).times

    @kept_by_burn_in
    def motion(self, burn_in: int = 0) -> PlanarMotion:
        """The truth at the odometer's samples, from one interval before epoch -burn_in on."""
        steps = (burn_in + 1 + self.horizon) * self.tuning.samples
        start = self.onset - (burn_in + 1) * self.receiver.interval
        times: Floats = start + self.odometer.step * np.arange(steps + 1, dtype=np.float64)
        return standstill(times) if self.data == "static" else rectangle(times, self.odometer.step)

    def _at_epochs(self, samples: Floats) -> Floats:
        """Of planar samples those at the epochs, with a zero height, (E, 3)."""
        chosen = samples[self.tuning.samples :: self.tuning.samples]
        return np.column_stack([chosen, np.zeros(len(chosen))])

    def velocity(self, burn_in: int = 0) -> Floats:
        """The true velocity at epochs -burn_in..K, (burn_in + K + 1, 3), ENU, m/s."""
        return self._at_epochs(self.motion(burn_in).velocity)

    def track(self) -> Floats:
        """The true position at epochs 0..K from that at epoch 0, (K+1, 3), m ENU."""
        position = self._at_epochs(self.motion().position)
        return position - position[0]

    @kept_by_burn_in
    def linear_model(self, burn_in: int = 0) -> LinearModel:
        """What offsets do to the filter from epoch -burn_in on, every fix used: exact."""
        return credible_linear_model(self.tuning, self.rule.anchoring != "free", self.times(burn_in))

    def navigator(
        self, fidelity: str, demands: Demands, burn_in: int, num_runs: int, slices: RunSlices
    ) -> CredibleNavigator:
        """A navigator whose model starts ``burn_in`` epochs before epoch 0; arguments as in `Scenario`."""
        self.check_fidelity(fidelity)
        model = CredibleModel(
            motion=self.motion(burn_in), odometer=self.odometer, grade=self.grade, tuning=self.tuning, rule=self.rule
        )
        return CredibleNavigator(model, num_runs, slices, demands)

    @cached_property
    def _start(self) -> Floats:
        return standing_start(self.tuning, self.receiver)

    def draw_initial(self, runs: Runs, burn_in: int, streams: RunStreams) -> Floats:
        """Joint states of filter and receiver after a long standstill, (n, 30)."""
        initial = np.zeros((len(runs), NUM_JOINT))
        normals = np.stack([streams(run, "initial").standard_normal(NUM_JOINT) for run in runs])
        for j in np.flatnonzero(self._start.any(axis=0)):
            initial += normals[:, j, None] * self._start[:, j]
        return initial

    def draw_receiver_noise(self, runs: Runs, initial: Floats, burn_in: int, streams: RunStreams) -> Floats:
        """Receiver noise of the epochs -burn_in..K, (n, burn_in + K + 1, 3), m."""
        epochs = burn_in + self.horizon + 1
        return np.stack(
            [
                draw_noise(self.receiver, epochs, streams(run, "receiver"), initial[place, COLOUR])
                for place, run in enumerate(runs)
            ]
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
) -> SongRobot:
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

    Raises:
        ValueError: an unknown name, or a number out of range.
    """
    owner = "song-robot"
    validation.one_of(owner, "data", data, DATA)
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
    white = sigma if noise == "white" else WHITE_SHARE * sigma
    slow = 0.0 if noise == "white" else math.sqrt(1.0 - WHITE_SHARE**2) * sigma
    encoders, receiver_rate = Odometer(), 1.0
    return SongRobot(
        name=spell(
            owner,
            data=None if data == "rectangle" else data,
            noise=None if noise == "markov" else noise,
            sigma=None if sigma == SIGMA else sigma,
            odometer=None if odometer == "set-a" else odometer,
            auxiliary=None if auxiliary == "anchored" else auxiliary,
            credit=None if credit == 5 else rule.credit,
            horizon=None if horizon == 300 else horizon,
            onset=None if onset == 0.0 else onset,
        ),
        data=data,
        odometer=encoders,
        grade=odometer_grade(odometer),
        receiver=Receiver(
            rate=receiver_rate,
            white_sigma=(white, white, sigma),
            markov_sigma=(slow, slow, 0.0),
            markov_time=0.0 if noise == "white" else MARKOV_TIME,
        ),
        tuning=CredibleTuning(
            step=encoders.step,
            samples=round(encoders.rate / receiver_rate),
            acceleration=ACCELERATION * sigma,
            auxiliary_sigma=AUXILIARY * sigma,
            fix_sigma=sigma,
            height_sigma=sigma,
        ),
        rule=rule,
        onset=onset,
        horizon=horizon,
    )
