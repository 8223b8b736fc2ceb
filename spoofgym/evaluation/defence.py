"""Whole games of a defender, and what came of each: the same episodes for every defender."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.attacks.pool import AttackPool
from spoofgym.detectors.base import Detector
from spoofgym.envs.config import DefenderConfig
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.defender_seat import EXCLUDE
from spoofgym.envs.opponents import spoofer_pool
from spoofgym.evaluation.departures import Departures, departures_of, joined
from spoofgym.evaluation.episodes import Act, GameBatch, SimulationBatch, play
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.responses.base import Response
from spoofgym.responses.watching import Watching
from spoofgym.scenario import Scenario
from spoofgym.sensors.confounders import Confounders, Disturbances
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams
from spoofgym.timeline import Timeline

BATCH = 1000


@dataclass(frozen=True)
class DefenceEpisodes:
    """What came of n games of K decisions.

    Attributes:
        error: horizontal error of the real-time output after each decision, (n, K), m.
        excluded: the decision was to exclude, (n, K).
        available: the receiver gave a fix, (n, K).
        attacked: the fix was spoofed, (n, K).
        clean: there was a fix, neither spoofed nor disturbed by multipath, (n, K).
        member: the opponent, an index into ``names``, (n,); -1 = none.
        names: of the opponents.
        timeline: of the games.
        departures: of the vehicles; None where they keep their paths.
    """

    error: Floats
    excluded: Flags
    available: Flags
    attacked: Flags
    clean: Flags
    member: Runs
    names: tuple[str, ...]
    timeline: Timeline
    departures: Departures | None = None

    def of(self, games: Any) -> DefenceEpisodes:
        """Some of the games."""
        parts = ("error", "excluded", "available", "attacked", "clean", "member")
        departures = None if self.departures is None else self.departures.of(games)
        return replace(self, departures=departures, **{name: getattr(self, name)[games] for name in parts})


@dataclass(frozen=True)
class World:
    """What every defender is evaluated in.

    All of ``detectors`` run beside every defender, whether it looks at them or not: how an episode begins depends on
    them (a burn-in without an alarm), and the same episode is to begin the same for all.

    Attributes:
        scenario: of the game.
        attacks: a population or an attack, by its specification.
        clean: share of games without an attack.
        detectors: with their thresholds.
        disturbances: of the receiver.
        fidelity: of the simulation.
        threads: of the simulation.
    """

    scenario: Scenario
    attacks: str
    clean: float
    detectors: tuple[Detector, ...]
    disturbances: Disturbances = field(default_factory=Disturbances)
    fidelity: str = "linear"
    threads: int = 1

    def simulation(
        self, response: Response | None, streams: RunStreams, demands: Demands
    ) -> Simulation:
        """A simulation with these random streams, a run each."""
        return Simulation(
            self.scenario,
            spoofer_pool(self.attacks, self.clean),
            list(self.detectors),
            response,
            len(streams),
            fidelity=self.fidelity,
            threads=self.threads,
            demands=demands,
            confounders=Confounders(self.disturbances),
            streams=streams,
        )


def play_response(world: World, detector: str, response: Response, episodes: int, seed: int) -> DefenceEpisodes:
    """Games of a classical defender.

    Args:
        world: what is played in.
        detector: name of the one whose alarm the response follows.
        response: what follows an alarm.
        episodes: how many games; game i is seeded ``seed + i`` for every defender.
        seed: of game 0.

    Raises:
        ValueError: the world has no such detector.
    """
    def decide(simulation: Simulation) -> Flags:
        excluded = ~simulation.decision.use
        simulation.resolve()
        return excluded

    watching = Watching(response, detector, world.detectors)
    return _play(world, watching, decide, watching.demands, episodes, seed)


def play_never(world: World, episodes: int, seed: int) -> DefenceEpisodes:
    """Games of a defender that uses every fix."""

    def decide(simulation: Simulation) -> Flags:
        simulation.resolve()
        return np.zeros(simulation.num_runs, dtype=bool)

    return _play(world, None, decide, Demands(), episodes, seed)


def play_always(world: World, episodes: int, seed: int) -> DefenceEpisodes:
    """Games of a defender that excludes every fix."""

    def decide(simulation: Simulation) -> Flags:
        nobody = np.zeros(simulation.num_runs, dtype=bool)
        simulation.resolve(Decision(nobody))
        return ~nobody

    return _play(world, None, decide, Demands(excludes=True), episodes, seed)


def play_oracle_onset(world: World, episodes: int, seed: int) -> DefenceEpisodes:
    """Games of a defender that knows when fixes are spoofed, and leaves out just these."""

    def decide(simulation: Simulation) -> Flags:
        spoofed = simulation.attacked
        simulation.resolve(Decision(~spoofed))
        return spoofed

    return _play(world, None, decide, Demands(excludes=True), episodes, seed)


def play_random(world: World, episodes: int, seed: int) -> DefenceEpisodes:
    """Games of a defender that tosses a coin at every epoch, and a depth where it begins to exclude."""
    depths = np.array(world.scenario.depth_table)
    rng = np.random.default_rng(np.random.SeedSequence((seed, 1)))
    before = np.zeros(0, dtype=bool)

    def decide(simulation: Simulation) -> Flags:
        nonlocal before
        n = simulation.num_runs
        if len(before) != n or not simulation.epoch.index.any():
            before = np.zeros(n, dtype=bool)
        exclude = rng.random(n) < 0.5
        depth = np.where(exclude & ~before, depths[rng.integers(len(depths), size=n)], 0)
        before = exclude
        simulation.resolve(Decision(~exclude, depth))
        return exclude

    return _play(world, None, decide, Demands(excludes=True, history=int(depths.max())), episodes, seed)


def _play(
    world: World,
    response: Response | None,
    decide: Callable[[Simulation], Flags],
    demands: Demands,
    episodes: int,
    seed: int,
) -> DefenceEpisodes:
    def make(streams: RunStreams) -> SimulationBatch:
        return SimulationBatch(world.simulation(response, streams, demands), decide)

    return _join(play(make, _Record, episodes, seed, BATCH))


def play_policy(
    world: World,
    config: DefenderConfig,
    act: Act,
    episodes: int,
    seed: int,
) -> DefenceEpisodes:
    """Games of a learned policy, which meet the noise that a response would.

    Args:
        world: what is played in.
        config: of the game that the policy was trained on: what it observes.
        act: actions for observations (N, D), (N, 2 + S).
        episodes: how many games; game i is seeded ``seed + i``.
        seed: of game 0.
    """
    config = replace(
        config,
        scenario=world.scenario,
        attacks=world.attacks,
        clean=world.clean,
        fidelity=world.fidelity,
        threads=world.threads,
    )

    def make(streams: RunStreams) -> _PolicyBatch:
        game = DefenderGame(
            config, len(streams), world.detectors, streams=streams, disturbances=world.disturbances
        )
        return _PolicyBatch(game, act)

    return _join(play(make, _Record, episodes, seed, BATCH))


class _PolicyBatch(GameBatch):
    """Games of a policy that defends."""

    @property
    def excluded(self) -> Flags:
        """Whether the last action was to exclude, (N,)."""
        return np.equal(self.actions[:, 0], EXCLUDE)


class _Record:
    """What is noted of a batch of games while it is played."""

    def __init__(self, batch: SimulationBatch | _PolicyBatch) -> None:
        self._batch, self._simulation = batch, batch.simulation
        shape = (batch.simulation.num_runs, batch.simulation.scenario.timeline.num_epochs)
        self._error = np.zeros(shape)
        self._excluded, self._available, self._attacked, self._multipath = (
            np.zeros(shape, dtype=bool) for _ in range(4)
        )

    def before(self, epoch: int) -> None:
        """Note the present epoch before it is decided on."""
        simulation = self._simulation
        assert simulation.epoch.available is not None
        assert simulation.confounders is not None
        self._available[:, epoch] = simulation.epoch.available
        self._attacked[:, epoch] = simulation.attacked
        self._multipath[:, epoch] = simulation.confounders.multipath[:, epoch]

    def after(self, epoch: int) -> None:
        """Note the decision and the error that it left."""
        self._excluded[:, epoch] = self._batch.excluded
        self._error[:, epoch] = self._batch.error

    def result(self) -> DefenceEpisodes:
        """All games of the batch."""
        attack = self._simulation.attack
        assert isinstance(attack, AttackPool)
        return DefenceEpisodes(
            self._error,
            self._excluded,
            self._available,
            self._attacked,
            self._available & ~self._attacked & ~self._multipath,
            attack.member.copy(),
            tuple(attack.names),
            self._simulation.scenario.timeline,
            departures_of(self._simulation),
        )


def _join(parts: list[DefenceEpisodes]) -> DefenceEpisodes:
    names = ("error", "excluded", "available", "attacked", "clean", "member")
    departures = joined([part.departures for part in parts])
    whole: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return replace(parts[0], departures=departures, **whole)
