"""Another attack by a spoofer who knows only roughly where the vehicle is."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.attacks.base import Attack
from spoofgym.navigation.interface import Clock, Timeline
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.sensors.tracking import draw_tracking_error
from spoofgym.specification import nest, spell
from spoofgym.streams import RunStreams

SIGMA = 0.3


class TrackingError(Attack):
    """An attack, and the error with which its spoofer tracks the vehicle.

    A spoofer places the receiver relative to where it believes the vehicle to be, so that its error adds to the offset
    on every axis for as long as the receiver follows it. The error is white or first-order Gauss-Markov and drawn from
    the run's stream "tracking", a block per episode: the attack itself stays as it is without.

    Args:
        attack: the attack.
        sigma: of the error, per axis, m.
        time: its correlation time, s; 0 = white.

    Raises:
        ValueError: sigma or time is negative or not finite, or the attack has a tracking error already.
    """

    def __init__(self, attack: Attack, sigma: float = SIGMA, time: float = 0.0) -> None:
        if isinstance(attack, TrackingError):
            raise ValueError(f"tracking-error: attack must have no tracking error of its own, got {attack.name!r}")
        self.attack = attack
        self.sigma = validation.non_negative("tracking-error", "sigma", sigma)
        self.time = validation.non_negative("tracking-error", "time", time)
        self.onset = attack.onset
        self.needs_model = attack.needs_model
        self.needs_velocity = attack.needs_velocity

    @property
    def name(self) -> str:
        """The specification that builds this attack, where one builds the attack inside."""
        sigma = None if self.sigma == SIGMA else self.sigma
        return spell("tracking-error", nest(self.attack.name), sigma=sigma, time=self.time or None)

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Fit the attack to a game and allocate the errors of its episodes.

        Raises:
            ValueError: the attack inside does not fit the game.
        """
        self.attack.bind(timeline, num_runs)
        super().bind(timeline, num_runs)
        self._errors = np.zeros((num_runs, timeline.num_epochs + 1, 3))
        self._runs = np.arange(num_runs)

    def follow(self, velocity: Floats) -> None:
        """Tell the attack inside the vehicle's true velocity at epochs 0..K, (K+1, 3), ENU, m/s."""
        self.attack.follow(velocity)

    def study(self, model: LinearModel) -> None:
        """Show the attack inside the victim's linear model."""
        self.attack.study(model)

    def reset(self, runs: Runs, streams: RunStreams) -> None:
        """Start new episodes of the attack inside, and draw their errors."""
        self.attack.reset(runs, streams)
        shape = self._errors.shape[1:]
        for run in runs.tolist():
            stream = streams(run, "tracking")
            self._errors[run] = draw_tracking_error(stream, shape, self.sigma, self.time, self._timeline.interval)

    def active(self, clock: Clock) -> Flags:
        """Whether the receiver follows the spoofer, (N,)."""
        return self.attack.active(clock)

    def offset(self, clock: Clock) -> Floats:
        """The offset of the attack inside, and the error where it is active, (N, 3), m ENU."""
        error = self._errors[self._runs, np.maximum(clock.index, 0)]
        return self.attack.offset(clock) + np.where(self.active(clock)[:, None], error, 0.0)

    def velocity(self, clock: Clock, rate: Floats) -> Floats:
        """What the attack inside adds to the velocity of the fix at the rate of the whole offset, (N, 3), m/s ENU."""
        return self.attack.velocity(clock, rate)
