"""Legal steps: numbers stay finite, copies agree with their originals, threads do not count.

``fuzz(seed, steps)`` plays vector environments with parts drawn from the registries, until that many steps of lanes are
made, and gives the broken promises, one text each.
"""

from __future__ import annotations

import copy
import inspect
import pickle
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from spoofgym.attacks import ATTACKS
from spoofgym.detectors import DETECTORS
from spoofgym.envs.vector import DefenderVectorEnv, SpooferVectorEnv
from spoofgym.responses import RESPONSES

SCENARIOS = {
    "liu-flight:horizon=30,onset=300": ("linear", "strapdown"),
    "liu-flight:horizon=30,onset=300,imu=industrial": ("linear", "strapdown"),
    "liu-flight:horizon=30,onset=300,coupling=tight": ("linear", "strapdown"),
    "foi-drive:horizon=30": ("linear", "strapdown"),
    "kujur-flight:horizon=30,onset=60": ("linear", "strapdown"),
    "kujur-flight:horizon=30,onset=60,imu=industrial": ("linear", "strapdown"),
    "shadmehri-flight:filter=self-tuning,window=10,guard=all": ("linear", "strapdown"),
    "song-robot": ("linear",),
}
ROUNDS = 45
"""Steps of a game: more than an episode, so that lanes begin anew."""
COPYING = {"deepcopy": copy.deepcopy, "pickle": lambda env: pickle.loads(pickle.dumps(env))}


@dataclass(frozen=True)
class Game:
    """What is played.

    Attributes:
        kind: of the environment.
        lanes: N.
        arguments: of the environment.
        seed: of its reset and its actions.
        style: how the actions are drawn.
    """

    kind: type
    lanes: int
    arguments: dict[str, Any]
    seed: int
    style: str

    @property
    def words(self) -> str:
        """The game, to play it again."""
        options = ", ".join(f"{key}={value!r}" for key, value in self.arguments.items())
        return f"{self.kind.__name__}({self.lanes}, {options}), reset(seed={self.seed}), {self.style} actions"


def fuzz(seed: int, steps: int) -> list[str]:
    """Play until ``steps`` steps of lanes have been made; the broken promises."""
    rng = np.random.default_rng(seed)
    broken, made = [], 0
    while made < steps:
        game = draw(rng)
        played, words = play(game, rng)
        made += max(played, 1)
        if words is not None:
            broken.append(f"{game.words}: {words}")
    return broken


def draw(rng: np.random.Generator) -> Game:
    """A game of parts from the registries; they need not fit each other."""
    scenario = str(rng.choice(list(SCENARIOS)))
    spoofer = rng.random() < 0.5
    arguments: dict[str, Any] = {
        "scenario": scenario,
        "fidelity": str(rng.choice(SCENARIOS[scenario])),
        "threads": int(rng.integers(1, 4)),
        "autoreset_mode": str(rng.choice(["NextStep", "SameStep"])),
    }
    if spoofer:
        arguments |= {
            "detector": tuple({_detector(rng) for _ in range(rng.integers(1, 4))}),
            "knowledge": str(rng.choice(["blind", "shadow", "full"])),
            "on_alarm": str(rng.choice(["end", "respond"])),
            "response": str(rng.choice(list(RESPONSES))),
            "tracking_sigma": float(rng.choice([0.0, 0.5])),
            "frames": int(rng.integers(1, 4)),
        }
    else:
        names = [name for name in ATTACKS if _plain(ATTACKS[name])]
        arguments |= {
            "detectors": tuple({_detector(rng) for _ in range(rng.integers(1, 4))}),
            "attacks": str(rng.choice([*names, "jump:1e4", "ramp:100"])),
            "clean": 0.2,
        }
    style = str(rng.choice(["any", "extreme", "held", "alternating"]))
    kind = SpooferVectorEnv if spoofer else DefenderVectorEnv
    return Game(kind, int(rng.integers(1, 6)), arguments, int(rng.integers(2**31)), style)


