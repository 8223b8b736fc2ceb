"""The azimuth attack of FOI-R-5687, by our reading of its chapter 4, which is fitted to the report's largest errors.

The velocity is turned in the x-y plane of the earth-fixed frame, which is not horizontal, and keeps its length there.
The printed formula has the length of the whole velocity in that plane; taken literally, it gives largest errors of 10
to 500 m where the report has 5 to 369 m. The spoofed position is the sum of the turned velocities of whole seconds.
This sum is a rectangle rule: where the vehicle itself turns it is off by half a second of the change of velocity, some
10 m in a turn of 60 degrees at 20 m/s. The package's own attacks ``foi-1`` to ``foi-8`` keep that rule, but turn the
velocity in the horizontal plane.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import cumulative_trapezoid

from spoofgym.arrays import Floats
from spoofgym.attacks import make_attack
from spoofgym.attacks.azimuth import DECAY, azimuth_error
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock
from spoofgym.scenario import Scenario
from spoofgym.scenarios.foi_drive import foi_trajectory
from spoofgym.streams import RunStreams
from spoofgym.studies.reproduce.foi_tables import Attacked
from spoofgym.timeline import Timeline

RADIANS, DEGREES = 1.0, 180.0 / math.pi
AGAINST_THE_TURNS = -1.0
"""The drive turns left; the azimuth error turns the velocity right. Only so the largest errors come out."""


def earth_fixed_axes(latitude: float, longitude: float) -> Floats:
    """Columns east, north, up in the earth-fixed frame, (3, 3); rad."""
    sin, cos = math.sin, math.cos
    return np.array(
        [
            [-sin(longitude), -sin(latitude) * cos(longitude), cos(latitude) * cos(longitude)],
            [cos(longitude), -sin(latitude) * sin(longitude), cos(latitude) * sin(longitude)],
            [0.0, cos(latitude), sin(latitude)],
        ]
    )


def fitted_offsets(attack: Attacked, units: float = RADIANS, turn: float = 0.0) -> Floats:
    """Spoofed minus true position at the seconds from the attack's start to just before its end, (n, 3), m ENU.

    Args:
        attack: which.
        units: of the azimuth in a radian, `RADIANS` or `DEGREES`: its growth is not the same in both.
        turn: by which the whole drive is turned to the left, rad: the report does not print its direction.
    """
    truth = foi_trajectory()
    seconds = np.arange(attack.start, attack.end, dtype=np.float64)
    samples = np.round(seconds * truth.rate).astype(int)
    axes = earth_fixed_axes(truth.position[0, 0], truth.position[0, 1])
    left = np.array([[math.cos(turn), -math.sin(turn), 0.0], [math.sin(turn), math.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    velocity = truth.velocity[samples] @ left.T @ axes.T
    # on a flat earth, like the sum of the spoofed velocities: the vehicle goes two kilometres
    steps = cumulative_trapezoid(truth.velocity, truth.time, axis=0, initial=0.0)
    position = (steps[samples] - steps[samples[0]]) @ left.T @ axes.T
    largest = math.radians(attack.azimuth) * units
    error = azimuth_error(seconds - attack.start, largest, attack.growth, DECAY) / units
    plane = (velocity[:, 0] + 1j * velocity[:, 1]) * np.exp(1j * AGAINST_THE_TURNS * error)
    spoofed = np.column_stack([plane.real, plane.imag, velocity[:, 2]])
    spoofed[0] = 0.0  # the first spoofed position is the true one
    return np.asarray((np.cumsum(spoofed, axis=0) - position) @ axes)


def largest_offset(attack: Attacked, units: float, turn: float) -> float:
    """Largest distance between the spoofed and the true position, m."""
    return float(np.linalg.norm(fitted_offsets(attack, units, turn), axis=1).max())


def largest_offset_in_game(number: int, scenario: Scenario) -> float:
    """Largest distance between spoofed and true position by the package's attack ``foi-NUMBER`` on the drive, m."""
    attack = make_attack(f"foi-{number}")
    attack.bind(scenario.timeline, 1)
    attack.follow(scenario.velocity())
    offsets = attack.episode(np.zeros(1, dtype=np.int64), RunStreams.from_seed(0, 1))
    return float(np.linalg.norm(offsets[0], axis=1).max())


class FittedAzimuth(Attack):
    """The attack of one of the report's scenarios, by our reading.

    Args:
        attack: start, end, growth and largest value.
    """

    def __init__(self, attack: Attacked) -> None:
        self.attack = attack
        self.onset = attack.start

    @property
    def name(self) -> str:
        """What it is; no specification builds it."""
        return f"fitted azimuth attack of {self.attack.azimuth:g} degrees"

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Compute the offsets of the game, whose epochs are whole seconds."""
        super().bind(timeline, num_runs)
        self._offsets = np.zeros((timeline.num_epochs + 1, 3))
        offsets = fitted_offsets(self.attack)
        first = round(self.attack.start - timeline.start)
        self._offsets[first : first + len(offsets)] = offsets

    def offset(self, clock: Clock) -> Floats:
        """The same in every run, (N, 3), m ENU."""
        return self._offsets[np.maximum(clock.index, 0)]
