"""The Bayesian who knows the population: what it makes of a game's fixes, with no attack or any of the population's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats
from spoofgym.attacks.families import DEFAULT_MANOEUVRE, LEAST_LEFT
from spoofgym.attacks.pool import DEFAULT_CLEAN
from spoofgym.navigation.loose.family import LooseFamily
from spoofgym.navigation.loose.true_model import true_model
from spoofgym.optimum.bayes.bank import Knowledge, Limits, Prior, empty_bank
from spoofgym.optimum.bayes.filtering import Filter, best_filter, look_ahead, run_filter
from spoofgym.optimum.bayes.follow import POSITION, Posterior, Room, follow, mix
from spoofgym.optimum.bayes.median import expected_distance, geometric_median, rice
from spoofgym.optimum.bayes.populations import POPULATION_SHAPES, population_nodes
from spoofgym.optimum.bayes.reach import View
from spoofgym.optimum.bayes.schedule import Schedule, schedule
from spoofgym.optimum.bayes.shapes import Resolution
from spoofgym.optimum.bayes.sizes import rule
from spoofgym.optimum.bayes.tree import Node, Tree, plant
from spoofgym.scenario import Scenario

OWNER = "Bayesian bound"
SPREAD = 1e-4
"""Least posterior probability of a hypothesis whose attacks enter the estimate one by one, if they differ."""
PLACES, PARTS = 1 << 12, 1 << 12
"""Hypotheses, and parts of the mixture, for which there is room at first."""
AHEAD = 10.0
"""How far those look ahead who choose among solutions, s."""
KEPT_FILTERS = 256


@dataclass(frozen=True)
class Fixes:
    """What the Bayesian is told of a game at epochs 0..E-1.

    Attributes:
        residual: innovations of the unaided solution, (E, 3), m; of no account where there is no fix.
        available: whether there is a fix, (E,).
        disturbance: noise of multipath that a fix has beside the receiver's, 1 sigma per axis, (E,), m.
        told: uniform numbers of the shape that an attack of each kind has in this game if it is the one that attacks,
            (F, 6); None = nothing is told.
    """

    residual: Floats
    available: Flags
    disturbance: Floats
    told: Floats | None = None


class Watcher(Protocol):
    """Whoever is shown the posterior."""

    def see(self, epoch: int, view: View) -> None:
        """An epoch, after its fix."""


@dataclass(frozen=True)
class Estimates:
    """What the Bayesian makes of a game; leading axis: epochs 0..E-1, each after its fix.

    Attributes:
        median: of the horizontal error of the unaided solution, (E, 2), m: its geometric median, which errs least.
        mean: of that error, (E, 2), m.
        trusting: the estimate of the best filter that takes every fix for true, (E, 2), m.
        expected: mean distance of the error from the median by the posterior, (E,), m.
        quiet: posterior probability that no attack has begun, (E,).
        hypotheses: that were weighed, (E,).
        lost: posterior probability of the hypotheses that were given up at the epoch, (E,).
    """

    median: Floats
    mean: Floats
    trusting: Floats
    expected: Floats
    quiet: Floats
    hypotheses: Floats
    lost: Floats


@dataclass
class Bayesian:
    """The posterior of the position in games of a scenario against a population.

    It knows what really acts, the population, when multipath acts and how strongly, and that the game has begun. It may
    do with the fixes what it likes: no defender knows more or may do more.

    Args:
        scenario: with fixes of position; its filter plays no part.
        population: its name, or the nodes of its attacks.
        clean: share of games without an attack.
        resolution: of the attacks.

    Raises:
        ValueError: the scenario does not take such fixes or has aids, the game is too short for an attack, or a
            population that is unknown.
    """

    scenario: Scenario
    population: str | list[Node] = "training"
    clean: float = DEFAULT_CLEAN
    resolution: Resolution = field(default_factory=Resolution)

    def __post_init__(self) -> None:
        timeline, family = self.scenario.timeline, self.scenario.family
        if not isinstance(family, LooseFamily) or family.dimension != 3:
            raise ValueError(
                f"{OWNER}: scenario {self.scenario.name!r} has {family.measurement}; it exists for a simulated motion "
                "with fixes of position alone (m = 3)"
            )
        family.facts.refuse_aids(OWNER)
        if timeline.end - timeline.start < LEAST_LEFT + timeline.interval:
            raise ValueError(f"{OWNER}: an attack needs a game of more than {LEAST_LEFT:g} s")
        share = validation.share(OWNER, "clean", self.clean)
        self._trees: dict[bytes, Tree] = {}
        if isinstance(self.population, str):
            validation.one_of(OWNER, "population", self.population, tuple(POPULATION_SHAPES))
        else:
            self._trees[b""] = plant(self.population, timeline.num_epochs)
        self._model = true_model(family)
        self._look = look_ahead(self._model, round(AHEAD / timeline.interval))
        self._prior = _prior(schedule(timeline, self.scenario.manoeuvres(), DEFAULT_MANOEUVRE), share)
        self._rule = rule(self.resolution.sizes, self.resolution.headings)
        self._limits = Limits(kept=float(np.log(self.resolution.kept)), spread=float(np.log(SPREAD)))
        self._filters: dict[bytes, Filter] = {}

    def estimates(self, fixes: Fixes, watchers: Sequence[Watcher] = ()) -> Estimates:
        """What it makes of a game.

        Args:
            fixes: of the game, K + 1 epochs at most.
            watchers: shown the posterior of every epoch.

        Raises:
            ValueError: the fixes do not tell what the population's attacks ask for.
        """
        best, epochs = self._filter(fixes), len(fixes.residual)
        whitened, states = run_filter(best, fixes.residual[None])
        known, state = Knowledge(self._tree(fixes), self._prior, best, self._rule), states[0]
        found = _blank(epochs)
        room = _room(PLACES, PARTS, state.shape[1], self.resolution)
        count = 0
        for epoch in range(epochs):
            room, posterior, used = _followed(known, epoch, whitened[0, epoch], self._limits, room, count)
            count, parts = posterior.hypotheses, room.parts[:, :used]
            now = state[epoch, POSITION : POSITION + 2]
            mean = parts[0, :, 0] @ parts[0, :, 1:3]
            x, y = geometric_median(parts[0], (mean[0], mean[1]), rice())
            found.mean[epoch], found.median[epoch], found.trusting[epoch] = now + mean, now + np.array([x, y]), now
            found.expected[epoch] = expected_distance(parts[0], x, y, rice())
            found.quiet[epoch], found.lost[epoch], found.hypotheses[epoch] = posterior.quiet, posterior.lost, count
            view = View(np.ascontiguousarray(parts), np.stack([now, best.rows[epoch] @ state[epoch]]), best.rows[epoch])
            for watcher in watchers:
                watcher.see(epoch, view)
        return found

    def _tree(self, fixes: Fixes) -> Tree:
        """The tree of a game; one that is told nothing of its attacks is that of all."""
        if isinstance(self.population, str):
            key = b"" if fixes.told is None else fixes.told.tobytes()
            if key not in self._trees:
                timeline = self.scenario.timeline
                nodes = population_nodes(self.population, timeline, self.resolution, fixes.told)
                self._trees = {key: plant(nodes, timeline.num_epochs)}
            return self._trees[key]
        return self._trees[b""]

    def _filter(self, fixes: Fixes) -> Filter:
        """The best filter of a game; those of games without a disturbance are one."""
        key = fixes.available.tobytes() + fixes.disturbance.tobytes()
        if key not in self._filters:
            if len(self._filters) == KEPT_FILTERS:
                self._filters.pop(next(iter(self._filters)))
            self._filters[key] = best_filter(self._model, fixes.available, fixes.disturbance, self._look)
        return self._filters[key]


def _prior(found: Schedule, clean: float) -> Prior:
    """Logarithms of a schedule, with the share of clean games."""
    later = np.cumsum(found.onset[::-1])[::-1]
    with np.errstate(divide="ignore"):
        return Prior(
            onset=np.log((1.0 - clean) * found.onset),
            quiet=np.log(clean + (1.0 - clean) * later),
            lasts=np.log(found.lasts),
            ends=np.log(found.ends),
        )


def _blank(epochs: int) -> Estimates:
    """Room for what comes of a game."""
    plane = (epochs, 2)
    return Estimates(np.empty(plane), np.empty(plane), np.empty(plane), *(np.empty(epochs) for _ in range(4)))


def _room(places: int, parts: int, states: int, resolution: Resolution) -> Room:
    """Room for so many hypotheses of so many states, and parts of the mixture."""
    nodes = np.zeros((resolution.sizes * resolution.headings, 4))
    return Room(empty_bank(places, states), nodes, np.zeros((2, parts, 4)))


def _followed(
    known: Knowledge, epoch: int, whitened: Floats, limits: Limits, room: Room, count: int
) -> tuple[Room, Posterior, int]:
    """An epoch in as much room as it takes, which is returned with the posterior and the parts of the mixture."""
    posterior = follow(known, epoch, whitened, limits, room, count)
    while posterior.hypotheses > len(room.bank.node):
        # it stopped before it changed the first ones
        larger = empty_bank(2 * len(room.bank.node), room.bank.state.shape[2])
        for target, source in zip(larger, room.bank, strict=True):
            target[:count] = source[:count]
        room = room._replace(bank=larger)
        posterior = follow(known, epoch, whitened, limits, room, count)
    while True:
        used = mix(room, posterior, epoch, known, limits)
        if used <= room.parts.shape[1]:
            return room, posterior, used
        room = room._replace(parts=np.zeros((2, 2 * room.parts.shape[1], 4)))
