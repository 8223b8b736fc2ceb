"""Cells of a payoff matrix on disk: each is played once, whoever asks for it and however often a program is killed."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym import files
from spoofgym.archive import read_arrays
from spoofgym.envs.duel_config import DuelConfig
from spoofgym.evaluation.duels import Cell, play_cell
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

    def cell(self, spoofer: str, defender: str, notify: Callable[[str], None] = lambda _: None) -> Cell:
        """The games of a spoofer against a defender, from the folder or played now.

        Args:
            spoofer: its specification.
            defender: its specification.
            notify: told what is played.

        Raises:
            ValueError: a player that is unknown or does not fit, or a damaged file.
        """
        path = self._folder / f"{self._key(spoofer, defender)}.npz"
        if path.exists():
            return _read(path, spoofer, defender, self._games)
        notify(f"{spoofer} against {defender}")
        played = play_cell(self._config, spoofer, defender, self._games, self._seed)
        packed = io.BytesIO()
        np.savez(packed, harm=played.harm, clean=played.clean)
        files.write_bytes(path, packed.getvalue())
        return played

    def _key(self, spoofer: str, defender: str) -> str:
        """Digest of all that decides the games."""
        duel = {name: value for name, value in asdict(self._config).items() if name != "threads"}
        content = [duel, self._games, self._seed, _identity(spoofer), _identity(defender)]
        return hashlib.sha256(json.dumps(content, default=str, sort_keys=True).encode()).hexdigest()[:32]


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
