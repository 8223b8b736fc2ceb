"""Golden episodes of the environments: what a player sees, is paid and is told."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np

import spoofgym  # noqa: F401 - registers the environments
from spoofgym.envs.vector import DefenderVectorEnv, SpooferVectorEnv

Arrays = dict[str, np.ndarray]
Case = tuple[str, dict[str, Any]]
LANES, SEED, STEPS = 2, 3, 30
SPOOFER, DEFENDER = "Spoofer-v0", "Defender-v0"
WINDOWS = ("windowed:n=5,threshold=60", "relative-motion:k=5,preset=foi", "cusum:threshold=40")
RANGES = ("windowed:n=5,threshold=600", "separation-bank:n=10", "raim:p_fa=1e-6")
TUNED = "shadmehri-flight:self-tuning,onset=27"
DRIVE, FLIGHT, SKY = "foi-drive:horizon=22", "liu-flight:horizon=22,onset=300", "kujur-flight:horizon=42,onset=60"
TOLD = ("error", "alarm", "used", "coast", "backtrack", "protection_level", "mean_error")
"""Entries of `info` that are kept where they are there."""

CASES: dict[str, Case] = {
    "spoofer default": (SPOOFER, {}),
    "spoofer blind": (SPOOFER, {"scenario": FLIGHT, "knowledge": "blind"}),
    "spoofer full": (SPOOFER, {"scenario": FLIGHT, "detector": WINDOWS, "on_alarm": "respond", "knowledge": "full"}),
    "spoofer innovation": (
        SPOOFER,
        {"scenario": FLIGHT, "frames": 3, "tracking_sigma": 1.0, "tracking_time": 4.0, "action": "innovation"},
    ),
    "spoofer strapdown": (
        SPOOFER,
        {"scenario": FLIGHT, "fidelity": "strapdown", "on_alarm": "respond", "response": "px4-auto"},
    ),
    "spoofer wrong shadow": (SPOOFER, {"scenario": FLIGHT, "shadow": "liu-flight:horizon=22,onset=300,imu=tactical"}),
    "spoofer tight": (SPOOFER, {"scenario": SKY, "detector": RANGES, "on_alarm": "respond", "knowledge": "full"}),
    "spoofer tight flight": (SPOOFER, {"scenario": FLIGHT, "coupling": "tight"}),
    "spoofer tight strapdown": (
        SPOOFER,
        {"scenario": SKY, "fidelity": "strapdown", "on_alarm": "respond", "response": "exclude-satellites"},
    ),
    "spoofer robot": (
        SPOOFER,
        {"scenario": "song-robot:horizon=22", "on_alarm": "respond", "detector": "windowed:n=5,threshold=60"},
    ),
    "spoofer tuned": (SPOOFER, {"scenario": TUNED, "on_alarm": "respond", "detector": "snapshot:threshold=50"}),
    "spoofer tuned strapdown": (
        SPOOFER,
        {"scenario": TUNED, "fidelity": "strapdown", "on_alarm": "respond", "detector": "snapshot:threshold=50"},
    ),
    "defender default": (DEFENDER, {}),
    "defender": (DEFENDER, {"scenario": DRIVE, "detectors": WINDOWS}),
    "defender strapdown": (
        DEFENDER,
        {"scenario": DRIVE, "detectors": WINDOWS, "attacks": "held-out", "fidelity": "strapdown"},
    ),
    "defender tight": (DEFENDER, {"scenario": SKY, "detectors": RANGES}),
    "defender tight strapdown": (DEFENDER, {"scenario": SKY, "detectors": RANGES, "fidelity": "strapdown"}),
}


def actions(space: gym.Space, steps: int) -> list[Any]:
    """Small offsets, or decisions of which every fourth is drawn and the others are to use."""
    space.seed(1)
    drawn = [space.sample() for _ in range(steps)]
    if drawn[0].dtype.kind == "f":
        return [(0.1 * action).astype(np.float32) for action in drawn]
    return [action if step % 4 == 0 else 0 * action for step, action in enumerate(drawn)]


def play(case: Case) -> Arrays:
    """Some steps of all lanes, over the end of a game where it comes."""
    kind = SpooferVectorEnv if case[0] == SPOOFER else DefenderVectorEnv
    env = kind(LANES, **case[1])
    observation, info = env.reset(seed=SEED)
    game: Any = env.game
    thresholds = np.array([detector.threshold for detector in game.simulation.detectors.values()], dtype=np.float64)
    seen: list[Arrays] = [{"observation": np.array(observation)} | _told(info)]
    for action in actions(env.action_space, STEPS):
        observation, reward, terminated, truncated, info = env.step(action)
        step = {"observation": observation, "reward": reward, "terminated": terminated, "truncated": truncated}
        seen.append({name: np.array(values) for name, values in step.items()} | _told(info))
    env.close()
    names = {name for step in seen for name in step}
    arrays = {name: np.array([step[name] for step in seen if name in step]) for name in sorted(names)}
    return arrays | {"thresholds": thresholds}


def _told(info: dict[str, Any]) -> Arrays:
    return {f"info {name}": np.array(info[name], dtype=np.float64) for name in TOLD if name in info}


def alone(name: str) -> Arrays:
    """A single environment with its default arguments."""
    env = gym.make(f"spoofgym/{name}")
    observation, info = env.reset(seed=SEED)
    seen = [np.array(observation)]
    rewards, errors = [], [float(info["error"])]
    for action in actions(env.action_space, STEPS):
        observation, reward, terminated, truncated, info = env.step(action)
        seen.append(np.array(observation))
        rewards.append(float(reward))
        errors.append(float(info["error"]))
        if terminated or truncated:
            break
    env.close()
    return {"observation": np.array(seen), "reward": np.array(rewards), "info error": np.array(errors)}


def episodes() -> dict[str, Callable[[], Arrays]]:
    """All golden games by their names."""
    games = {f"game {name}": partial(play, case) for name, case in CASES.items()}
    return games | {f"game alone {name}": partial(alone, name) for name in (SPOOFER, DEFENDER)}
