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


def horizontal(error: Floats) -> Floats:
    """Length of the horizontal part of (N, 3) errors, (N,)."""
    return np.sqrt(error[:, 0] ** 2 + error[:, 1] ** 2)


def _batches(episodes: int) -> Iterator[tuple[int, int]]:
    """First run and number of runs of each batch."""
    if episodes < 1:
        raise ValueError(f"episodes must be 1 or more, got {episodes}")
    for first in range(0, episodes, BATCH):
        yield first, min(BATCH, episodes - first)


def _watch(simulation: Simulation, advance: Callable[[], object]) -> tuple[Runs, Floats]:
    """Play to the last epoch; ``advance`` resolves the present epoch and observes the next.

    Returns:
        Epoch of the first alarm and the error then, (n,) each.
    """
    alarm_epoch = np.full(simulation.num_runs, NEVER)
    alarm_error = np.zeros(simulation.num_runs)
    for epoch in range(1, simulation.scenario.timeline.num_epochs + 1):
        advance()
        fresh = simulation.alarm & (alarm_epoch == NEVER)
        if fresh.any():
            alarm_epoch[fresh] = epoch
            alarm_error[fresh] = horizontal(simulation.error)[fresh]
    return alarm_epoch, alarm_error


def _join(parts: list[Episodes]) -> Episodes:
    return Episodes(
        np.concatenate([part.alarm_epoch for part in parts]),
        np.concatenate([part.alarm_error for part in parts]),
        np.concatenate([part.final_error for part in parts]),
        parts[0].interval,
    )


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
    """Games of an attack; game i is seeded ``seed + i``, whatever the attack.

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

        alarms = _watch(simulation, advance)
        simulation.resolve()
        parts.append(Episodes(*alarms, horizontal(simulation.error), scenario.timeline.interval))
    return _join(parts)


def play_policy(
    make_game: Callable[[int], SpooferGame],
    act: Callable[[NDArray[np.float32]], NDArray[np.float32]],
    episodes: int,
    seed: int,
) -> Episodes:
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

        alarms = _watch(game.simulation, advance)
        parts.append(Episodes(*alarms, game.error.copy(), game.scenario.timeline.interval))
    return _join(parts)
