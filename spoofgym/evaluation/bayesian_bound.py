"""What the Bayesian who knows a population loses to it in duels, beside defenders in the same games.

Blocks of games stay in a folder, so that an interrupted run goes on.
"""

from __future__ import annotations

import hashlib
import io
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym import files
from spoofgym.archive import read_arrays
from spoofgym.arrays import Flags, Floats
from spoofgym.attacks.families import AttackFamily
from spoofgym.attacks.pool import AttackPool
from spoofgym.envs.duel_config import DuelConfig
from spoofgym.envs.duel_game import DuelGame
from spoofgym.envs.payoffs import make_payoff
from spoofgym.evaluation.cell_store import CellStore
from spoofgym.evaluation.duels import Cell
from spoofgym.evaluation.engine import Engine, Notify, Task
from spoofgym.evaluation.metrics import mean_interval
from spoofgym.geodesy import horizontal
from spoofgym.optimum.bayes import LONGEST, SHAPE_DRAWS, Bayesian, Chooser, Fixes, Hindsight, Resolution
from spoofgym.scenarios import make_scenario
from spoofgym.streams import RunStreams

BLOCK = 20
"""Games of a task."""
UNAIDED = "always-exclude"
DEPTH = 60
"""Epochs that a defender can take back."""


@dataclass(frozen=True)
class BoundSettings:
    """Games of a population, and how finely the Bayesian looks at them.

    Attributes:
        duel: its arguments, with the detectors of the defenders that play the same games.
        population: who attacks.
        games: how many.
        seed: of game 0.
        resolution: of the Bayesian.
    """

    duel: DuelConfig
    population: str
    games: int
    seed: int
    resolution: Resolution

    def key(self, first: int) -> str:
        """Digest of all that decides a block of games, and of its first."""
        duel = {name: value for name, value in asdict(self.duel).items() if name != "threads"}
        count, resolution = min(BLOCK, self.games - first), asdict(self.resolution)
        content = [duel, self.population, self.seed + first, count, resolution, NAMES]
        return hashlib.sha256(json.dumps(content, default=str, sort_keys=True).encode()).hexdigest()[:32]


@dataclass(frozen=True)
class BoundGames:
    """What came of G games.

    Attributes:
        harm: of the estimate that errs least, (G,), m.
        of_mean: harm of the mean of the posterior, (G,), m.
        choosing: harm of the Bayesian who may only use a fix or leave it out, and decides at once, (G,), m.
        taking_back: harm of the one who may also take back up to 60 epochs, (G,), m.
        hindsight: harm that is expected of the best use of the fixes, once all are known, (G,), m; not a number where a
            game has too many sequences of decisions.
        trusting: harm of the best filter that takes every fix for true, (G,), m.
        expected: harm that the posterior expects, not clipped, (G,), m.
        choosing_expected: of the one who chooses, not clipped, (G,), m.
        lost: probability of the hypotheses that were given up, (G,).
        hypotheses: that were weighed at an epoch, (G,).
    """

    harm: Floats
    of_mean: Floats
    choosing: Floats
    taking_back: Floats
    hindsight: Floats
    trusting: Floats
    expected: Floats
    choosing_expected: Floats
    lost: Floats
    hypotheses: Floats


NAMES = tuple(BoundGames.__dataclass_fields__)


@dataclass(frozen=True)
class PlayedFixes:
    """Fixes of games, and the error of the solution that uses none; leading axes: games, epochs 0..K-1.

    Attributes:
        residual: innovations of the unaided solution, (G, K, 3), m.
        available: whether there is a fix, (G, K).
        disturbance: sigma of the multipath per axis, (G, K), m.
        error: horizontal error of the unaided solution, (G, K, 2), m.
        told: as in `Fixes`, (G, F, 6).
    """

    residual: Floats
    available: Flags
    disturbance: Floats
    error: Floats
    told: Floats

    def of(self, game: int) -> Fixes:
        """What the Bayesian is told of a game."""
        return Fixes(self.residual[game], self.available[game], self.disturbance[game], self.told[game])


def play_fixes(duel: DuelConfig, population: str, streams: RunStreams) -> PlayedFixes:
    """Play duels whose defender uses no fix.

    Args:
        duel: its arguments.
        population: who attacks.
        streams: random streams of the games.

    Raises:
        ValueError: a part that is unknown or does not fit.
    """
    count = len(streams)
    game = DuelGame(duel, count, spoofer=population, defender=UNAIDED, streams=streams)
    game.reset(np.arange(count))
    told = _told_of(game.attacks, streams)
    simulation, epochs = game.simulation, game.scenario.timeline.num_epochs
    residual, error = np.empty((count, epochs, 3)), np.empty((count, epochs, 2))
    for epoch in range(epochs):
        residual[:, epoch] = simulation.epoch.innovation.residual
        simulation.resolve()
        error[:, epoch] = simulation.error[:, :2]
        simulation.observe()
    disturbed = game.confounders
    return PlayedFixes(residual, disturbed.available[:, :epochs], disturbed.sigma[:, :epochs], error, told)


def _told_of(pool: AttackPool, streams: RunStreams) -> Floats:
    """The numbers of the shapes of each game, (N, F, 6): of the kind that attacks its own, of others any."""
    size = (len(pool.members), SHAPE_DRAWS)
    told = np.stack([streams.spawn(run, "opponent").random(size) for run in range(len(streams))])
    for place, family in enumerate(pool.members):
        attacking = pool.member == place
        if isinstance(family, AttackFamily):
            told[attacking, place] = family.draws[attacking, -SHAPE_DRAWS:]
    return told


