"""Attacks that follow a profile that is fixed in advance. They do not react to the victim."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray
from scipy import special

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.attacks.base import Attack
from spoofgym.geodesy import AXIS_LETTERS
from spoofgym.navigation.interface import Clock
from spoofgym.specification import spell
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline
from spoofgym.validation import written

EAST = 90.0


def heading(direction: float) -> Floats:
    """Horizontal unit vector of an azimuth in degrees clockwise from north, (3,), ENU."""
    return np.array([special.sindg(direction), special.cosdg(direction) + 0.0, 0.0])


class NoAttack(Attack):
    """Clean fixes."""

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return "none"

    def active(self, clock: Clock) -> Flags:
        """Never, (N,)."""
        return np.zeros(self._num_runs, dtype=bool)

    def offset(self, clock: Clock) -> Floats:
        """Zero, (N, 3), m ENU."""
        return np.zeros((self._num_runs, 3))


class Ramp(Attack):
    """Synchronised ramp: the offset is the rate times the time since the onset (Liu 2018, eq 14 with b = 0).

    At the first spoofed epoch of a 1 Hz game it is the rate times one second.

    Args:
        rate: m/s.
        direction: azimuth, degrees clockwise from north.
        onset: scenario time, s; None = the start of the game.

    Raises:
        ValueError: the rate is negative, or a value is not finite.
    """

    def __init__(self, rate: float, direction: float = EAST, onset: float | None = None) -> None:
        self.rate = validation.non_negative("ramp", "rate", rate)
        self.direction = validation.finite("ramp", "direction", direction)
        self.onset = None if onset is None else validation.time("ramp", "onset", onset)
        self._velocity = self.rate * heading(self.direction)

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return spell("ramp", self.rate, direction=None if self.direction == EAST else self.direction, onset=self.onset)

    def offset(self, clock: Clock) -> Floats:
        """Rate times time since the onset along the direction, (N, 3), m ENU."""
        return self.elapsed(clock)[:, None] * self._velocity


class JumpRamp(Attack):
    """Unsynchronised ramp: a jump b, then a ramp along the same direction, s(t) = alpha t + b (Liu 2018, eq 14).

    Args:
        rate: alpha, m/s.
        jump: b, m.
        direction: azimuth, degrees clockwise from north.
        onset: scenario time, s; None = the start of the game.

    Raises:
        ValueError: rate or jump is negative, or a value is not finite.
    """

    def __init__(self, rate: float, jump: float, direction: float = EAST, onset: float | None = None) -> None:
        self.rate = validation.non_negative("jump-ramp", "rate", rate)
        self.jump = validation.non_negative("jump-ramp", "jump", jump)
        self.direction = validation.finite("jump-ramp", "direction", direction)
        self.onset = None if onset is None else validation.time("jump-ramp", "onset", onset)
        self._heading = heading(self.direction)

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        direction = None if self.direction == EAST else self.direction
        return spell("jump-ramp", self.rate, jump=self.jump, direction=direction, onset=self.onset)

    def offset(self, clock: Clock) -> Floats:
        """Jump plus rate times time since the onset along the direction, (N, 3), m ENU."""
        distance = self.rate * self.elapsed(clock) + self.jump * self.started(clock)
        return distance[:, None] * self._heading


class RandomProfile(Attack):
    """An attack that draws the offsets of an episode in its reset.

    A run draws a block of fixed size from its own stream "opponent", whatever the onset, so that run i is the same for
    any number of runs and the next episode starts at the same place of the stream.

    Args:
        mean: of the normal disturbance, on each axis, m.
        variance: of the disturbance, m².
        onset: scenario time, s; None = the start of the game.
        axes: letters of the axes that are spoofed: ``e``, ``n``, ``u``.
        end: scenario time of the last spoofed fix, s; None = that of the game.

    Raises:
        ValueError: a negative variance, a value that is not finite, axes other than these letters, each at most once,
            or an end that is not after the onset.
    """

    kind: str
    default_mean: float
    default_variance: float

    def __init__(self, mean: float, variance: float, onset: float | None, axes: str, end: float | None) -> None:
        self.mean = validation.finite(self.kind, "mean", mean)
        self.variance = validation.non_negative(self.kind, "variance", variance)
        self.onset = None if onset is None else validation.time(self.kind, "onset", onset)
        text = validation.text(self.kind, "axes", axes)
        if any(letter not in AXIS_LETTERS or text.count(letter) > 1 for letter in text):
            raise ValueError(
                f"{self.kind}: axes must be letters of 'enu', each at most once, got {validation.shown(axes)}"
            )
        self.axes = axes
        self.end = None if end is None else validation.time(self.kind, "end", end)

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return spell(
            self.kind,
            mean=None if self.mean == self.default_mean else self.mean,
            variance=None if self.variance == self.default_variance else self.variance,
            onset=self.onset,
            axes=None if self.axes == "en" else self.axes,
            end=self.end,
        )

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Fit the attack to a game and allocate an episode's offsets.

        Raises:
            ValueError: the attack starts before the game or after its end, or ends before it starts.
        """
        super().bind(timeline, num_runs)
        if self.end is not None and not self.end > self._onset:
            raise ValueError(
                f"attack {self.name!r}: end {written(self.end)} s must be after the onset, {written(self._onset)} s"
            )
        index = np.arange(timeline.num_epochs + 1)
        clock = Clock(index, timeline.times)
        self._runs = np.arange(num_runs)
        self._columns = [AXIS_LETTERS.index(letter) for letter in self.axes]
        self._elapsed = self.elapsed(clock)
        self._started = self.started(clock)
        self._ended = self.ended(clock)
        self._rows = self._block_length(timeline)
        self._offsets = np.zeros((num_runs, len(index), 3))

    def ended(self, clock: Clock) -> Flags:
        """Whether the epoch lies after the end, (N,); rounding of its time does not count."""
        end = np.inf if self.end is None else self.end
        return clock.time - end > 1e-6 * self._timeline.interval

    def active(self, clock: Clock) -> Flags:
        """From the onset to the end, (N,)."""
        return self.started(clock) & ~self.ended(clock)

    def reset(self, runs: Runs, streams: RunStreams) -> None:
        """Draw the offsets of new episodes."""
        shape = (self._rows, len(self._columns))
        normal = np.stack([streams(int(run), "opponent").standard_normal(shape) for run in runs])
        disturbance = self.mean + np.sqrt(self.variance) * normal
        offsets = np.zeros((len(runs), len(self._elapsed), 3))
        offsets[:, :, self._columns] = self._profile(disturbance, self._elapsed, self._started)
        offsets[:, self._ended] = 0.0
        self._offsets[runs] = offsets

    def offset(self, clock: Clock) -> Floats:
        """This epoch's offset, (N, 3), m ENU."""
        return self._offsets[self._runs, np.maximum(clock.index, 0)]

    @abstractmethod
    def _block_length(self, timeline: Timeline) -> int:
        """Disturbances per axis and episode."""

    @abstractmethod
    def _profile(self, disturbance: Floats, elapsed: Floats, started: NDArray[np.bool_]) -> Floats:
        """The offsets of the epochs, (R, K + 1, axes), m.

        Args:
            disturbance: (R, block length, axes), m.
            elapsed: time of each epoch since the onset, (K + 1,), s.
            started: whether the epoch lies after the onset, (K + 1,).
        """