def _plain(factory: Callable[..., Any]) -> bool:
    """Whether a part can be made without any argument."""
    return all(p.default is not p.empty for p in inspect.signature(factory).parameters.values())


def _detector(rng: np.random.Generator) -> str:
    """A detector with a threshold of its own: a calibration takes long."""
    names = [name for name, made in DETECTORS.items() if "threshold" in inspect.signature(made).parameters]
    return f"{rng.choice(names)}:threshold={float(rng.choice([1e3, 1e9]))!r}"


def play(game: Game, rng: np.random.Generator) -> tuple[int, str | None]:
    """Play a game; the steps that were made, and what is wrong, if anything is."""
    try:
        env = game.kind(game.lanes, **game.arguments)
    except ValueError:  # parts that do not fit each other are refused
        return 0, None
    made = 0
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            actions = _actions(game, env)
            copied_at, how = int(rng.integers(1, ROUNDS)), str(rng.choice(list(COPYING)))
            trace, twin = [env.reset(seed=game.seed)[0].copy()], None
            for k, action in enumerate(actions):
                if k == copied_at:
                    twin = COPYING[how](env)
                result = env.step(action)
                made += game.lanes
                _check_finite(env, result)
                trace.append(np.concatenate([result[0].ravel(), result[1]]))
                if twin is not None:
                    other = twin.step(action)
                    assert np.array_equal(result[0], other[0]), f"a copy by {how} before step {k} sees other things"
                    assert np.array_equal(result[1], other[1]), f"a copy by {how} before step {k} is paid otherwise"
            if rng.random() < 0.3:
                _check_threads(game, actions, trace)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        return made, f"{type(error).__name__}: {str(error)[:400]}"
    return made, None


def _actions(game: Game, env: Any) -> list[np.ndarray]:
    """Of all rounds, within the action space."""
    rng = np.random.default_rng(game.seed)
    env.action_space.seed(game.seed)
    drawn = [env.action_space.sample() for _ in range(ROUNDS)]
    if drawn[0].dtype.kind != "f":
        return drawn if game.style != "held" else [np.zeros_like(drawn[0])] * ROUNDS
    if game.style == "extreme":
        return [np.sign(action) for action in drawn]
    if game.style == "held":
        return [np.float32(rng.choice([0.01, 0.1, 1.0])) * drawn[0]] * ROUNDS
    if game.style == "alternating":
        return [drawn[0] * np.float32((-1.0) ** k) for k in range(ROUNDS)]
    return drawn


def _check_finite(env: Any, result: tuple[Any, ...]) -> None:
    observation, reward, _, _, info = result
    assert env.observation_space.contains(observation), "an observation outside its space"
    assert np.isfinite(reward).all(), "a reward that is not finite"
    _check_values(info, "info")
    simulation = env.game.simulation
    for values in (simulation.error, simulation.epoch.innovation.nis, *simulation.epoch.statistics.values()):
        assert np.isfinite(values).all(), "an error or a statistic that is not finite"


def _check_values(value: Any, name: str) -> None:
    if isinstance(value, dict):
        for key, part in value.items():
            _check_values(part, f"{name}[{key!r}]")
    elif isinstance(value, np.ndarray) and value.dtype.kind == "f":
        assert np.isfinite(value).all(), f"{name} is not finite"


def _check_threads(game: Game, actions: list[np.ndarray], trace: list[np.ndarray]) -> None:
    """The game again, on other threads."""
    env = game.kind(game.lanes, **{**game.arguments, "threads": 4 - game.arguments["threads"]})
    assert np.array_equal(env.reset(seed=game.seed)[0], trace[0]), "another number of threads begins otherwise"
    for k, (action, expected) in enumerate(zip(actions, trace[1:], strict=True)):
        observation, reward, *_ = env.step(action)
        given = np.concatenate([observation.ravel(), reward])
        assert np.array_equal(given, expected), f"another number of threads gives another step {k}"
