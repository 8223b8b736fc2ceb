"""Guidance: a vehicle that is steered by its own estimate leaves its path by about minus the estimate's error.

The autopilot holds the estimate on the path. So the true position leaves it by minus the error, as fast as the closed
loop of vehicle and autopilot allows: to first order d' = -(d + e) / T. ``docs/reference/guidance.md`` derives why this
changes neither innovations nor errors.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.linalg import expm

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.geodesy import horizontal
from spoofgym.specification import build, nest, spell, unnest
from spoofgym.timeline import Timeline
from spoofgym.travel import lateral

AXES = ("lateral", "horizontal")
"""In which the vehicle is steered by the estimate: across its direction of travel alone, or east and north."""
TIMES = (1e-3, 1e6)
"""Least and largest time constant, s."""
DAMPINGS = (1e-3, 1e3)
WIDEST = 1e6
"""Of a corridor, m."""


@dataclass(frozen=True)
class Guidance(ABC):
    """How the deviation d from the path follows the error e of the estimate, along each axis by itself.

    Args:
        time: T of the closed loop, s.
        axes: ``lateral``, ``horizontal``; None = as the scenario says.
        corridor: its whole width, m: the vehicle may leave its path by half of it to each side; None = as the scenario
            says.

    Raises:
        ValueError: a number out of range, or unknown axes.
    """

    kind: ClassVar[str]

    time: float
    axes: str | None = None
    corridor: float | None = None

    def __post_init__(self) -> None:
        owner = f"guidance {self.kind!r}"
        object.__setattr__(self, "time", validation.between(owner, "time", self.time, *TIMES))
        if self.axes is not None:
            validation.one_of(owner, "axes", self.axes, AXES)
        if self.corridor is not None:
            object.__setattr__(self, "corridor", validation.above(owner, "corridor", self.corridor, largest=WIDEST))

    @property
    def name(self) -> str:
        """The specification that builds it."""
        return spell(self.kind, self.time, axes=self.axes, corridor=self.corridor)

    @property
    def nested(self) -> str:
        """The specification as the value of a scenario's option."""
        return nest(self.name)

    @property
    def width(self) -> float:
        """Of the corridor, m.

        Raises:
            ValueError: nobody has said it.
        """
        if self.corridor is None:
            raise ValueError(f"guidance {self.name!r}: corridor must be given")
        return self.corridor

    @property
    @abstractmethod
    def dynamics(self) -> Floats:
        """F of x' = F x + g e, x = (d, and its rates where the order is above one), followed by g, (n, n + 1)."""

    def transition(self, interval: Floats) -> Floats:
        """What x becomes over intervals in which the error runs along a straight line, exactly.

        Args:
            interval: (K,), s.

        Returns:
            Factors of x, of the error at the beginning and of its rate, (K, n, n + 2).
        """
        order = len(self.dynamics)
        whole = np.zeros((order + 2, order + 2))
        whole[:order, : order + 1] = self.dynamics
        whole[order, order + 1] = 1.0
        different, place = np.unique(interval, return_inverse=True)
        return np.asarray(expm(different[:, None, None] * whole)[place, :order])


@dataclass(frozen=True)
class FirstOrder(Guidance):
    """The deviation follows minus the error with one time constant: d' = -(d + e) / T.

    Args:
        time: T, s.
        axes: ``lateral``, ``horizontal``; None = as the scenario says.
        corridor: its whole width, m; None = as the scenario says.
    """

    kind = "first-order"

    @property
    def dynamics(self) -> Floats:
        """Of x = d, (1, 2)."""
        return np.array([[-1.0, -1.0]]) / self.time


@dataclass(frozen=True)
class SecondOrder(Guidance):
    """The deviation follows minus the error as an oscillator: d'' = -(d + e) / T² - 2 D d' / T.

    Args:
        time: T, s: 1 / the undamped angular frequency.
        axes: ``lateral``, ``horizontal``; None = as the scenario says.
        corridor: its whole width, m; None = as the scenario says.
        damping: D.
    """

    kind = "second-order"

    damping: float = 0.7

    def __post_init__(self) -> None:
        super().__post_init__()
        damping = validation.between(f"guidance {self.kind!r}", "damping", self.damping, *DAMPINGS)
        object.__setattr__(self, "damping", damping)

    @property
    def name(self) -> str:
        """The specification that builds it."""
        damping = None if self.damping == type(self).damping else self.damping
        return spell(self.kind, self.time, axes=self.axes, corridor=self.corridor, damping=damping)

    @property
    def dynamics(self) -> Floats:
        """Of x = (d, d'), (2, 3)."""
        stiffness = 1.0 / self.time**2
        return np.array([[0.0, 1.0, 0.0], [-stiffness, -2.0 * self.damping / self.time, -stiffness]])