def play_block(settings: BoundSettings, first: int) -> BoundGames:
    """The games of a block.

    Args:
        settings: of all games.
        first: game of the block.

    Raises:
        ValueError: a part that is unknown or does not fit.
    """
    scenario = make_scenario(settings.duel.scenario, settings.duel.coupling)
    bayesian = Bayesian(scenario, settings.population, settings.duel.clean, settings.resolution)
    payoff, model = make_payoff("error", scenario), scenario.linear_model()
    count = min(BLOCK, settings.games - first)
    played = play_fixes(settings.duel, settings.population, RunStreams.from_seed(settings.seed + first, count))
    short = scenario.timeline.num_epochs <= LONGEST
    rows = []
    for game in range(count):
        fixes, truth = played.of(game), played.error[game]
        choosing, taking_back = Chooser(model, fixes), Chooser(model, fixes, DEPTH)
        hindsight = [Hindsight(model, fixes)] if short else []
        found = bayesian.estimates(fixes, [choosing, taking_back, *hindsight])
        points = (found.median, found.mean, -choosing.moved, -taking_back.moved, found.trusting)
        harms = [payoff.of(horizontal(truth - point)).mean() for point in points]
        best = [each.costs.min() / len(truth) for each in hindsight] or [np.nan]
        expected = [found.expected.mean(), choosing.expected.mean()]
        rows.append([*harms[:4], *best, harms[4], *expected, found.lost.sum(), found.hypotheses.mean()])
    return BoundGames(*np.array(rows).T)


def bound_games(settings: BoundSettings, folder: Path, engine: Engine, notify: Notify) -> BoundGames:
    """All games, from the folder or played now.

    Args:
        settings: of the games.
        folder: of the blocks; is made where there is none.
        engine: plays what has not been played.
        notify: told each block that is played.

    Raises:
        ValueError: a part that is unknown or does not fit, or a damaged file.
        RuntimeError: a failure of the engine.
    """
    starts = range(0, settings.games, BLOCK)
    missing = [first for first in starts if not _path(folder, settings, first).exists()]
    told = f"{settings.population}, games"
    engine.run(
        [Task(f"{told} {first}-{min(first + BLOCK, settings.games) - 1}", _keep, (settings, folder, first))
         for first in missing],
        notify,
    )
    blocks = [_read(_path(folder, settings, first), min(BLOCK, settings.games - first)) for first in starts]
    return BoundGames(*(np.concatenate([getattr(block, name) for block in blocks]) for name in NAMES))


def _path(folder: Path, settings: BoundSettings, first: int) -> Path:
    return folder / f"{settings.key(first)}.npz"


def _keep(settings: BoundSettings, folder: Path, first: int) -> None:
    """Play a block that stays on disk."""
    played, packed = play_block(settings, first), io.BytesIO()
    np.savez(packed, **{name: getattr(played, name) for name in NAMES})
    files.write_bytes(_path(folder, settings, first), packed.getvalue())


def _read(path: Path, count: int) -> BoundGames:
    arrays = read_arrays(path)
    with files.reading(path):
        if set(arrays) != set(NAMES) or any(part.shape != (count,) for part in arrays.values()):
            raise ValueError(f"it does not hold {count} games of the bound")
        return BoundGames(**{name: arrays[name].astype(np.float64) for name in NAMES})


def bound_report(settings: BoundSettings, games: BoundGames, cells: list[Cell]) -> dict[str, Any]:
    """What is told of a population.

    Args:
        settings: of the games.
        games: of the Bayesian.
        cells: the same games of defenders.
    """
    return {
        "population": settings.population,
        "bayesian": {
            **_told("harm", games.harm),
            **_told("of_mean", games.of_mean),
            **_told("expected", games.expected),
            **_told("surprise", games.harm - games.expected),
            "lost": float(games.lost.mean()),
            "hypotheses": float(games.hypotheses.mean()),
        },
        "choosing": _beside(games.choosing, games.harm),
        "taking_back": _beside(games.taking_back, games.harm),
        **_hindsight(games),
        "trusting": _told("harm", games.trusting),
        "defenders": [
            {"defender": cell.defender, **_beside(cell.harm, games.harm)} for cell in cells
        ],
    }


def _hindsight(games: BoundGames) -> dict[str, Any]:
    """Of short games: what the posterior expects of the best use of the fixes in hindsight, and of the one chosen."""
    if np.isnan(games.hindsight).any():
        return {}
    return {
        "hindsight": _beside(games.hindsight, games.expected),
        "choosing_expected": _beside(games.choosing_expected, games.expected),
    }


def _beside(harm: Floats, bound: Floats) -> dict[str, Any]:
    return {**_told("harm", harm), **_told("above_bound", harm - bound)}


def _told(name: str, values: Floats) -> dict[str, Any]:
    return {name: float(values.mean()), f"{name}_ci95": list(mean_interval(values))}


def same_games(settings: BoundSettings, defenders: list[str], folder: Path) -> list[Cell]:
    """The same games of defenders.

    Args:
        settings: of the games; their duel has the defenders' detectors.
        defenders: specifications.
        folder: where they are kept.

    Raises:
        ValueError: a defender that is unknown or does not fit.
    """
    store = CellStore(folder, settings.duel, settings.games, settings.seed)
    return [store.cell(settings.population, defender) for defender in defenders]
