"""An attack whose spoofer knows only roughly where the vehicle is; it wraps another attack."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.attacks.around import AroundAttack
from spoofgym.attacks.base import Attack
from spoofgym.geodesy import AXES
from spoofgym.navigation.interface import Clock
from spoofgym.sensors.tracking import draw_tracking_error
from spoofgym.specification import nest, spell
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline

SIGMA = 0.3
MOST_SIGMA = 1e6
"""m."""


class TrackingError(AroundAttack):
    """An attack, and the error with which its spoofer tracks the vehicle.

    A spoofer places the receiver relative to where it believes the vehicle to be, so that its error adds to the offset
    on every axis for as long as the receiver follows it. A receiver of ranges sees it projected onto every line of
    sight. The error is white or first-order Gauss-Markov and drawn from the run's stream "tracking", a block per
    episode: the attack itself stays as it is without.

    Kujur 2024 has the error along one direction alone, ``axis``: of the three axes that one then errs as it would
    beside the others.

    Args:
        attack: the attack.
        sigma: of the error, per axis, m.
        time: its correlation time, s; 0 = white.
        axis: ``east``, ``north`` or ``up``, on which alone the spoofer errs; None = on all three.

    Raises:
        ValueError: sigma or time is negative or not finite, axis is none of these, or the attack has a tracking error
            already.
    """

    kind = "tracking-error"

    def __init__(self, attack: Attack, sigma: float = SIGMA, time: float = 0.0, axis: str | None = None) -> None:
        super().__init__(attack)
        if attack.has_tracking_error:
            raise ValueError(f"tracking-error: attack must have no tracking error of its own, got {attack.name!r}")
        self.has_tracking_error = True
        self.sigma = validation.non_negative("tracking-error", "sigma", sigma, MOST_SIGMA)
        self.time = validation.zero_or_above("tracking-error", "time", time)
        self.axis = None if axis is None else validation.one_of("tracking-error", "axis", axis, AXES)
        self._errs = np.array([axis in (None, name) for name in AXES])

    @property
    def name(self) -> str:
        """The specification that builds this attack, where one builds the attack inside."""
        sigma = None if self.sigma == SIGMA else self.sigma
        return spell("tracking-error", nest(self.attack.name), sigma=sigma, time=self.time or None, axis=self.axis)

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Fit the attack to a game and allocate the errors of its episodes.

        Raises:
            ValueError: the attack inside does not fit the game.
        """
        super().bind(timeline, num_runs)
        self._errors = np.zeros((num_runs, timeline.num_epochs + 1, 3))
        self._runs = np.arange(num_runs)

    def reset(self, runs: Runs, streams: RunStreams) -> None:
        """Start new episodes of the attack inside, and draw their errors."""
        super().reset(runs, streams)
        shape = self._errors.shape[1:]
        for run in runs.tolist():
            stream = streams(run, "tracking")
            error = draw_tracking_error(stream, shape, self.sigma, self.time, self._timeline.intervals)
            self._errors[run] = np.where(self._errs, error, 0.0)

    def offset(self, clock: Clock) -> Floats:
        """The offset of the attack inside, and the error where it is active, (N, 3), m ENU."""
        error = self._errors[self._runs, np.maximum(clock.index, 0)]
        return self.attack.offset(clock) + np.where(self.active(clock)[:, None], error, 0.0)
