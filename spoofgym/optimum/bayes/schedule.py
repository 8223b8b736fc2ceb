"""When attacks of a population begin and end: exact probabilities of what `AttackFamily` draws."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.attacks.families import BEFORE_MANOEUVRE, DURATION, LEAST_LEFT, MEAN_WAIT, TO_THE_END
from spoofgym.timeline import Timeline


class Schedule(NamedTuple):
    """Probabilities of an attack's onset and length, in epochs.

    Attributes:
        onset: that it begins at epoch k, so that its first offset is at epoch k + 1, (K+1,).
        lasts: that it has an offset d epochs after the onset, if the game lasts so long, (K+2,).
        ends: that d epochs after the onset is the first time without one, (K+2,).
    """

    onset: Floats
    lasts: Floats
    ends: Floats


def schedule(timeline: Timeline, manoeuvres: tuple[float, ...], share: float) -> Schedule:
    """The schedule of random attacks.

    Args:
        timeline: of the game.
        manoeuvres: times at which the vehicle begins to change its velocity, s.
        share: of the attacks that begin in view of one.
    """
    return Schedule(_onset(timeline, manoeuvres, share), *_length(timeline))


def _onset(timeline: Timeline, manoeuvres: tuple[float, ...], share: float) -> Floats:
    """A geometric wait that is cut at the latest epoch, or up to 10 s before a manoeuvre, (K+1,)."""
    interval = timeline.interval
    latest = int((timeline.end - timeline.start - LEAST_LEFT) / interval)
    result = np.zeros(timeline.num_epochs + 1)
    waits = (1.0 - interval / MEAN_WAIT) ** np.arange(latest + 1)
    result[: latest + 1] = waits / waits.sum()
    near = [time for time in manoeuvres if time <= timeline.end - LEAST_LEFT]
    if near:
        result *= 1.0 - share
        for time in near:
            # the floor of a number that is uniform between these two, at least 0
            last = (time - timeline.start) / interval
            edges = np.clip(np.arange(len(result) + 1.0), last - BEFORE_MANOEUVRE / interval, last)
            edges[0] = last - BEFORE_MANOEUVRE / interval
            result += share / len(near) * np.diff(edges) * interval / BEFORE_MANOEUVRE
    return result


def _length(timeline: Timeline) -> tuple[Floats, Floats]:
    """Uniform from the shortest to the longest, or to the end of the game; (K+2,) each."""
    since = timeline.interval * np.arange(timeline.num_epochs + 2)
    shortest, longest = DURATION
    ended = np.clip((since - 1e-9 - shortest) / (longest - shortest), 0.0, 1.0)
    lasts = 1.0 - (1.0 - TO_THE_END) * ended
    return lasts, np.append(0.0, lasts[:-1] - lasts[1:])
