"""The Bayesian who knows the population: what it makes of a game's fixes, with no attack or any of the population's."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats
from spoofgym.attacks.families import DEFAULT_MANOEUVRE, LEAST_LEFT
from spoofgym.attacks.pool import DEFAULT_CLEAN
from spoofgym.navigation.loose.family import LooseFamily
from spoofgym.navigation.loose.true_model import true_model
from spoofgym.optimum.bayes.bank import Knowledge, Limits, Prior, empty_bank
from spoofgym.optimum.bayes.filtering import Filter, best_filter, run_filter
from spoofgym.optimum.bayes.follow import blank_account, follow
from spoofgym.optimum.bayes.median import rice
from spoofgym.optimum.bayes.schedule import Schedule, schedule
from spoofgym.optimum.bayes.shapes import Resolution, population_nodes
from spoofgym.optimum.bayes.sizes import rule
from spoofgym.optimum.bayes.tree import Node, plant
from spoofgym.scenario import Scenario

OWNER = "Bayesian bound"
LIMITS = Limits(kept=float(np.log(1e-8)), mixed=float(np.log(1e-7)), spread=float(np.log(1e-4)))
PLACES = 1 << 14
"""Hypotheses for which there is room at first."""
KEPT_FILTERS = 256


@dataclass(frozen=True)
class Fixes:
    """What the Bayesian is told of a game at epochs 0..E-1.

    Attributes:
        residual: innovations of the unaided solution, (E, 3), m; of no account where there is no fix.
        available: whether there is a fix, (E,).
        disturbance: noise of multipath that a fix has beside the receiver's, 1 sigma per axis, (E,), m.
    """

    residual: Floats
    available: Flags
    disturbance: Floats


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
        ValueError: the scenario does not take such fixes, the game is too short for an attack, or a population that is
            unknown.
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
        if timeline.end - timeline.start < LEAST_LEFT + timeline.interval:
            raise ValueError(f"{OWNER}: an attack needs a game of more than {LEAST_LEFT:g} s")
        share = validation.share(OWNER, "clean", self.clean)
        nodes = self.population
        if isinstance(nodes, str):
            nodes = population_nodes(nodes, timeline, self.resolution)
        self._model = true_model(family)
        self._tree = plant(nodes, timeline.num_epochs)
        self._prior = _prior(schedule(timeline, self.scenario.manoeuvres(), DEFAULT_MANOEUVRE), share)
        self._rule = rule(self.resolution.sizes, self.resolution.headings)
        self._filters: dict[bytes, Filter] = {}
        self._places = PLACES

    def estimates(self, fixes: Fixes) -> Estimates:
        """What it makes of a game.

        Args:
            fixes: of the game, K + 1 epochs at most.
        """
        best = self._filter(fixes)
        whitened, trusting = run_filter(best, fixes.residual[None])
        known = Knowledge(self._tree, self._prior, best, self._rule)
        account, states = blank_account(len(fixes.residual)), best.closed.shape[1]
        while True:
            bank, parts = empty_bank(self._places, states), np.zeros((3 * self._places, 4))
            if follow(known, whitened[0], LIMITS, bank, parts, rice(), account):
                break
            self._places *= 2
        return Estimates(
            median=trusting[0] + account.median,
            mean=trusting[0] + account.mean,
            trusting=trusting[0],
            expected=account.expected,
            quiet=account.quiet,
            hypotheses=account.hypotheses,
            lost=account.lost,
        )

    def _filter(self, fixes: Fixes) -> Filter:
        """The best filter of a game; those of games without a disturbance are one."""
        key = fixes.available.tobytes() + fixes.disturbance.tobytes()
        if key not in self._filters:
            if len(self._filters) == KEPT_FILTERS:
                self._filters.pop(next(iter(self._filters)))
            self._filters[key] = best_filter(self._model, fixes.available, fixes.disturbance)
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
