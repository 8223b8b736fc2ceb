"""What a benchmark is made of: matches against fixed opponents, tasks with reference scores, and thresholds.

`spoofgym.evaluation.benchmark_v1` pins the first version. Everything here is frozen and plain, so that the digest of a
benchmark names all that decides its results.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from spoofgym.arrays import Floats

ATTACK, DEFEND = "attack", "defend"
TRACKS = (ATTACK, DEFEND)
UNDETECTED = "undetected"
"""What a game of Spoofer-v0 that an alarm ends is worth: the error at the end without an alarm, else 0, m."""
HELD_OUT, WORST = "held-out", "worst"


@dataclass(frozen=True)
class Match:
    """Games of a player against one opponent.

    Attributes:
        opponent: its specification: the detector of games that an alarm ends, else the other player of a duel.
        games: how many.
        seed: of game 0; no two matches share a game.
    """

    opponent: str
    games: int
    seed: int


@dataclass(frozen=True)
class BenchmarkTask:
    """One number that a player is measured by: the largest of the means of its matches.

    Attributes:
        name: PLACE/PAYOFF/OPPONENTS.
        track: "attack" or "defend".
        place: name of the scenario within the benchmark.
        payoff: what a game is worth: "undetected", or the payoff of a duel.
        kind: "undetected" or "duel" for spoofers, "held-out" or "worst" for defenders.
        clean: share of games without an attack.
        matches: one, or those of which the worst counts.
        zero: score that is worth 0.
        one: score that is worth 1.
        best: who has reached it.
    """

    name: str
    track: str
    place: str
    payoff: str
    kind: str
    clean: float
    matches: tuple[Match, ...]
    zero: float
    one: float
    best: str

    @property
    def unit(self) -> str:
        """Of its score."""
        return "share of epochs" if self.payoff.startswith("beyond") else "m"

    @property
    def groups(self) -> tuple[str, ...]:
        """What it belongs to, beside all tasks."""
        return self.place, self.kind

    def normalised(self, score: Floats) -> Floats:
        """Scores on the line on which the references are 0 and 1, same shape."""
        return np.asarray((score - self.zero) / (self.one - self.zero))


@dataclass(frozen=True)
class Place:
    """Where games are played.

    Attributes:
        name: within the benchmark.
        scenario: its specification.
        world: detectors that run in every duel, by their specifications.
        thresholds: of detectors, by their specifications; others are calibrated as they are asked for.
    """

    name: str
    scenario: str
    world: tuple[str, ...]
    thresholds: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Benchmark:
    """A benchmark.

    Attributes:
        name: with its version.
        places: where it is played.
        tasks: of both tracks.
        arl0: epochs between false alarms of the monitors that end a game, and of those that optimal attacks assume.
        fidelity: of all games.
        outage: share of the duels with outages.
        multipath: share of the duels with multipath.
        agents: published agents among the opponents, with the digests of their weights.
        attackers: the spoofers of the table; the best of them are references.
        defenders: the defenders of the table; the best of them are references.
        resamples: of the bootstrap.
    """

    name: str
    places: tuple[Place, ...]
    tasks: tuple[BenchmarkTask, ...]
    arl0: float
    fidelity: str
    outage: float
    multipath: float
    agents: tuple[tuple[str, str], ...]
    attackers: tuple[str, ...]
    defenders: tuple[str, ...]
    resamples: int

    @property
    def digest(self) -> str:
        """Of the whole definition, 16 hexadecimal digits."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:16]

    def place(self, name: str) -> Place:
        """The place of a name."""
        return next(place for place in self.places if place.name == name)

    def baselines(self, track: str) -> tuple[str, ...]:
        """The players of the table, by the track."""
        return self.attackers if track == ATTACK else self.defenders

    def chosen(self, track: str, asked: Sequence[str] = ()) -> tuple[BenchmarkTask, ...]:
        """The tasks of a track whose names are, or begin with, what is asked for.

        Args:
            track: "attack" or "defend".
            asked: names of tasks or beginnings of them, ``foi-drive`` or ``foi-drive/error``; none = all.

        Raises:
            ValueError: one that fits no task; the message lists the valid names.
        """
        tasks = [task for task in self.tasks if task.track == track]
        for text in asked:
            if not any(_begins(task.name, text) for task in tasks):
                names = ", ".join(task.name for task in tasks)
                raise ValueError(f"{self.name} has no task {text!r} in the track '{track}'; there are: {names}")
        return tuple(task for task in tasks if not asked or any(_begins(task.name, text) for text in asked))


def groups_of(tasks: Sequence[BenchmarkTask]) -> tuple[str, ...]:
    """The places of tasks, then their kinds, each once."""
    return tuple(dict.fromkeys([*(task.place for task in tasks), *(task.kind for task in tasks)]))


def _begins(name: str, text: str) -> bool:
    return f"{name}/".startswith(f"{text.strip().rstrip('/')}/")
