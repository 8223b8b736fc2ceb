"""Run folders of policies with arbitrary weights, for tests of whoever loads one."""

import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.spoofer_game import SpooferGame
from spoofgym.policies.learned import CONFIG_FILE, LearnedDefender, LearnedSpoofer


def network(entries: int, outputs: int, seed: int, size: float = 0.3) -> tuple[Any, Any]:
    rng = np.random.default_rng(seed)
    sizes = [entries, 8, outputs]
    weights = tuple(size * rng.normal(size=(b, a)).astype(np.float32) for a, b in itertools.pairwise(sizes))
    return weights, tuple(rng.normal(size=b).astype(np.float32) for b in sizes[1:])


def saved(policy: Any, configuration: dict[str, Any], folder: Path) -> str:
    folder.mkdir()
    policy.save(folder)
    (folder / CONFIG_FILE).write_text(json.dumps({"environment": configuration}))
    return f"policy:{folder}"


def spoofer(configuration: dict[str, Any], folder: Path) -> str:
    """A run folder of a spoofer with arbitrary weights, as it is spelled."""
    given = {name: tuple(value) if isinstance(value, list) else value for name, value in configuration.items()}
    game = SpooferGame(SpooferConfig(**given), 1)
    layout = tuple(field.name for field in game.fields)
    parts = network(len(layout), game.seat.space.shape[0], 1)
    return saved(LearnedSpoofer(folder, configuration, layout, *parts), configuration, folder)


def defender(configuration: dict[str, Any], folder: Path, seed: int = 3) -> str:
    """A run folder of a defender with arbitrary weights, as it is spelled."""
    game = DefenderGame(DefenderConfig(**configuration), 1)
    layout = tuple(field.name for field in game.fields)
    parts = network(len(layout), int(game.seat.space.nvec.sum()), seed, 3.0)
    return saved(LearnedDefender(folder, configuration, layout, *parts), configuration, folder)
