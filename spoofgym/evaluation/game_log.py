"""What came of every single game of an evaluation, for a file: game i is seeded ``seed + i`` for every player."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spoofgym import files

ENDING = ".npz"


class GameLog:
    """Keeps the figures of each game of each player.

    A file of it holds arrays only: ``players``, ``seeds``, and for each figure an array (players, games); where games
    are of several populations, each name begins with that of the population and a dot.
    """

    def __init__(self, seed: int) -> None:
        """Begin with nothing; ``seed`` is that of game 0."""
        self._seed = seed
        self._noted: dict[str, dict[str, dict[str, NDArray[Any]]]] = {}

    def note(self, player: str, population: str = "", **figures: ArrayLike) -> None:
        """Keep the figures of a player's games.

        Args:
            player: its name.
            population: of attacks on it; empty = there is one only.
            figures: by their names, (n,).
        """
        self._noted.setdefault(population, {})[player] = {name: np.asarray(each) for name, each in figures.items()}

    def of(self, player: str, figure: str, population: str = "") -> NDArray[Any]:
        """A figure of a player's games, (n,)."""
        return self._noted[population][player][figure]

    def arrays(self) -> dict[str, NDArray[Any]]:
        """What a file holds."""
        found: dict[str, NDArray[Any]] = {}
        for population, players in self._noted.items():
            before = f"{population}." if population else ""
            figures = {name: [figures[name] for figures in players.values()] for name in next(iter(players.values()))}
            games = len(next(iter(figures.values()))[0])
            found[f"{before}players"] = np.array(list(players))
            found[f"{before}seeds"] = self._seed + np.arange(games)
            found |= {f"{before}{name}": np.stack(each) for name, each in figures.items()}
        return found

    def write(self, path: Path) -> None:
        """Write the file, whole or not at all.

        Raises:
            OSError: it cannot be written.
        """
        packed = io.BytesIO()
        arrays: dict[str, Any] = self.arrays()
        np.savez_compressed(packed, **arrays)
        files.write_bytes(path, packed.getvalue())
