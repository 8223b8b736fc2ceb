"""Confounders: what happens to a receiver without a spoofer, and looks like spoofing."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats, Runs
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline

DRAWS, RARE_DRAWS = 8, 16
"""Uniform numbers of an episode for outages and multipath, and for rarer events, whatever becomes of them."""
MILLISECOND = 299_792.458
"""By which receivers set their clocks, m."""


@dataclass(frozen=True, kw_only=True)
class Disturbances:
    """How often and how strongly a receiver is disturbed; each kind comes at most once in an episode.

    Attributes:
        outage_share: of episodes with an outage.
        outage_duration: shortest and longest, s; uniform.
        multipath_share: of episodes with a burst of multipath.
        multipath_duration: shortest and longest, s; uniform.
        multipath_sigma: least and greatest added white noise of the position per axis, m; uniform per burst.
        drift_share: of episodes in which the frame of the positions drifts, as with other corrections.
        drift_rate: slowest and fastest, m/s; uniform, in a uniform horizontal direction. A report has 5 m/s, and an
            innovation of about 230 m after 34 s, which is 6.8 m/s (PX4-Autopilot, issue 27340).
        drift_duration: shortest and longest, s; uniform. The position stays where the drift has ended, to the end of
            the episode. Velocities stay true.
        jamming_share: of episodes with an outage, a recovery and a second outage, as iNav (issue 10588) and ArduPilot
            (issue 4186) have had from jammers.
        jamming_duration: shortest and longest of each of the two outages, s; uniform, drawn twice.
        jamming_gap: shortest and longest time between them, s; uniform.
        clock_step_share: of episodes in which the receiver sets its clock by a millisecond, forward or back; only a
            filter on ranges sees it, as a step of all codes.
    """

    outage_share: float = 0.15
    outage_duration: tuple[float, float] = (10.0, 40.0)
    multipath_share: float = 0.15
    multipath_duration: tuple[float, float] = (10.0, 20.0)
    multipath_sigma: tuple[float, float] = (3.0, 8.0)
    drift_share: float = 0.0
    drift_rate: tuple[float, float] = (5.0, 6.8)
    drift_duration: tuple[float, float] = (34.0, 34.0)
    jamming_share: float = 0.0
    jamming_duration: tuple[float, float] = (5.0, 20.0)
    jamming_gap: tuple[float, float] = (3.0, 15.0)
    clock_step_share: float = 0.0

    def __post_init__(self) -> None:
        for item in fields(self):
            check = validation.share if item.name.endswith("_share") else validation.span
            check("disturbances", item.name, getattr(self, item.name))


class Confounders:
    """The disturbances of N runs, drawn anew at every episode.

    Attributes:
        available: whether there is a fix at epochs 0..K, (N, K+1); always at epoch 0.
        multipath: whether a burst is in force, (N, K+1).
        sigma: of its noise per axis, (N, K+1), m; 0 where there is none.
        drifting: whether the frame of the positions drifts or has drifted, (N, K+1).
        noise: of the bursts and the drift, in the position of a fix, (N, K+1, 3), m.
        clock: by how much the receiver has set its clock, (N, K+1), m.
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
        self.drifting = np.zeros((num_runs, epochs), dtype=bool)
        self.noise: Floats = np.zeros((num_runs, epochs, 3))
        self.clock: Floats = np.zeros((num_runs, epochs))

    def reset(self, runs: Runs, streams: RunStreams) -> None:
        """Draw the disturbances of new episodes: blocks of a fixed size, whatever becomes of them."""
        self.available[runs], self.multipath[runs] = True, False
        self.sigma[runs], self.noise[runs], self.clock[runs], self.drifting[runs] = 0.0, 0.0, 0.0, False
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
            self._rare(run, streams(run, "rare events").random(RARE_DRAWS))

    def _rare(self, run: int, draws: Floats) -> None:
        """Events that come only where they are asked for, of a stream of their own: the others stay as they are."""
        given = self.disturbances
        if draws[0] < given.drift_share:
            self._drift(run, draws[1:5])
        if draws[5] < given.jamming_share:
            self._jam(run, draws[6:10])
        if draws[10] < given.clock_step_share:
            first = self._begin(draws[11])
            self.clock[run, first:] = MILLISECOND if draws[12] < 0.5 else -MILLISECOND

    def _drift(self, run: int, draws: Floats) -> None:
        """The frame moves evenly away from an epoch on, s = v min(t, T) h, and stays."""
        times, first = self._timeline.times, self._begin(draws[0])
        rate = _between(draws[1], self.disturbances.drift_rate)
        duration = _between(draws[2], self.disturbances.drift_duration)
        angle = 2.0 * np.pi * draws[3]
        moved = rate * np.minimum(times[first:] - times[first - 1], duration)
        self.noise[run, first:] += moved[:, None] * np.array([np.sin(angle), np.cos(angle), 0.0])
        self.drifting[run, first:] = True

    def _jam(self, run: int, draws: Floats) -> None:
        """No fixes, fixes again, no fixes."""
        given = self.disturbances
        once = self._stretch(draws[0], draws[1], given.jamming_duration)
        self.available[run, once] = False
        again = self._timeline.times[once.start] + _between(draws[1], given.jamming_duration)
        again += _between(draws[2], given.jamming_gap)
        first = int(np.searchsorted(self._timeline.times, again - 0.5 * self._timeline.interval))
        if first < len(self._timeline.times):
            self.available[run, self._lasting(first, _between(draws[3], given.jamming_duration))] = False

    def _begin(self, place: float) -> int:
        """Any epoch after epoch 0."""
        return 1 + int(place * self._timeline.num_epochs)

    def _stretch(self, place: float, length: float, duration: tuple[float, float]) -> slice:
        """Epochs of a disturbance that begins at any of them after epoch 0 and may last beyond the end."""
        return self._lasting(self._begin(place), _between(length, duration))

    def _lasting(self, first: int, seconds: float) -> slice:
        """Epochs from one on for so many seconds, at least one."""
        times, interval = self._timeline.times, self._timeline.interval
        last = int(np.searchsorted(times, times[first] + seconds - 0.5 * interval))
        return slice(first, max(first + 1, last))


def _between(share: float, span: tuple[float, float]) -> float:
    """The value at a share of the way through a span."""
    return span[0] + share * (span[1] - span[0])
