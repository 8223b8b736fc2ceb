"""Whole games of many runs, and what came of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.attacks.base import Attack
from spoofgym.detectors.base import Detector
from spoofgym.envs.spoofer_game import SpooferGame
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
    """

    alarm_epoch: Runs
    alarm_error: Floats
    final_error: Floats
    onset_epoch: Runs
    timeline: Timeline

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
    """

    alarm_epoch: Runs
    alarm_error: Floats
    peak: Floats
    final_error: Floats
    onset_epoch: Runs
    timeline: Timeline

    def of(self, detector: int) -> Episodes:
        """As one detector, by its place, saw them."""
        alarm_epoch, alarm_error = self.alarm_epoch[detector], self.alarm_error[detector]
        return Episodes(alarm_epoch, alarm_error, self.final_error, self.onset_epoch, self.timeline)

    def together(self) -> Episodes:
        """As all detectors at once: the first alarm of any."""
        n = len(self.final_error)
        if not len(self.alarm_epoch):
            return Episodes(np.full(n, NEVER), np.zeros(n), self.final_error, self.onset_epoch, self.timeline)
        epoch = np.where(self.alarm_epoch == NEVER, np.iinfo(np.int64).max, self.alarm_epoch)
        first, runs = epoch.argmin(axis=0), np.arange(n)
        alarm_epoch, alarm_error = self.alarm_epoch[first, runs], self.alarm_error[first, runs]
        return Episodes(alarm_epoch, alarm_error, self.final_error, self.onset_epoch, self.timeline)


def batches(episodes: int, seed: int, size: int) -> Iterator[tuple[int, int]]:
    """Seed of the first game and number of games of each batch.

    Args:
        episodes: games of all batches.
        seed: of the first game of all.
        size: games of a batch.

    Raises:
        ValueError: no games, or too many, or a seed that is no whole number, 0 or more.
    """
    episodes = validation.runs("evaluation", "episodes", episodes)
    seed = validation.whole("evaluation", "seed", seed, 0, 2**62)
    for first in range(0, episodes, size):
        yield seed + first, min(size, episodes - first)


class _Watch:
    """First alarms, the errors then, and the highest statistic over its threshold, of each detector and run, (D, n)."""

    def __init__(self, detectors: int, runs: int) -> None:
        self.alarm_epoch = np.full((detectors, runs), NEVER)
        self.alarm_error = np.zeros((detectors, runs))
        self.peak = np.full((detectors, runs), -np.inf)

    def forget(self, runs: Flags) -> None:
        """Begin anew with runs, (n,)."""
        self.alarm_epoch[:, runs] = NEVER
        self.peak[:, runs] = -np.inf

    def see(self, place: int, epoch: int, ratio: Floats, error: Floats) -> None:
        """Take one detector's epoch: its statistic over its threshold, and the errors, (n,)."""
        np.maximum(self.peak[place], ratio, out=self.peak[place])
        fresh = (ratio > 1.0) & (self.alarm_epoch[place] == NEVER)
        self.alarm_epoch[place, fresh] = epoch
        self.alarm_error[place, fresh] = error[fresh]


def _play(simulation: Simulation, advance: Callable[[], object]) -> tuple[_Watch, Runs]:
    """Play to the last epoch; ``advance`` resolves the present epoch and observes the next.

    Returns:
        What was seen, from the attack on where there is one, and the last epoch before it, (n,).
    """
    detectors, n = simulation.detectors, simulation.num_runs
    watch = _Watch(len(detectors), n)
    begun, onset_epoch = np.zeros(n, dtype=bool), np.zeros(n, dtype=np.int64)
    for epoch in range(1, simulation.scenario.timeline.num_epochs + 1):
        advance()
        simulation.require_converged()
        begins = ~begun & simulation.attacked
        if begins.any():
            onset_epoch[begins] = epoch - 1
            begun |= begins
            watch.forget(begins)
        error = horizontal(simulation.error)
        for place, (name, detector) in enumerate(detectors.items()):
            assert detector.threshold is not None
            watch.see(place, epoch, simulation.epoch.statistics[name] / detector.threshold, error)
    return watch, onset_epoch


def _watched(simulation: Simulation, watch: _Watch, onset_epoch: Runs, final_error: Floats) -> WatchedEpisodes:
    timeline = simulation.scenario.timeline
    return WatchedEpisodes(watch.alarm_epoch, watch.alarm_error, watch.peak, final_error, onset_epoch, timeline)


def _join(parts: list[WatchedEpisodes]) -> WatchedEpisodes:
    return WatchedEpisodes(
        np.concatenate([part.alarm_epoch for part in parts], axis=1),
        np.concatenate([part.alarm_error for part in parts], axis=1),
        np.concatenate([part.peak for part in parts], axis=1),
        np.concatenate([part.final_error for part in parts]),
        np.concatenate([part.onset_epoch for part in parts]),
        parts[0].timeline,
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
    parts = []
    for first, count in batches(episodes, seed, BATCH):
        simulation = Simulation(
            scenario, attack, detectors, None, count, first, fidelity=fidelity, threads=threads
        )
        simulation.reset()

        def advance(simulation: Simulation = simulation) -> None:
            simulation.resolve()
            simulation.observe()

        watch, onset_epoch = _play(simulation, advance)
        simulation.resolve()
        parts.append(_watched(simulation, watch, onset_epoch, horizontal(simulation.error)))
    return _join(parts)


def play_attack(
    scenario: Scenario,
    attack: Attack,
    detectors: list[Detector],
    episodes: int,
    seed: int,
    *,
    fidelity: str = "linear",
    threads: int = 1,
) -> Episodes:
    """Games of an attack, as all detectors together saw them; arguments and errors as `watch_attack`."""
    return watch_attack(
        scenario, attack, detectors, episodes, seed, fidelity=fidelity, threads=threads
    ).together()


def watch_policy(
    make_game: Callable[[int], SpooferGame],
    act: Callable[[NDArray[np.float32]], NDArray[np.float32]],
    episodes: int,
    seed: int,
) -> WatchedEpisodes:
    """Games of a policy; game i is seeded ``seed + i``, whatever the policy, and meets the noise that an attack would.

    Args:
        make_game: builds a game of that many lanes.
        act: actions for observations (N, D), (N, 3).
        episodes: how many games.
        seed: of game 0.
    """
    parts = []
    for first, count in batches(episodes, seed, BATCH):
        game = make_game(count)
        game.simulation.streams = RunStreams.from_seed(first, count)
        game.reset(np.arange(count))

        def advance(game: SpooferGame = game) -> None:
            game.step(act(game.observation()))

        watch, onset_epoch = _play(game.simulation, advance)
        parts.append(_watched(game.simulation, watch, onset_epoch, game.error.copy()))
    return _join(parts)


def play_policy(
    make_game: Callable[[int], SpooferGame],
    act: Callable[[NDArray[np.float32]], NDArray[np.float32]],
    episodes: int,
    seed: int,
) -> Episodes:
    """Games of a policy, as all detectors together saw them; arguments as `watch_policy`."""
    return watch_policy(make_game, act, episodes, seed).together()
