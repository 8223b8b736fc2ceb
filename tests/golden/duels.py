"""Golden episodes of the duel: a whole game of every scenario, a few lanes, both agents outside."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from spoofgym.envs.vector import DuelVectorEnv

Arrays = dict[str, np.ndarray]
LANES, SEED = 2, 5
WINDOWS = ("snapshot", "windowed:n=5,threshold=60")
CASES: dict[str, dict[str, Any]] = {
    "foi-drive": {"scenario": "foi-drive:horizon=40", "detectors": (*WINDOWS, "relative-motion:k=5,preset=foi")},
    "foi-drive strapdown": {"scenario": "foi-drive:horizon=22", "detectors": WINDOWS, "fidelity": "strapdown"},
    "liu-flight": {"scenario": "liu-flight:horizon=22,onset=300", "detectors": WINDOWS, "payoff": "beyond:2"},
    "liu-flight tactical": {"scenario": "liu-flight:horizon=22,onset=300,imu=tactical", "detectors": WINDOWS},
    "shadmehri-flight": {"scenario": "shadmehri-flight:onset=27", "detectors": "snapshot:threshold=50"},
    "kujur-flight": {"scenario": "kujur-flight:horizon=42,onset=60", "detectors": "windowed:n=5,threshold=600"},
    "song-robot": {"scenario": "song-robot:horizon=22", "detectors": "windowed:n=5,threshold=60"},
}


def play(arguments: dict[str, Any]) -> Arrays:
    """A game of all lanes to its end: slow offsets, and decisions of which every fourth is drawn, the others to use."""
    env = DuelVectorEnv(LANES, autoreset_mode="Disabled", knowledge="full", clean=0.0, **arguments)
    env.action_space.seed(1)
    observation, info = env.reset(seed=SEED)
    steps, step, over = [{**observation, "error": info["spoofer"]["error"]}], 0, np.zeros(LANES, dtype=bool)
    while not over.any():
        drawn = env.action_space.sample()
        decisions = drawn["defender"] if step % 4 == 0 else 0 * drawn["defender"]
        actions = {"spoofer": (0.1 * drawn["spoofer"]).astype(np.float32), "defender": decisions}
        observation, reward, over, _, info = env.step(actions)
        steps.append({**observation, "error": info["spoofer"]["error"], "reward": reward})
        step += 1
    names = ("spoofer", "defender", "error", "reward")
    arrays = {name: np.array([step[name] for step in steps if name in step]) for name in names}
    return arrays | {"harm": info["spoofer"]["harm"]}


def episodes() -> dict[str, Callable[[], Arrays]]:
    """All golden duels by their names."""
    return {f"duel {name}": partial(play, arguments) for name, arguments in CASES.items()}
