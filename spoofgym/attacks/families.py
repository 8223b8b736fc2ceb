"""Random attacks for populations: each episode draws its shape, size, heading, onset and length anew.

A family turns a block of uniform numbers per run into offsets. Every attack ends during the game or together with it.
After the end of an attack the fixes are true again.
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock
from spoofgym.specification import spell
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline, manoeuvre_times

DRAWS = 12
"""Uniform numbers of an episode, whatever becomes of them: six for the time and the heading, six for the shape."""
MEAN_WAIT = 60.0
"""Mean time from the beginning of the game to the onset, s (geometric)."""
LEAST_LEFT = 20.0
"""Time that is left in the game for an attack at least, s."""
DURATION = (20.0, 100.0)
"""Shortest and longest attack that ends in the game, s."""
TO_THE_END = 0.3
"""Share of the attacks that last to the end of the game."""
BEFORE_MANOEUVRE = 10.0
"""An onset in view of a manoeuvre comes at most so long before it, s."""
DEFAULT_MANOEUVRE = 0.15

RAMP_RATE = (0.2, 5.0)
"""Least and largest of a ramp, m/s."""
JUMP_SIZE = (5.0, 50.0)
"""Least and largest of a jump, m."""
GROWTH_SIZE = (10.0, 200.0)
"""Least and largest of a growth, m."""
GROWTH_TIME = (10.0, 80.0)
"""Shortest and longest growth, s."""
SLOW_RATE, FAST_RATE = (0.1, 0.8), (1.0, 6.0)
"""Least and largest of the two stages of a ramp, m/s."""
CHANGE_TIME = (15.0, 50.0)
"""Earliest and latest change from the one to the other, s after the onset."""
TURNING_RATE = (0.3, 3.0)
"""Least and largest of a ramp that turns back, m/s."""
TURNING_TIME = (10.0, 40.0)
"""Earliest and latest turn, s after the onset."""
DECAYING_SIZE = (10.0, 80.0)
"""Least and largest of a jump that decays, m."""
DECAY_TIME = (10.0, 40.0)
"""Shortest and longest decay to 1 / e, s."""
SPIRAL_RATE = (0.3, 3.0)
"""Least and largest of a spiral, m/s."""
SPIRAL_TURN = (-3.0, 3.0)
"""Least and largest rate at which its heading turns, deg/s."""
SPIRAL_CLIMB = (-1.0, 1.0)
"""Least and largest rate at which the height leaves, m/s."""


def spoofed_stretch(offsets: Floats) -> tuple[Runs, Runs]:
    """First and last epoch of episodes (n, K+1, 3) with an offset, (n,) each; K + 1 and 0 where there is none."""
    spoofed = np.any(offsets, axis=2)
    attacked, epochs = np.any(spoofed, axis=1), spoofed.shape[1]
    first = np.where(attacked, spoofed.argmax(axis=1), epochs)
    return first, np.where(attacked, epochs - 1 - spoofed[:, ::-1].argmax(axis=1), 0)


class AttackFamily(Attack):
    """Attacks of one shape, drawn anew in every episode.

    The onset waits geometrically from epoch 0 on, so that no epoch foretells it; with the share ``manoeuvre`` it comes
    up to 10 s before a manoeuvre of the vehicle instead, where there is any. Headings are uniform.

    Args:
        manoeuvre: share of attacks that begin in view of a manoeuvre.

    Attributes:
        draws: the uniform numbers of the present episodes, (N, 12); zero where there was none yet.

    Raises:
        ValueError: the share is not from 0 to 1.
    """

    kind: str
    draws: Floats

    def __init__(self, manoeuvre: float = DEFAULT_MANOEUVRE) -> None:
        self.manoeuvre = validation.share(self.kind, "manoeuvre", manoeuvre)
        self._manoeuvres: tuple[float, ...] = ()

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return spell(self.kind, manoeuvre=None if self.manoeuvre == DEFAULT_MANOEUVRE else self.manoeuvre)

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Fit the attack to a game and allocate the offsets of its episodes.

        Raises:
            ValueError: the game is too short for an attack.
        """
        super().bind(timeline, num_runs)
        if timeline.end - timeline.start < LEAST_LEFT + timeline.interval:
            raise ValueError(f"attack {self.name!r} needs a game of more than {LEAST_LEFT:g} s")
        self._elapsed_times = timeline.times - timeline.start
        self._offsets = np.zeros((num_runs, timeline.num_epochs + 1, 3))
        self.draws = np.zeros((num_runs, DRAWS))
        self._runs = np.arange(num_runs)
        self._first, self._last = spoofed_stretch(self._offsets)

    def follow(self, velocity: Floats) -> None:
        """Find the vehicle's manoeuvres in its true velocity at the moments of the game's steps, (M+1, 3), ENU, m/s."""
        latest = self._timeline.end - LEAST_LEFT
        self._manoeuvres = tuple(time for time in manoeuvre_times(velocity, self._timeline) if time <= latest)

    def reset(self, runs: Runs, streams: RunStreams) -> None:
        """Draw the offsets of new episodes."""
        self._offsets[runs] = self.episode(runs, streams)
        self._first[runs], self._last[runs] = spoofed_stretch(self._offsets[runs])

    def episode(self, runs: Runs, streams: RunStreams) -> Floats:
        """Draw new episodes; all their offsets, (n, K+1, 3), m ENU."""
        self.draws[runs] = [streams(run, "opponent").random(DRAWS) for run in runs.tolist()]
        return self.drawn(self.draws[runs])

    def drawn(self, draws: Floats) -> Floats:
        """The offsets that uniform numbers (n, 12) make, (n, K+1, 3), m ENU."""
        onset, duration = self._schedule(draws)
        since = self._elapsed_times - onset[:, None]
        # the offset of the epoch of the onset itself is zero: it grows from there on
        inside = (since > 1e-9) & (since <= duration[:, None] + 1e-9)
        angle = 2.0 * np.pi * draws[:, 5]
        shape = self._shape(draws[:, 6:], np.where(inside, since, 0.0), duration)
        sine, cosine = np.sin(angle)[:, None], np.cos(angle)[:, None]
        along, right, up = shape[:, :, 0], shape[:, :, 1], shape[:, :, 2]
        east, north = sine * along + cosine * right, cosine * along - sine * right
        return np.where(inside[:, :, None], np.stack([east, north, up], axis=2), 0.0)

    def _schedule(self, draws: Floats) -> tuple[Floats, Floats]:
        """Onset since the beginning of the game, a multiple of the interval, and length of the attack, (n,) each, s."""
        interval, whole = self._timeline.interval, self._timeline.end - self._timeline.start
        latest = int((whole - LEAST_LEFT) / interval)
        hazard = interval / MEAN_WAIT
        # the quantile of a geometric distribution that is cut at the latest epoch
        reach = 1.0 - (1.0 - hazard) ** (latest + 1)
        onset = np.minimum(np.floor(np.log1p(-draws[:, 0] * reach) / np.log1p(-hazard)), latest)
        if self._manoeuvres:
            chosen = np.array(self._manoeuvres)[(draws[:, 1] * len(self._manoeuvres)).astype(int)]
            early = np.floor((chosen - self._timeline.start - BEFORE_MANOEUVRE * draws[:, 0]) / interval)
            onset = np.where(draws[:, 2] < self.manoeuvre, np.maximum(early, 0.0), onset)
        onset = onset * interval
        length = DURATION[0] + (DURATION[1] - DURATION[0]) * draws[:, 3]
        return onset, np.where(draws[:, 4] < TO_THE_END, whole, length)

    def offset(self, clock: Clock) -> Floats:
        """This epoch's offset, (N, 3), m ENU."""
        return self._offsets[self._runs, np.maximum(clock.index, 0)]

    def active(self, clock: Clock) -> Flags:
        """Whether the receiver follows the spoofer, (N,): from the first offset of the episode to the last."""
        return (self._first <= clock.index) & (clock.index <= self._last)

    @abstractmethod
    def _shape(self, draws: Floats, since: Floats, duration: Floats) -> Floats:
        """Offsets along the heading, to its right and up, (n, K+1, 3), m.

        Args:
            draws: uniform numbers of the shape, (n, 6).
            since: time since the onset, (n, K+1), s.
            duration: of the attack, (n,), s.
        """


