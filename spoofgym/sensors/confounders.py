"""Confounders: outages and bursts of multipath, which look like spoofing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline

DRAWS = 8
"""Uniform numbers of an episode, whatever becomes of them."""


@dataclass(frozen=True, kw_only=True)
class Disturbances:
    """How often and how strongly a receiver is disturbed; each kind comes at most once in an episode.

    Attributes:
        outage_share: of episodes with an outage.
        outage_duration: shortest and longest, s; uniform.
        multipath_share: of episodes with a burst of multipath.
        multipath_duration: shortest and longest, s; uniform.
        multipath_sigma: least and greatest added white noise of the position per axis, m; uniform per burst.
    """

    outage_share: float = 0.15
    outage_duration: tuple[float, float] = (10.0, 40.0)
    multipath_share: float = 0.15
    multipath_duration: tuple[float, float] = (10.0, 20.0)
    multipath_sigma: tuple[float, float] = (3.0, 8.0)

    def __post_init__(self) -> None:
        for name in ("outage_share", "multipath_share"):
            validation.share("disturbances", name, getattr(self, name))
        for name in ("outage_duration", "multipath_duration", "multipath_sigma"):
            validation.span("disturbances", name, getattr(self, name))


class Confounders:
    """The disturbances of N runs, drawn anew at every episode.

    Attributes:
        available: whether there is a fix at epochs 0..K, (N, K+1); always at epoch 0.
        multipath: whether a burst is in force, (N, K+1).
        sigma: of its noise per axis, (N, K+1), m; 0 where there is none.
        noise: of the bursts, in the position of a fix, (N, K+1, 3), m.
    """

    def __init__(self, disturbances: Disturbances) -> None:
        """Keep how often and how strongly."""
        self.disturbances = disturbances

    def bind(self, timeline: Timeline, num_runs: int) -> None:
        """Allocate the episodes of ``num_runs`` runs."""
        epochs = timeline.num_epochs + 1
        self._timeline = timeline
        self.available = np.ones((num_runs, epochs), dtype=bool)
        self.multipath = np.zeros((num_runs, epochs), dtype=bool)
        self.sigma: Floats = np.zeros((num_runs, epochs))
        self.noise: Floats = np.zeros((num_runs, epochs, 3))

    def reset(self, runs: Runs, streams: RunStreams) -> None:
        """Draw the disturbances of new episodes: blocks of a fixed size, whatever becomes of them."""
        self.available[runs], self.multipath[runs] = True, False
        self.sigma[runs], self.noise[runs] = 0.0, 0.0
        given = self.disturbances
        for run in runs.tolist():
            stream = streams(run, "confounders")
            draws, normals = stream.random(DRAWS), stream.standard_normal((self.noise.shape[1], 3))
            if draws[0] < given.outage_share:
                self.available[run, self._stretch(draws[1], draws[2], given.outage_duration)] = False
            if draws[3] < given.multipath_share:
                stretch = self._stretch(draws[4], draws[5], given.multipath_duration)
                low, high = given.multipath_sigma
                sigma = low + draws[6] * (high - low)
                self.multipath[run, stretch], self.sigma[run, stretch] = True, sigma
                self.noise[run, stretch] = sigma * normals[stretch]

    def _stretch(self, place: float, length: float, duration: tuple[float, float]) -> slice:
        """Epochs of a disturbance that begins at any of them after epoch 0 and may last beyond the end."""
        seconds = duration[0] + length * (duration[1] - duration[0])
        times, interval = self._timeline.times, self._timeline.interval
        first = 1 + int(place * self._timeline.num_epochs)
        last = int(np.searchsorted(times, times[first] + seconds - 0.5 * interval))
        return slice(first, max(first + 1, last))