GUIDANCES: dict[str, Callable[..., Guidance]] = {FirstOrder.kind: FirstOrder, SecondOrder.kind: SecondOrder}


def make_guidance(text: str, axes: str, corridors: Mapping[str, float]) -> Guidance:
    """The guidance that a scenario's option spells.

    Args:
        text: ``first-order:T`` or ``second-order:T/damping=D``, options after a slash.
        axes: of the scenario's vehicle, where the text names none.
        corridors: width by axes, m, where the text names none.

    Raises:
        ValueError: an unknown kind or option, or a value that is not valid.
    """
    made = build(unnest(text), GUIDANCES, "guidance")
    axes = made.axes or axes
    return replace(made, axes=axes, corridor=made.corridor or corridors[axes])


class Steering:
    """N vehicles that are steered by their own estimates: how far each is from its path.

    Between two epochs the error of the estimate runs along a straight line, from what it is when the first fix has been
    resolved to what the filter has made of it when the second one comes. Every game begins on the path.

    Attributes:
        deviation: true position minus that on the path, (N, 3), m ENU; its height is not steered.
        largest: distance from the path since the game began, (N,), m.
        time_outside: spent outside the corridor since the game began, (N,), s.
    """

    def __init__(self, guidance: Guidance, timeline: Timeline, velocity: Floats, num_runs: int) -> None:
        """Put the vehicles on their path.

        Args:
            guidance: with its axes and corridor.
            timeline: of the game.
            velocity: on the path at the moments of the timeline's steps, (M+1, 3), ENU, m/s.
            num_runs: N.

        Raises:
            ValueError: the vehicle has no direction of travel.
        """
        self._half = 0.5 * guidance.width
        self._axes = _unit_vectors(guidance, timeline, velocity)
        self._intervals = timeline.intervals
        self._transition = guidance.transition(self._intervals)
        self._state = np.zeros((num_runs, self._axes.shape[1], self._transition.shape[1]))
        self.deviation = np.zeros((num_runs, 3))
        self.largest = np.zeros(num_runs)
        self.time_outside = np.zeros(num_runs)

    def begin(self, runs: Runs) -> None:
        """Put some vehicles on their path: their games begin."""
        for series in (self._state, self.deviation, self.largest, self.time_outside):
            series[runs] = 0.0

    def leave(self, error: Floats) -> None:
        """Drive on from an epoch whose fix has been resolved: ``error`` of the estimate then, (N, 3), m ENU."""
        self._resolved = error

    def arrive(self, epoch: Runs, error: Floats) -> None:
        """Come to the next epoch.

        Args:
            epoch: that comes, (N,); games whose epoch 0 comes begin.
            error: of the estimate as the filter has carried it here, (N, 3), m ENU.
        """
        last = np.maximum(epoch, 1) - 1
        interval = self._intervals[last]
        start, end = _along(self._axes[last], self._resolved), _along(self._axes[last + 1], error)
        inputs = np.stack([start, (end - start) / interval[:, None]], axis=2)
        parts = np.concatenate([self._state, inputs], axis=2)[:, :, None, :] * self._transition[last][:, None]
        self._state = np.add.reduce(parts, axis=3)
        self.deviation = np.add.reduce(self._state[:, :, :1] * self._axes[last + 1], axis=1)
        distance = self.distance
        self.largest = np.maximum(self.largest, distance)
        self.time_outside = self.time_outside + np.where(distance > self._half, interval, 0.0)
        self.begin(np.flatnonzero(epoch <= 0))

    @property
    def distance(self) -> Floats:
        """From the path, (N,), m."""
        return horizontal(self.deviation)


def _unit_vectors(guidance: Guidance, timeline: Timeline, velocity: Floats) -> Floats:
    """The axes in which vehicles are steered at each epoch, (K+1, A, 3), ENU.

    Raises:
        ValueError: the vehicle has no direction of travel.
    """
    if guidance.axes == "horizontal":
        return np.broadcast_to(np.eye(3)[:2], (timeline.num_epochs + 1, 2, 3))
    try:
        across = lateral(velocity, "right")
    except ValueError as error:
        raise ValueError(f"guidance {guidance.name!r}: {error}; axes=horizontal needs none") from error
    return across[timeline.steps[2]][:, None]


def _along(axes: Floats, vectors: Floats) -> Floats:
    """Components of horizontal vectors (N, 3) along axes (N, A, 3), (N, A)."""
    return np.asarray(axes[:, :, 0] * vectors[:, None, 0] + axes[:, :, 1] * vectors[:, None, 1])