def _along(values: Floats) -> Floats:
    """Offsets that lie along the heading alone."""
    return np.stack([values, np.zeros_like(values), np.zeros_like(values)], axis=2)


def _between(draw: Floats, low: float, high: float) -> Floats:
    """Uniform from low to high."""
    return low + (high - low) * draw


def _log_between(draw: Floats, low: float, high: float) -> Floats:
    """Uniform in the logarithm from low to high."""
    return low * (high / low) ** draw


class RandomRamp(AttackFamily):
    """A ramp of 0.2 to 5 m/s; the rate is uniform in its logarithm, so that slow ones are as frequent as fast ones."""

    kind = "random-ramp"

    def _shape(self, draws: Floats, since: Floats, duration: Floats) -> Floats:
        return _along(_log_between(draws[:, 0], *RAMP_RATE)[:, None] * since)


class RandomJump(AttackFamily):
    """A jump of 5 to 50 m that is held."""

    kind = "random-jump"

    def _shape(self, draws: Floats, since: Floats, duration: Floats) -> Floats:
        return _along(np.broadcast_to(_between(draws[:, 0], *JUMP_SIZE)[:, None], since.shape).copy())


class RandomGrowth(AttackFamily):
    """Growth to 10 to 200 m in 10 to 80 s, then a run in parallel: the shape of FOI-R-5687's azimuth attack.

    The speed of the offset rises and falls as a triangle, like an azimuth error that grows and decays evenly.
    """

    kind = "random-growth"

    def _shape(self, draws: Floats, since: Floats, duration: Floats) -> Floats:
        size, growth = _log_between(draws[:, 0], *GROWTH_SIZE), _between(draws[:, 1], *GROWTH_TIME)
        x = np.minimum(since / growth[:, None], 1.0)
        return _along(size[:, None] * np.where(x < 0.5, 2.0 * x**2, 1.0 - 2.0 * (1.0 - x) ** 2))


