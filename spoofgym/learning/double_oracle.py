"""Double oracle: a payoff matrix grows by best responses to the other side's mixture, until none gains (PSRO).

Each round fills the matrix, with more games where an interval decides who is mixed in, solves it, trains a best
response of each side to the other's mixture, and takes it in if it gains more than the interval of the gain. Everything
is on disk: cells, policies, rounds. A league that is killed goes on where it stood and ends with the same numbers.

McMahan, Gordon and Blum 2003 (double oracle); Lanctot et al. 2017 (policy-space response oracles).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from spoofgym import files, validation
from spoofgym.arrays import Floats
from spoofgym.envs.duel_config import DuelConfig
from spoofgym.envs.duel_game import DEFENDER, SPOOFER
from spoofgym.evaluation.allotment import Allotment, paired
from spoofgym.evaluation.cell_store import CellStore
from spoofgym.evaluation.contests import CONTESTS, ROUNDING, Contest
from spoofgym.evaluation.duels import check_players, harms
from spoofgym.evaluation.engine import Engine, Here, Notify, Task
from spoofgym.evaluation.metrics import mean_interval
from spoofgym.evaluation.payoff import (
    META_STRATEGIES,
    RESAMPLES,
    Mixtures,
    exploitability,
    nash_conv,
    value_interval,
)
from spoofgym.policies.learned import load_policy
from spoofgym.policies.published import POLICY, policy_folder
from spoofgym.specification import nest

OWNER = "league"
SETTINGS_FILE, ROUNDS_FILE = "league.json", "rounds.json"
LEAST_WEIGHT = 1e-3
"""A player that is mixed in more rarely is no opponent of a training."""
MORE_GAMES = 4
"""By default a cell that an interval needs gets so many times the games of the others."""
SCHEMA_VERSION = 1


@dataclass(frozen=True, kw_only=True)
class LeagueSettings:
    """What a league is.

    Attributes:
        duel: arguments of the duel that is played.
        spoofers: specifications of the spoofers that it begins with.
        defenders: specifications of the defenders that it begins with.
        rounds: of best responses.
        games: that each cell begins with.
        most_games: of a cell whose interval decides who is mixed in; None = `MORE_GAMES` times ``games``.
        meta: how both sides are mixed: "nash", "uniform" or "stackelberg".
        seed: of game 0 of each cell; trainings have seeds of their own from it.
        resamples: of the games, for the interval of the value.

    Raises:
        ValueError: nobody on a side, a name that is not valid, or a number out of range.
    """

    duel: DuelConfig
    spoofers: tuple[str, ...]
    defenders: tuple[str, ...]
    rounds: int = 5
    games: int = 500
    most_games: int | None = None
    meta: str = "nash"
    seed: int = 0
    resamples: int = RESAMPLES

    def __post_init__(self) -> None:
        if not self.spoofers or not self.defenders:
            raise ValueError("a league begins with at least one spoofer and one defender")
        validation.whole(OWNER, "rounds", self.rounds, 0, 1000)
        games = validation.whole(OWNER, "games", self.games, 2, 10**7)
        if self.most_games is None:
            object.__setattr__(self, "most_games", MORE_GAMES * games)
        validation.whole(OWNER, "most_games", self.most_games, games, MORE_GAMES * 10**7)
        validation.one_of(OWNER, "meta", self.meta, tuple(META_STRATEGIES))
        validation.seed(OWNER, self.seed)
        validation.whole(OWNER, "resamples", self.resamples, 1, 10**6)

    def content(self) -> dict[str, Any]:
        """For ``league.json``."""
        plain: dict[str, Any] = json.loads(json.dumps(asdict(self)))
        return {"schema_version": SCHEMA_VERSION, **plain}


class Trainer(Protocol):
    """Trains best responses."""

    def __call__(self, side: str, opponent: str, folder: Path, seed: int) -> str:
        """Train a best response to a mixture, or go on with it; returns its specification.

        Args:
            side: that learns.
            opponent: the mixture of the other side, as a pool.
            folder: of the run, which may hold one that was interrupted.
            seed: of the training.
        """


@dataclass(frozen=True)
class Round:
    """One solved matrix and what came of it.

    Attributes:
        number: 0 for the matrix of the players at the beginning.
        spoofers: rows of the matrix.
        defenders: its columns.
        mean: mean harm of each cell, (S, D).
        half_width: of its 95 % interval, (S, D).
        games: of each cell, (S, D).
        mixtures: of both sides, and the value.
        value_interval: 95 % bootstrap interval of the value of the game.
        nash_conv: of the mixtures, within the matrix.
        worst: largest mean harm against each defender, (D,).
        gains: of each side's best response against the mixture, with its 95 % interval; empty in the last round.
        weights: digest of the weights of each policy of the matrix.
    """

    number: int
    spoofers: tuple[str, ...]
    defenders: tuple[str, ...]
    mean: Floats
    half_width: Floats
    games: NDArray[np.int64]
    mixtures: Mixtures
    value_interval: tuple[float, float]
    nash_conv: float
    worst: Floats
    gains: dict[str, dict[str, Any]]
    weights: dict[str, str]

    def content(self) -> dict[str, Any]:
        """For ``rounds.json``."""
        return {
            "number": self.number,
            "spoofers": list(self.spoofers),
            "defenders": list(self.defenders),
            "mean": self.mean.tolist(),
            "half_width": self.half_width.tolist(),
            "games": self.games.tolist(),
            "spoofer_mixture": self.mixtures.spoofers.tolist(),
            "defender_mixture": self.mixtures.defenders.tolist(),
            "value": self.mixtures.value,
            "value_ci95": list(self.value_interval),
            "nash_conv": self.nash_conv,
            "worst": self.worst.tolist(),
            "gains": self.gains,
            "weights": self.weights,
        }


class League:
    """A league in a folder.

    Attributes:
        settings: what it is.
        folder: where everything lies.
    """

    def __init__(
        self, settings: LeagueSettings, folder: Path, train: Trainer, engine: Engine | None = None
    ) -> None:
        """Begin a league, or go on with the one in the folder.

        Args:
            settings: what it is.
            folder: of the league.
            train: trains best responses.
            engine: plays cells and trains; None = here, one after the other.

        Raises:
            ValueError: the folder holds another league, or one of another version; nothing can be written there; or a
                player is unknown or does not fit.
        """
        files.check_folder(folder)
        if settings.rounds and any(letter in str(folder) for letter in "+,"):
            raise ValueError(f"{folder}: '+' and ',' separate the players of a mixture: choose a folder without them")
        self.settings, self.folder, self._train = settings, folder, train
        self._engine: Engine = Here() if engine is None else engine
        path = folder / SETTINGS_FILE
        if path.exists():
            _check_same(path, settings.content())
        else:
            check_players(settings.duel, settings.spoofers, settings.defenders)
            files.write_json(path, settings.content())
        self._store = CellStore(folder / "cells", settings.duel, settings.games, settings.seed)
        self._cells = self._begin()

    def _begin(self) -> Allotment:
        """No cell has been given any games."""
        assert self.settings.most_games is not None
        return Allotment(self._store, self.settings.most_games, self._engine)

    def play(self, notify: Notify = lambda _: None) -> list[Round]:
        """Play all rounds; what each found.

        Args:
            notify: told what is done.

        Raises:
            ValueError: a player does not fit, a file is damaged, or a frozen policy has been changed.
        """
        players = {SPOOFER: list(self.settings.spoofers), DEFENDER: list(self.settings.defenders)}
        frozen = self._frozen()
        self._cells = self._begin()
        rounds: list[Round] = []
        for number in range(self.settings.rounds + 1):
            solved = self._solve(number, players, notify)
            self._check_frozen(solved.weights, frozen)
            if number < self.settings.rounds:
                solved = replace(solved, gains=self._respond(number, players, solved, notify))
            rounds.append(solved)
            files.write_json(self.folder / ROUNDS_FILE, [each.content() for each in rounds])
        return rounds

    def _solve(self, number: int, players: dict[str, list[str]], notify: Notify) -> Round:
        """Fill the matrix, with more games where they decide who is mixed in, and solve it."""
        spoofers, defenders = players[SPOOFER], players[DEFENDER]
        meta = self.settings.meta
        solve = META_STRATEGIES[meta]
        cells = self._cells.settle(spoofers, defenders, lambda mean: CONTESTS[meta](mean, solve(mean)), notify)
        mean, played = np.array([[cell.mean for cell in row] for row in cells]), harms(cells)
        mixtures = solve(mean)
        notify(f"round {number}: value {mixtures.value:.4g}")
        policies = [player for player in (*spoofers, *defenders) if player.startswith(POLICY)]
        return Round(
            number,
            tuple(spoofers),
            tuple(defenders),
            mean,
            np.array([[0.5 * float(np.subtract(*cell.interval[::-1])) for cell in row] for row in cells]),
            np.isfinite(played).sum(axis=2),
            mixtures,
            value_interval(played, self.settings.seed, self.settings.resamples),
            nash_conv(mean, mixtures.spoofers, mixtures.defenders),
            exploitability(mean),
            {},
            {player: load_policy(policy_folder(player)).weights_digest for player in policies},
        )

    def _respond(
        self, number: int, players: dict[str, list[str]], solved: Round, notify: Notify
    ) -> dict[str, dict[str, Any]]:
        """Train a best response of each side, and take in those that gain; what each gained."""
        mixtures = solved.mixtures
        opponents = {
            SPOOFER: mixture(players[DEFENDER], mixtures.defenders),
            DEFENDER: mixture(players[SPOOFER], mixtures.spoofers),
        }
        tasks = []
        for place, (side, pool) in enumerate(opponents.items()):
            seed = int(np.random.SeedSequence((self.settings.seed, number, place)).generate_state(1)[0])
            run = self.folder / "policies" / f"{side}-{number + 1}"
            name = f"round {number + 1}: a {side} is trained against {pool}"
            tasks.append(Task(name, self._train, (side, pool, run, seed)))
        trained = dict(zip(opponents, self._engine.run(tasks, notify), strict=True))
        gains = {side: self._gain(side, new, solved, notify) for side, new in trained.items()}
        for side, gain in gains.items():
            if gain["joins"]:
                players[side].append(gain["player"])
        return gains

    def _gain(self, side: str, new: str, solved: Round, notify: Notify) -> dict[str, Any]:
        """What a new player gains against the mixture of the other side, over the mixture of its own."""
        spoofers, own = _met(solved.spoofers, solved.mixtures.spoofers)
        defenders, other = _met(solved.defenders, solved.mixtures.defenders)
        if side == SPOOFER:
            weights = np.outer([*-own, 1.0], other)
            spoofers.append(new)
        else:
            weights = np.outer(own, [*other, -1.0])
            defenders.append(new)
        contest = Contest(weights, None)
        gained = paired(self._cells.settle(spoofers, defenders, lambda _: [contest], notify), weights)
        low, high = mean_interval(gained)
        return {
            "player": new,
            "gain": float(gained.mean()),
            "gain_ci95": [low, high],
            "games": len(gained),
            "joins": bool(low > ROUNDING * solved.mean.max()),
        }

    def _frozen(self) -> dict[str, str]:
        """Digests of the policies of rounds that have been played."""
        path = self.folder / ROUNDS_FILE
        if not path.exists():
            return {}
        with files.reading(path):
            rounds = json.loads(path.read_text(encoding="utf-8"))
            if not isinstance(rounds, list):
                raise ValueError("it is no list of rounds")
            return {player: str(digest) for each in rounds for player, digest in each["weights"].items()}

    def _check_frozen(self, weights: dict[str, str], frozen: dict[str, str]) -> None:
        for player, digest in weights.items():
            if frozen.get(player, digest) != digest:
                raise ValueError(f"{player} is not the policy that this league has played: its weights have changed")


def _met(players: Sequence[str], weights: Floats) -> tuple[list[str], Floats]:
    """The players of a side that are mixed in, and how often."""
    return [name for name, weight in zip(players, weights.tolist(), strict=True) if weight], weights[weights > 0.0]


def mixture(players: Sequence[str], weights: Floats) -> str:
    """A side's mixture as a pool that every game draws from; a single player as it is.

    Args:
        players: of the side.
        weights: probability of each, (n,).
    """
    pairs = [(name, weight) for name, weight in zip(players, weights.tolist(), strict=True) if weight >= LEAST_WEIGHT]
    if len(pairs) == 1:
        return pairs[0][0]
    parts = [name if name.startswith(POLICY) else nest(name) for name, _ in pairs]
    return f"pool:{'+'.join(parts)},weights={'+'.join(f'{weight:.6g}' for _, weight in pairs)}"


def _check_same(path: Path, content: dict[str, Any]) -> None:
    """Refuse a folder that holds another league.

    Raises:
        ValueError: naming the version, or the first setting that differs.
    """
    with files.reading(path):
        found = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(found, dict):
            raise ValueError("it does not say what a league is")
        version = found.get("schema_version")
        found.setdefault("most_games", found.get("games"))  # the first leagues had as many in every cell
    if version != SCHEMA_VERSION:
        raise ValueError(f"{path} is of version {version!r}; this program plays version {SCHEMA_VERSION}")
    flat, wanted = _flat(found), _flat(content)
    for name in sorted(set(flat) | set(wanted)):
        if flat.get(name) != wanted.get(name) and name != "rounds" and name != "duel.threads":
            raise ValueError(
                f"{path.parent} holds another league: its {name} is {flat.get(name)!r}, not {wanted.get(name)!r}"
            )
    files.write_json(path, content)


def _flat(content: dict[str, Any]) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for name, value in content.items():
        if isinstance(value, dict):
            result |= {f"{name}.{inner}": each for inner, each in value.items()}
        else:
            result[name] = value
    return result
