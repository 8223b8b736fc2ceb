"""Whole games of many runs, and what came of each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spoofgym.arrays import Floats, Runs
from spoofgym.attacks.base import Attack
from spoofgym.detectors.base import Detector, require_threshold
from spoofgym.evaluation.departures import Departures, departures_of, joined
from spoofgym.evaluation.episodes import SimulationBatch, play
from spoofgym.geodesy import horizontal
from spoofgym.scenario import Scenario
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline

BATCH = 2000
NEVER = -1


@dataclass(frozen=True)
class Episodes:
    """What came of n games in which every fix was used.

    Alarms before the attack are false ones and do not count; where there is no attack all do.

    Attributes:
        alarm_epoch: of the first alarm, (n,); -1 = never.
        alarm_error: horizontal error of the estimate at the first alarm, (n,), m; of no meaning where there was none.
        final_error: horizontal error after the last fix was used, (n,), m.
        onset_epoch: the last one before the attack, (n,); 0 where there is none.
        timeline: of the games.
        departures: of the vehicles until the first alarm, or to the end; None where they keep their paths.
    """

    alarm_epoch: Runs
    alarm_error: Floats
    final_error: Floats
    onset_epoch: Runs
    timeline: Timeline
    departures: Departures | None = None

    @property
    def detected(self) -> NDArray[np.bool_]:
        """Whether any detector alarmed, (n,)."""
        return self.alarm_epoch != NEVER


@dataclass(frozen=True)
class WatchedEpisodes:
    """What D detectors, each by itself, made of the same n games in which every fix was used.

    Attributes:
        alarm_epoch: of each detector's first alarm, (D, n); -1 = never.
        alarm_error: horizontal error of the estimate then, (D, n), m; of no meaning where there was none.
        peak: highest statistic over its threshold from the attack on, (D, n); in epochs 1..K where there is none.
        final_error: horizontal error after the last fix was used, (n,), m.
        onset_epoch: the last one before the attack, (n,); 0 where there is none.
        timeline: of the games.
        alarm_departures: of the vehicles until each detector's first alarm, (D, n); of no meaning where there was none,
            None where they keep their paths.
        departures: to the end, (n,); None where they keep their paths.
    """

    alarm_epoch: Runs
    alarm_error: Floats
    peak: Floats
    final_error: Floats
    onset_epoch: Runs
    timeline: Timeline
    alarm_departures: Departures | None = None
    departures: Departures | None = None

    def of(self, detector: int) -> Episodes:
        """As one detector, by its place, saw them."""
        return self._seen(detector)

    def together(self) -> Episodes:
        """As all detectors at once: the first alarm of any."""
        n = len(self.final_error)
        if not len(self.alarm_epoch):
            never = np.full(n, NEVER)
            return Episodes(never, np.zeros(n), self.final_error, self.onset_epoch, self.timeline, self.departures)
        epoch = np.where(self.alarm_epoch == NEVER, np.iinfo(np.int64).max, self.alarm_epoch)
        return self._seen((epoch.argmin(axis=0), np.arange(n)))

    def _seen(self, place: Any) -> Episodes:
        """The games as the detectors at a place, one for all or one for each, saw them."""
        alarm_epoch, alarm_error, departures = self.alarm_epoch[place], self.alarm_error[place], self.departures
        if departures is not None and self.alarm_departures is not None:
            departures = self.alarm_departures.of(place).where(alarm_epoch != NEVER, departures)
        return Episodes(alarm_epoch, alarm_error, self.final_error, self.onset_epoch, self.timeline, departures)


class _Watch:
    """First alarms, the errors then, and the highest statistic over its threshold, of each detector and run, (D, n).

    Where an attack begins, what was seen before is forgotten.
    """

    def __init__(self, batch: SimulationBatch) -> None:
        self._batch, self._simulation = batch, batch.simulation
        self._thresholds = {name: require_threshold(part) for name, part in self._simulation.detectors.items()}
        detectors, runs = len(self._thresholds), self._simulation.num_runs
        self._alarm_epoch = np.full((detectors, runs), NEVER)
        self._alarm_error = np.zeros((detectors, runs))
        self._peak = np.full((detectors, runs), -np.inf)
        now = departures_of(self._simulation)
        shape = np.zeros((detectors, runs))
        self._departures = None if now is None else Departures(shape, shape.copy(), now.corridor)
        self._begun, self._onset_epoch = np.zeros(runs, dtype=bool), np.zeros(runs, dtype=np.int64)

    def before(self, epoch: int) -> None:
        """Note nothing: an epoch is seen when it is observed."""

    def after(self, epoch: int) -> None:
        """See the epoch that comes after ``epoch``: it has been observed."""
        simulation = self._simulation
        begins = ~self._begun & simulation.attacked
        if begins.any():
            self._onset_epoch[begins] = epoch
            self._begun |= begins
            self._alarm_epoch[:, begins] = NEVER
            self._peak[:, begins] = -np.inf
        error = horizontal(simulation.error)
        for place, (name, threshold) in enumerate(self._thresholds.items()):
            self._see(place, epoch + 1, simulation.epoch.statistics[name] / threshold, error)

    def _see(self, place: int, epoch: int, ratio: Floats, error: Floats) -> None:
        """Take one detector's epoch: its statistic over its threshold, and the errors, (n,)."""
        np.maximum(self._peak[place], ratio, out=self._peak[place])
        fresh = (ratio > 1.0) & (self._alarm_epoch[place] == NEVER)
        self._alarm_epoch[place, fresh] = epoch
        self._alarm_error[place, fresh] = error[fresh]
        now = departures_of(self._simulation)
        if self._departures is not None and now is not None:
            self._departures.largest[place, fresh] = now.largest[fresh]
            self._departures.time_outside[place, fresh] = now.time_outside[fresh]

    def result(self) -> WatchedEpisodes:
        """All games of the batch, after their last fix was used."""
        self._batch.resolve()
        return WatchedEpisodes(
            self._alarm_epoch,
            self._alarm_error,
            self._peak,
            self._batch.error.copy(),
            self._onset_epoch,
            self._simulation.scenario.timeline,
            self._departures,
            departures_of(self._simulation),
        )


def _join(parts: list[WatchedEpisodes]) -> WatchedEpisodes:
    return WatchedEpisodes(
        np.concatenate([part.alarm_epoch for part in parts], axis=1),
        np.concatenate([part.alarm_error for part in parts], axis=1),
        np.concatenate([part.peak for part in parts], axis=1),
        np.concatenate([part.final_error for part in parts]),
        np.concatenate([part.onset_epoch for part in parts]),
        parts[0].timeline,
        joined([part.alarm_departures for part in parts], axis=1),
        joined([part.departures for part in parts]),
    )


def watch_attack(
    scenario: Scenario,
    attack: Attack,
    detectors: list[Detector],
    episodes: int,
    seed: int,
    *,
    fidelity: str = "linear",
    threads: int = 1,
) -> WatchedEpisodes:
    """Games of an attack under the eyes of several detectors; game i is seeded ``seed + i``, whatever the attack.

    Raises:
        ValueError: no episodes, or what `Simulation` refuses.
    """

    def make(streams: RunStreams) -> SimulationBatch:
        simulation = Simulation(
            scenario,
            attack,
            detectors,
            None,
            len(streams),
            fidelity=fidelity,
            threads=threads,
            streams=streams,
        )
        return SimulationBatch(simulation)

    return _join(play(make, _Watch, episodes, seed, BATCH))