class TwoStageRamp(AttackFamily):
    """A slow ramp, 0.1 to 0.8 m/s for 15 to 50 s, then a fast one, 1 to 6 m/s."""

    kind = "two-stage-ramp"

    def _shape(self, draws: Floats, since: Floats, duration: Floats) -> Floats:
        slow, fast = _between(draws[:, 0], *SLOW_RATE)[:, None], _between(draws[:, 1], *FAST_RATE)[:, None]
        change = _between(draws[:, 2], *CHANGE_TIME)[:, None]
        return _along(slow * np.minimum(since, change) + fast * np.maximum(since - change, 0.0))


class SignChangingRamp(AttackFamily):
    """A ramp of 0.3 to 3 m/s that turns back after 10 to 40 s, through zero to the other side."""

    kind = "sign-changing-ramp"

    def _shape(self, draws: Floats, since: Floats, duration: Floats) -> Floats:
        rate, turn = _between(draws[:, 0], *TURNING_RATE)[:, None], _between(draws[:, 1], *TURNING_TIME)[:, None]
        return _along(rate * np.where(since < turn, since, 2.0 * turn - since))


class DecayingJump(AttackFamily):
    """A jump of 10 to 80 m that decays exponentially in 10 to 40 s, as if the receiver came back to the truth."""

    kind = "decaying-jump"

    def _shape(self, draws: Floats, since: Floats, duration: Floats) -> Floats:
        size, time = _between(draws[:, 0], *DECAYING_SIZE)[:, None], _between(draws[:, 1], *DECAY_TIME)[:, None]
        return _along(size * np.exp(-since / time))


class ClimbingSpiral(AttackFamily):
    """A ramp of 0.3 to 3 m/s whose heading turns at up to 3 deg/s, while the height leaves at up to 1 m/s."""

    kind = "climbing-spiral"

    def _shape(self, draws: Floats, since: Floats, duration: Floats) -> Floats:
        rate = _log_between(draws[:, 0], *SPIRAL_RATE)[:, None]
        turn = np.radians(_between(draws[:, 1], *SPIRAL_TURN))[:, None]
        turn = np.where(np.abs(turn) < 1e-6, 1e-6, turn)
        climb = _between(draws[:, 2], *SPIRAL_CLIMB)[:, None]
        along, right = rate * np.sin(turn * since) / turn, rate * (1.0 - np.cos(turn * since)) / turn
        return np.stack([along, right, climb * since], axis=2)
