"""Cells of a payoff matrix on disk: each is played once, whoever asks for it and however often a program is killed."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym import files
from spoofgym.archive import read_arrays
from spoofgym.envs.duel_config import DuelConfig
from spoofgym.evaluation.duels import Cell, play_cell
from spoofgym.evaluation.engine import Engine, Task
from spoofgym.policies.learned import load_policy
from spoofgym.policies.published import POLICY, policy_folder


class CellStore:
    """The cells of one duel, in a folder."""

    def __init__(self, folder: Path, config: DuelConfig, games: int, seed: int) -> None:
        """Keep cells in ``folder``.

        Args:
            folder: is made where there is none.
            config: arguments of the duel, with the detectors of all players.
            games: of each cell.
            seed: of game 0 of each cell.
        """
        self._folder, self._config, self._games, self._seed = folder, config, games, seed

    def cell(self, spoofer: str, defender: str) -> Cell:
        """The games of a spoofer against a defender, from the folder or played now.

        Args:
            spoofer: its specification.
            defender: its specification.

        Raises:
            ValueError: a player that is unknown or does not fit, or a damaged file.
        """
        path = self._folder / f"{self._key(spoofer, defender)}.npz"
        if path.exists():
            return _read(path, spoofer, defender, self._games)
        played = play_cell(self._config, spoofer, defender, self._games, self._seed)
        packed = io.BytesIO()
        np.savez(packed, harm=played.harm, clean=played.clean)
        files.write_bytes(path, packed.getvalue())
        return played

    def holds(self, spoofer: str, defender: str) -> bool:
        """Whether the games of a cell have been played.

        Raises:
            ValueError: a policy that cannot be read.
        """
        return (self._folder / f"{self._key(spoofer, defender)}.npz").exists()

    def matrix(
        self, spoofers: Sequence[str], defenders: Sequence[str], engine: Engine, notify: Callable[[str], None]
    ) -> list[list[Cell]]:
        """The cells of every spoofer (a row each) against every defender (a column each).

        Args:
            spoofers: specifications.
            defenders: specifications.
            engine: plays what has not been played.
            notify: told each cell that is played.

        Raises:
            ValueError: as `cell`.
            RuntimeError: a failure of the engine.
        """
        missing = [(one, two) for one in spoofers for two in defenders if not self.holds(one, two)]
        engine.run([Task(f"{one} against {two}", _keep, (self, one, two)) for one, two in missing], notify)
        return [[self.cell(one, two) for two in defenders] for one in spoofers]

    def _key(self, spoofer: str, defender: str) -> str:
        """Digest of all that decides the games."""
        duel = {name: value for name, value in asdict(self._config).items() if name != "threads"}
        content = [duel, self._games, self._seed, _identity(spoofer), _identity(defender)]
        return hashlib.sha256(json.dumps(content, default=str, sort_keys=True).encode()).hexdigest()[:32]


def _keep(store: CellStore, spoofer: str, defender: str) -> None:
    """Play a cell that stays on disk; nothing of it has to travel between processes."""
    store.cell(spoofer, defender)


def _identity(player: str) -> Any:
    """What decides how a player plays: its specification, or the weights of a policy and what it was trained on.

    A policy within another specification is told by its name alone.
    """
    if not player.startswith(POLICY):
        return player
    policy = load_policy(policy_folder(player))
    return [policy.weights_digest, dict(policy.configuration)]


def _read(path: Path, spoofer: str, defender: str, games: int) -> Cell:
    arrays = read_arrays(path)
    with files.reading(path):
        harm, clean = arrays["harm"], arrays["clean"]
        if harm.shape != (games,) or clean.shape != (games,) or clean.dtype != np.bool_ or not np.isfinite(harm).all():
            raise ValueError(f"it does not hold the harm of {games} games")
        return Cell(spoofer, defender, harm.astype(np.float64), clean)
