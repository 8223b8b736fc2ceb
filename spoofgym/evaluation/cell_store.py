"""Cells of a payoff matrix on disk: each game is played once, whoever asks for it and however often it is killed.

Game i of a cell is the same however many there are, so a cell is asked for its first games, and may grow.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym import files
from spoofgym.archive import read_arrays
from spoofgym.evaluation.duels import Cell, play_cell
from spoofgym.evaluation.engine import Engine, Notify, Task
from spoofgym.policies.learned import load_policy
from spoofgym.policies.published import POLICY, policy_folder

Play = Callable[[Any, str, str, int, int], Cell]
"""Plays games: the arguments of `play_cell`, the configuration of any kind of game first."""


class CellStore:
    """The cells of one game, in a folder."""

    def __init__(self, folder: Path, config: Any, games: int, seed: int, play: Play = play_cell) -> None:
        """Keep cells in ``folder``.

        Args:
            folder: is made where there is none.
            config: arguments of the game, a data class of plain values, with the detectors of all players.
            games: that each cell has at least.
            seed: of game 0 of each cell.
            play: plays games of this configuration, by default those of a duel; a function of a module.
        """
        self._folder, self._config, self._games, self._seed, self._play = folder, config, games, seed, play

    @property
    def games(self) -> int:
        """That each cell has at least."""
        return self._games

    def cell(self, spoofer: str, defender: str, games: int | None = None) -> Cell:
        """The first games of a spoofer against a defender, from the folder, or played now where they are not there.

        Args:
            spoofer: its specification.
            defender: its specification.
            games: how many, at least those that each cell has; None = those.

        Raises:
            ValueError: a player that is unknown or does not fit, or a damaged file.
        """
        games = self._games if games is None else games
        path = self._path(spoofer, defender)
        kept = self._read(path, spoofer, defender)
        there = 0 if kept is None else len(kept.harm)
        if kept is None or there < games:
            played = self._play(self._config, spoofer, defender, games - there, self._seed + there)
            kept = played if kept is None else kept.followed_by(played)
            packed = io.BytesIO()
            np.savez(packed, harm=kept.harm, clean=kept.clean)
            files.write_bytes(path, packed.getvalue())
        return kept.first(games)

    def fill(self, wanted: Mapping[tuple[str, str], int], engine: Engine, notify: Notify) -> None:
        """Play what is lacking of some cells.

        Args:
            wanted: how many games each cell, a spoofer and a defender, is to have.
            engine: plays them.
            notify: told each cell that is played.

        Raises:
            ValueError: as `cell`.
            RuntimeError: a failure of the engine.
        """
        engine.run(self.lacking(wanted), notify)

    def lacking(self, wanted: Mapping[tuple[str, str], int]) -> list[Task]:
        """A task for each cell that has fewer games than are wanted; it plays them and keeps them.

        Args:
            wanted: how many games each cell, a spoofer and a defender, is to have.

        Raises:
            ValueError: a file is damaged, or a policy cannot be read.
        """
        tasks = []
        for (spoofer, defender), games in wanted.items():
            kept = self._read(self._path(spoofer, defender), spoofer, defender)
            there = 0 if kept is None else len(kept.harm)
            if there < games:
                which = f", games {there} to {games - 1}" if there else ""
                tasks.append(Task(f"{spoofer} against {defender}{which}", _keep, (self, spoofer, defender, games)))
        return tasks

    def matrix(
        self, spoofers: Sequence[str], defenders: Sequence[str], engine: Engine, notify: Notify
    ) -> list[list[Cell]]:
        """The cells of every spoofer (a row each) against every defender (a column each), as many games in each.

        Args:
            spoofers: specifications.
            defenders: specifications.
            engine: plays what has not been played.
            notify: told each cell that is played.

        Raises:
            ValueError: as `cell`.
            RuntimeError: a failure of the engine.
        """
        self.fill({(one, two): self._games for one in spoofers for two in defenders}, engine, notify)
        return [[self.cell(one, two) for two in defenders] for one in spoofers]

    def _path(self, spoofer: str, defender: str) -> Path:
        return self._folder / f"{self._key(spoofer, defender)}.npz"

    def _read(self, path: Path, spoofer: str, defender: str) -> Cell | None:
        """All games of a file; None where there is none.

        Raises:
            ValueError: it is damaged.
        """
        if not path.exists():
            return None
        arrays = read_arrays(path)
        with files.reading(path):
            if not {"harm", "clean"} <= set(arrays):
                raise ValueError("it lacks the harm of its games, or which of them are clean")
            harm, clean = arrays["harm"], arrays["clean"]
            right = harm.ndim == 1 and harm.shape == clean.shape and len(harm) >= self._games
            if not right or clean.dtype != np.bool_ or not np.isfinite(harm).all():
                raise ValueError(f"it does not hold the harm of {self._games} games")
            return Cell(spoofer, defender, harm.astype(np.float64), clean)

    def _key(self, spoofer: str, defender: str) -> str:
        """Digest of all that decides the games."""
        duel = {name: value for name, value in asdict(self._config).items() if name != "threads"}
        content = [duel, self._games, self._seed, _identity(spoofer), _identity(defender)]
        return hashlib.sha256(json.dumps(content, default=str, sort_keys=True).encode()).hexdigest()[:32]


def _keep(store: CellStore, spoofer: str, defender: str, games: int) -> None:
    """Play games that stay on disk; nothing of them has to travel between processes."""
    store.cell(spoofer, defender, games)


def _identity(player: str) -> Any:
    """What decides how a player plays: its specification, or the weights of a policy and what it was trained on.

    A policy within another specification is told by its name alone.
    """
    if not player.startswith(POLICY):
        return player
    policy = load_policy(policy_folder(player))
    return [policy.weights_digest, dict(policy.configuration)]
