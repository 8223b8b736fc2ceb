"""What duels are worth: every game of a spoofer against a defender, and the payoff matrix of many of both.

Game i is seeded ``seed + i`` in every cell and meets the same noise, outages and clean games there, so the cells of a
matrix can be compared game by game.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Flags, Floats
from spoofgym.envs.duel_config import DuelConfig
from spoofgym.envs.duel_game import OWNER, DuelGame
from spoofgym.envs.opponents import make_defender, parts_of, spoofer_pool
from spoofgym.evaluation.episodes import batches
from spoofgym.evaluation.metrics import mean_interval
from spoofgym.policies.classical import watcher_and_response
from spoofgym.scenarios import make_scenario

LANES = 1000
"""Games that are played together; what a game is worth does not depend on it."""
Notify = Callable[[str], None]
Config = TypeVar("Config", bound=DuelConfig)


@dataclass(frozen=True)
class Cell:
    """Games of one spoofer against one defender.

    Attributes:
        spoofer: its specification.
        defender: its specification.
        harm: of each game, (G,).
        clean: whether nobody attacked, (G,).
    """

    spoofer: str
    defender: str
    harm: Floats
    clean: Flags

    @property
    def mean(self) -> float:
        """Mean harm, clean games included."""
        return float(self.harm.mean())

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the mean."""
        return mean_interval(self.harm)

    def first(self, games: int) -> Cell:
        """The first games alone."""
        return replace(self, harm=self.harm[:games], clean=self.clean[:games])

    def followed_by(self, later: Cell) -> Cell:
        """These games and those that come after them."""
        harm, clean = np.concatenate([self.harm, later.harm]), np.concatenate([self.clean, later.clean])
        return replace(self, harm=harm, clean=clean)


def play_cell(config: DuelConfig, spoofer: Any, defender: Any, games: int, seed: int) -> Cell:
    """Play whole duels of one spoofer against one defender.

    Args:
        config: arguments of the duel; its detectors must be those that the players need, see `with_detectors_of`.
        spoofer: who spoofs, as `spoofgym.envs.opponents` spells it.
        defender: who defends.
        games: how many.
        seed: of game 0.

    Raises:
        ValueError: a player that is unknown or does not fit, or no games.
    """
    harm, clean, names = [], [], ("", "")
    for streams in batches(games, seed, LANES):
        game = DuelGame(config, len(streams), spoofer=spoofer, defender=defender, streams=streams)
        game.reset(np.arange(game.num_lanes))
        # a filter that has diverged is worth the largest payoff to the end, once
        over = np.zeros(game.num_lanes, dtype=bool)
        total = np.zeros(game.num_lanes)
        for _ in range(game.scenario.timeline.num_epochs):
            outcome = game.step({})
            total += np.where(over, 0.0, outcome.reward)
            over |= outcome.terminated
        harm.append(total)
        clean.append(game.attacks.member < 0)
        names = _name(spoofer, game.attacks.name), _name(defender, str(game.score_values()["defender"][0]))
    return Cell(*names, np.concatenate(harm), np.concatenate(clean))


def check_players(config: DuelConfig, spoofers: Sequence[Any], defenders: Sequence[Any]) -> None:
    """Refuse players that cannot play a duel, before anybody plays.

    Args:
        config: arguments of the duel, with the detectors that the players need.
        spoofers: as `spoofgym.envs.opponents` spells them.
        defenders: as well.

    Raises:
        ValueError: a player that is unknown or does not fit.
        FileNotFoundError: a folder that holds no policy.
    """
    _check_names(config, spoofers, defenders)
    for spoofer in spoofers:
        DuelGame(config, 1, spoofer=spoofer)
    for defender in defenders:
        DuelGame(config, 1, defender=defender)


def _check_names(config: DuelConfig, spoofers: Sequence[Any], defenders: Sequence[Any]) -> None:
    """Refuse unknown players at once: a game needs the thresholds of its detectors, which may take minutes.

    Raises:
        ValueError, FileNotFoundError: as `check_players`.
    """
    scenario = make_scenario(config.scenario, config.coupling)
    for spoofer in spoofers:
        with validation.argument(OWNER, "spoofer"):
            spoofer_pool(spoofer, config.clean)
    for defender in defenders:
        with validation.argument(OWNER, "defender"):
            for part in parts_of(defender) if isinstance(defender, str) else [defender]:
                pair = watcher_and_response(part) if isinstance(part, str) else None
                make_defender(part if pair is None else pair[1], scenario, ())


def _name(given: Any, found: str) -> str:
    return given if isinstance(given, str) else found


def with_detectors_of(config: Config, defenders: Sequence[Any]) -> Config:
    """The duel with the detectors that defenders of the form ``DETECTOR > RESPONSE``, or pools of them, follow.

    They stand beside its own.

    All cells of a matrix are played with the same detectors, so that the same games begin in the same way.

    Args:
        config: arguments of the duel.
        defenders: specifications.
    """
    given = config.detectors if isinstance(config.detectors, tuple) else (config.detectors,)
    spelled = [part for text in defenders if isinstance(text, str) for part in parts_of(text)]
    pairs = [watcher_and_response(part) for part in spelled]
    followed = [pair[0] for pair in pairs if pair is not None]
    return replace(config, detectors=tuple(dict.fromkeys([*given, *followed])))


def play_matrix(
    config: DuelConfig,
    spoofers: Sequence[str],
    defenders: Sequence[str],
    games: int,
    seed: int,
    notify: Notify = lambda _: None,
) -> list[list[Cell]]:
    """The cells of every spoofer (a row each) against every defender (a column each).

    Args:
        config: arguments of the duel; detectors that the defenders follow are added.
        spoofers: specifications.
        defenders: specifications.
        games: of each cell.
        seed: of game 0 of every cell.
        notify: told each cell before it is played.

    Raises:
        ValueError: as `play_cell`, or nobody on a side.
    """
    if not spoofers or not defenders:
        raise ValueError("a payoff matrix needs at least one spoofer and one defender")
    whole = with_detectors_of(config, defenders)
    rows = []
    for spoofer in spoofers:
        row = []
        for defender in defenders:
            notify(f"{spoofer} against {defender}")
            row.append(play_cell(whole, spoofer, defender, games, seed))
        rows.append(row)
    return rows


def harms(cells: Sequence[Sequence[Cell]]) -> Floats:
    """The harm of every game of a matrix, (S, D, G); NaN after the games of a cell that has fewer than others."""
    most = max(len(cell.harm) for row in cells for cell in row)
    result = np.full((len(cells), len(cells[0]), most), np.nan)
    for row, column in np.ndindex(result.shape[:2]):
        harm = cells[row][column].harm
        result[row, column, : len(harm)] = harm
    return result
