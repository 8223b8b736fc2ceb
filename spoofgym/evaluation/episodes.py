"""The loop that every evaluation shares: batches of whole games, epoch by epoch, and what is noted of each.

Game i is seeded ``seed + i``, whoever plays and however many games a batch has: all players meet the same noise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from spoofgym import validation
from spoofgym.arrays import Flags, Floats
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.geodesy import horizontal
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams

Act = Callable[[NDArray[np.float32]], NDArray[Any]]
"""Actions of a policy for observations (N, D)."""
Result = TypeVar("Result", covariant=True)


class Batch(Protocol):
    """N games that are played together."""

    @property
    def simulation(self) -> Simulation:
        """Of the games."""
        ...

    @property
    def error(self) -> Floats:
        """Horizontal error of the estimate when last resolved, (N,), m."""
        ...

    def reset(self) -> None:
        """Start the games up to the clean epoch 0."""

    def advance(self) -> None:
        """Decide on the present epoch, resolve it and observe the next."""


class Record(Protocol[Result]):
    """What is noted of a batch while it is played."""

    def before(self, epoch: int) -> None:
        """Note an epoch that is observed and not decided on yet."""

    def after(self, epoch: int) -> None:
        """Note what became of an epoch; the next one is observed."""

    def result(self) -> Result:
        """All that was noted, when the games have ended."""
        ...


class SimulationBatch:
    """Games of a simulation without a seat: its attack plays, and a function decides.

    Attributes:
        simulation: of the games.
        error: horizontal error of the estimate when last resolved, (N,), m.
        excluded: whether the last decision was to exclude, (N,).
    """

    def __init__(self, simulation: Simulation, resolve: Callable[[Simulation], Flags] | None = None) -> None:
        """Play a simulation.

        Args:
            simulation: of the games.
            resolve: resolves the present epoch and tells which runs exclude it, (N,); None = as the simulation decides.
        """
        self.simulation, self._resolve = simulation, resolve
        self.error = np.zeros(simulation.num_runs)
        self.excluded = np.zeros(simulation.num_runs, dtype=bool)

    def reset(self) -> None:
        """Start the games up to the clean epoch 0."""
        self.simulation.reset()

    def resolve(self) -> None:
        """Decide on the present epoch and resolve it."""
        if self._resolve is None:
            self.simulation.resolve()
        else:
            self.excluded = self._resolve(self.simulation)
        self.error = horizontal(self.simulation.error)

    def advance(self) -> None:
        """Decide on the present epoch, resolve it and observe the next."""
        self.resolve()
        self.simulation.observe()


class GameBatch:
    """Games of Defender-v0, in which a policy takes the agent's seat.

    Attributes:
        simulation: of the games.
        actions: of the last step, of every game.
    """

    def __init__(self, game: DefenderGame, act: Act) -> None:
        """Let ``act`` play all lanes of a game."""
        self.simulation, self._game, self._act = game.simulation, game, act
        self.actions: NDArray[Any] = np.zeros(0)

    @property
    def error(self) -> Floats:
        """Horizontal error of the estimate when last resolved, (N,), m."""
        return self._game.error

    def reset(self) -> None:
        """Start the games up to the clean epoch 0."""
        self._game.reset(np.arange(self._game.num_lanes))

    def advance(self) -> None:
        """Decide on the present epoch, resolve it and observe the next."""
        self.actions = self._act(self._game.observation())
        self._game.step(self.actions)


AnyBatch = TypeVar("AnyBatch", bound=Batch)


def play(
    make: Callable[[RunStreams], AnyBatch],
    note: Callable[[AnyBatch], Record[Result]],
    episodes: int,
    seed: int,
    size: int,
) -> list[Result]:
    """Play whole games in batches; what was noted of each batch.

    Args:
        make: builds a batch of games with these random streams.
        note: begins to note a batch.
        episodes: games of all batches.
        seed: of game 0.
        size: most games of a batch.

    Raises:
        ValueError: no games, or too many, or a seed that is no whole number, 0 or more.
    """
    parts = []
    for streams in batches(episodes, seed, size):
        batch = make(streams)
        batch.reset()
        record = note(batch)
        for epoch in range(batch.simulation.scenario.timeline.num_epochs):
            record.before(epoch)
            batch.advance()
            batch.simulation.require_converged()
            record.after(epoch)
        parts.append(record.result())
    return parts


def batches(episodes: int, seed: int, size: int) -> Iterator[RunStreams]:
    """The random streams of each batch.

    Args:
        episodes: games of all batches.
        seed: of game 0.
        size: most games of a batch.

    Raises:
        ValueError: no games, or too many, or a seed that is no whole number, 0 or more.
    """
    episodes = validation.runs("evaluation", "episodes", episodes)
    seed = validation.whole("evaluation", "seed", seed, 0, 2**62)
    for first in range(0, episodes, size):
        yield RunStreams.from_seed(seed + first, min(size, episodes - first))
