"""Whole games of many runs, and what came of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spoofgym.arrays import Floats, Runs
from spoofgym.attacks.base import Attack
from spoofgym.detectors.base import Detector
from spoofgym.envs.spoofer_game import SpooferGame
from spoofgym.scenario import Scenario
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams

BATCH = 2000
NEVER = -1


@dataclass(frozen=True)
class Episodes:
    """What came of n games in which every fix was used.

    Attributes:
        alarm_epoch: of the first alarm, (n,); -1 = never.
        alarm_error: horizontal error of the estimate at the first alarm, (n,), m; of no meaning where there was none.
        final_error: horizontal error after the last fix was used, (n,), m.
        interval: between epochs, s.
    """

    alarm_epoch: Runs
    alarm_error: Floats
    final_error: Floats
    interval: float

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
        peak: highest statistic over its threshold in epochs 1..K, (D, n).
        final_error: horizontal error after the last fix was used, (n,), m.
        interval: between epochs, s.
    """

    alarm_epoch: Runs
    alarm_error: Floats
    peak: Floats
    final_error: Floats
    interval: float

    def of(self, detector: int) -> Episodes:
        """As one detector, by its place, saw them."""
        return Episodes(self.alarm_epoch[detector], self.alarm_error[detector], self.final_error, self.interval)

    def together(self) -> Episodes:
        """As all detectors at once: the first alarm of any."""
        n = len(self.final_error)
        if not len(self.alarm_epoch):
            return Episodes(np.full(n, NEVER), np.zeros(n), self.final_error, self.interval)
        epoch = np.where(self.alarm_epoch == NEVER, np.iinfo(np.int64).max, self.alarm_epoch)
        first, runs = epoch.argmin(axis=0), np.arange(n)
        return Episodes(
            self.alarm_epoch[first, runs], self.alarm_error[first, runs], self.final_error, self.interval
        )


def horizontal(error: Floats) -> Floats:
    """Length of the horizontal part of (N, 3) errors, (N,)."""
    return np.sqrt(error[:, 0] ** 2 + error[:, 1] ** 2)


def _batches(episodes: int) -> Iterator[tuple[int, int]]:
    """First run and number of runs of each batch."""
    if episodes < 1:
        raise ValueError(f"episodes must be 1 or more, got {episodes}")
    for first in range(0, episodes, BATCH):
        yield first, min(BATCH, episodes - first)


def _watch(simulation: Simulation, advance: Callable[[], object]) -> tuple[Runs, Floats, Floats]:
    """Play to the last epoch; ``advance`` resolves the present epoch and observes the next.

    Returns:
        Epoch of the first alarm of each detector, the error then, and the highest statistic over its threshold, (D, n)
        each.
    """
    detectors = simulation.detectors
    shape = len(detectors), simulation.num_runs
    alarm_epoch, alarm_error, peak = np.full(shape, NEVER), np.zeros(shape), np.full(shape, -np.inf)
    for epoch in range(1, simulation.scenario.timeline.num_epochs + 1):
        advance()
        error = horizontal(simulation.error)
        for place, (name, detector) in enumerate(detectors.items()):
            assert detector.threshold is not None
            statistic = simulation.epoch.statistics[name]
            np.maximum(peak[place], statistic / detector.threshold, out=peak[place])
            fresh = (statistic > detector.threshold) & (alarm_epoch[place] == NEVER)
            alarm_epoch[place, fresh] = epoch
            alarm_error[place, fresh] = error[fresh]
    return alarm_epoch, alarm_error, peak


def _join(parts: list[WatchedEpisodes]) -> WatchedEpisodes:
    return WatchedEpisodes(
        np.concatenate([part.alarm_epoch for part in parts], axis=1),
        np.concatenate([part.alarm_error for part in parts], axis=1),
        np.concatenate([part.peak for part in parts], axis=1),
        np.concatenate([part.final_error for part in parts]),
        parts[0].interval,
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
    for first, count in _batches(episodes):
        simulation = Simulation(
            scenario, attack, detectors, None, count, seed + first, fidelity=fidelity, threads=threads
        )
        simulation.reset()

        def advance(simulation: Simulation = simulation) -> None:
            simulation.resolve()
            simulation.observe()

        watched = _watch(simulation, advance)
        simulation.resolve()
        parts.append(WatchedEpisodes(*watched, horizontal(simulation.error), scenario.timeline.interval))
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
    for first, count in _batches(episodes):
        game = make_game(count)
        game.simulation.streams = RunStreams.from_seed(seed + first, count)
        game.reset(np.arange(count))

        def advance(game: SpooferGame = game) -> None:
            game.step(act(game.observation()))

        watched = _watch(game.simulation, advance)
        parts.append(WatchedEpisodes(*watched, game.error.copy(), game.scenario.timeline.interval))
    return _join(parts)


def play_policy(
    make_game: Callable[[int], SpooferGame],
    act: Callable[[NDArray[np.float32]], NDArray[np.float32]],
    episodes: int,
    seed: int,
) -> Episodes:
    """Games of a policy, as all detectors together saw them; arguments as `watch_policy`."""
    return watch_policy(make_game, act, episodes, seed).together()
