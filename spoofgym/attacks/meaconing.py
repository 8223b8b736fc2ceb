"""Meaconing by delay: the receiver is shown where the vehicle itself was some seconds ago."""

from __future__ import annotations

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.attacks.fixed_offsets import FixedOffsets
from spoofgym.specification import spell
from spoofgym.timeline import Timeline


def path(velocity: Floats, timeline: Timeline, time: Floats) -> Floats:
    """Where the vehicle is at times up to the end of the game, from where it is at epoch 0, (n, 3), m ENU.

    Its velocity runs straight between the moments of the timeline's steps and is that of epoch 0 before it, so that
    p(t) = p_k + v_k τ + (v_{k+1} - v_k) τ² / 2Δ with τ the time since moment k.

    Args:
        velocity: at these moments, (M+1, 3), ENU, m/s.
        timeline: of the game.
        time: scenario times, (n,), s.
    """
    moments, lengths, _ = timeline.steps
    steps = 0.5 * lengths[:, None] * (velocity[1:] + velocity[:-1])
    position = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    before = np.clip(np.searchsorted(moments, time, side="right") - 1, 0, len(lengths) - 1)
    into = (time - moments[before])[:, None]
    bend = 0.5 * (velocity[before + 1] - velocity[before]) * np.maximum(into, 0.0) ** 2 / lengths[before, None]
    return position[before] + velocity[before] * into + bend


class Meaconing(FixedOffsets):
    """What the vehicle itself received ``delay`` seconds ago, recorded and replayed: s(t) = p(t - delay) - p(t).

    All three axes are shifted, backward along the vehicle's own track, by the distance that it goes in the delay: an
    attack without any knowledge of receiver or filter. A meaconer with a fixed antenna is another attack: it would show
    the receiver the position of that antenna. A replay also brings a clock error, which is not part of a fix. The
    track is the integral of the true velocity; before the game it goes on straight backward.

    Args:
        delay: s.
        ramp_up: time after the onset in which the delay grows evenly from zero to its value, s; 0 = at once.
        onset: scenario time, s; None = the start of the game.

    Raises:
        ValueError: a time is negative or not finite.
    """

    def __init__(self, delay: float, ramp_up: float = 0.0, onset: float | None = None) -> None:
        self.delay = validation.non_negative("meaconing", "delay", delay)
        self.ramp_up = validation.zero_or_above("meaconing", "ramp_up", ramp_up)
        self.onset = None if onset is None else validation.time("meaconing", "onset", onset)

    @property
    def name(self) -> str:
        """The specification that builds this attack."""
        return spell("meaconing", self.delay, ramp_up=self.ramp_up or None, onset=self.onset)

    def follow(self, velocity: Floats) -> None:
        """Take the vehicle's true velocity at the moments of the game's steps, (M+1, 3), ENU, m/s."""
        times, since = self._timeline.times, np.maximum(self._since(), 0.0)
        share = np.minimum(since / self.ramp_up, 1.0) if self.ramp_up else np.ones_like(since)
        shown = path(velocity, self._timeline, times - self.delay * share)
        self._lay(shown - path(velocity, self._timeline, times))