class Jump(RandomProfile):
    """A jump that is drawn anew at every epoch and on every axis (Song 2021, eq 28, whose 0.1 is a variance).

    Args and errors as `RandomProfile`.
    """

    kind = "jump"
    default_mean = 20.0
    default_variance = 0.1

    def __init__(
        self,
        mean: float = default_mean,
        variance: float = default_variance,
        onset: float | None = None,
        axes: str = "en",
        end: float | None = None,
    ) -> None:
        super().__init__(mean, variance, onset, axes, end)

    def _block_length(self, timeline: Timeline) -> int:
        return timeline.num_epochs + 1

    def _profile(self, disturbance: Floats, elapsed: Floats, started: NDArray[np.bool_]) -> Floats:
        return disturbance * started[:, None]


class SlowChange(RandomProfile):
    """A random walk with drift: a normal disturbance is added in every second, on every axis (Song 2021, eq 29).

    Within a second it grows evenly ("slowly and continuously during each second"), which only a receiver faster than 1
    Hz shows.

    Args and errors as `RandomProfile`; the mean is that of one second.
    """

    kind = "slow-change"
    default_mean = 0.5
    default_variance = 0.05

    def __init__(
        self,
        mean: float = default_mean,
        variance: float = default_variance,
        onset: float | None = None,
        axes: str = "en",
        end: float | None = None,
    ) -> None:
        super().__init__(mean, variance, onset, axes, end)

    def _block_length(self, timeline: Timeline) -> int:
        return int(np.ceil(timeline.end - timeline.start)) + 1

    def _profile(self, disturbance: Floats, elapsed: Floats, started: NDArray[np.bool_]) -> Floats:
        second = elapsed.astype(np.int64)
        done = np.cumsum(disturbance, axis=1) - disturbance
        return done[:, second] + (elapsed - second)[:, None] * disturbance[:, second]
