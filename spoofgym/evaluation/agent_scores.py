"""What a policy is worth in an environment: a learned one in its own, as its card tells it, or any callable."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.detectors import make_detector
from spoofgym.envs.config import DefenderConfig, SpooferConfig, configure
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.duel_config import DuelDefenderConfig, DuelSpooferConfig
from spoofgym.envs.duel_game import DuelDefenderGame, DuelSpooferGame
from spoofgym.envs.spoofer_game import SpooferGame
from spoofgym.envs.trained import ENVIRONMENTS, AnyConfig, trained_on
from spoofgym.evaluation.episodes import Act, batches
from spoofgym.evaluation.metrics import mean_interval
from spoofgym.policies.card import Score
from spoofgym.policies.learned import LearnedDefender, LearnedSpoofer
from spoofgym.streams import RunStreams

LANES = 1000
"""Games that are played together; scores do not depend on it."""
GAMES = 4000
SEED = 3_000_000_000
"""Of game 0: far from the seeds of trainings, validations and studies."""
POPULATIONS = ("training", "held-out")
"""What a defender of Defender-v0 is scored against, the second never seen in training."""


def agent_scores(policy: LearnedSpoofer | LearnedDefender, games: int = GAMES, seed: int = SEED) -> tuple[Score, ...]:
    """Play a policy in its environment, against the opponents that belong there.

    Args:
        policy: who plays.
        games: against each opponent.
        seed: of game 0.

    Raises:
        ValueError: its environment cannot be built, or no games.
    """
    config = trained_on(policy)
    cases: list[AnyConfig] = [config]
    if isinstance(config, DefenderConfig):
        cases = [replace(config, attacks=population) for population in POPULATIONS]
    return tuple(_score(case, policy.act, games, seed) for case in cases)


def evaluate_policy(
    act: Act,
    env_arguments: Mapping[str, Any] | None = None,
    environment: str = "spoofgym/Spoofer-v0",
    games: int = GAMES,
    seed: int = SEED,
) -> Score:
    """Score any callable: in its environment, with a 95 % interval, on the games that everybody else meets.

    For example, of a policy of Stable-Baselines3::

        model = PPO.load("mine.zip")
        score = evaluate_policy(lambda o: model.predict(o, deterministic=True)[0], {"scenario": "liu-flight"})

    Args:
        act: actions for observations (N, D), float32, of N games at once. It is called once an epoch, also with the
            games that have ended.
        env_arguments: of the environment, as `gymnasium.make` takes them.
        environment: its id: spoofgym/Spoofer-v0, Defender-v0, DuelSpoofer-v0 or DuelDefender-v0.
        games: how many; game i is seeded ``seed + i``.
        seed: of game 0.

    Returns:
        The mean undetected error of a spoofer, the mean error of a defender, the harm of a duel.

    Raises:
        ValueError: an environment that is unknown or cannot be built, or no games.
    """
    validation.one_of("evaluate_policy", "environment", environment, tuple(ENVIRONMENTS))
    return _score(configure(ENVIRONMENTS[environment], dict(env_arguments or {})), act, games, seed)


def _score(config: AnyConfig, act: Act, games: int, seed: int) -> Score:
    opponent, metric, unit = measured(config)
    values = play_games(config, act, games, seed)
    return Score(opponent, metric, unit, float(values.mean()), mean_interval(values), games, seed)


def play_games(config: AnyConfig, act: Act, games: int, seed: int) -> Floats:
    """What each game of a policy is worth, (games,): undetected error, mean error or harm.

    Args:
        config: of the environment that it plays in.
        act: actions for observations (N, D).
        games: how many; game i is seeded ``seed + i``.
        seed: of game 0.

    Raises:
        ValueError: the environment cannot be built, or no games.
    """
    return np.concatenate([_play(_game(config, streams), act) for streams in batches(games, seed, LANES)])


def measured(config: AnyConfig) -> tuple[str, str, str]:
    """Opponent, metric and unit of a score."""
    if isinstance(config, SpooferConfig):
        given = config.detector if isinstance(config.detector, tuple) else (config.detector,)
        names = " + ".join(make_detector(part).name for part in given)
        if config.on_alarm == "end":
            return names, "mean undetected error", "m"
        return f"{names} > {_text(config.response)}", "mean final error", "m"
    if isinstance(config, DefenderConfig):
        return _text(config.attacks), "mean error", "m"
    unit = "share of epochs" if config.payoff.startswith("beyond") else "m"
    return _text(config.defender if isinstance(config, DuelSpooferConfig) else config.spoofer), "harm", unit


def _text(part: Any) -> str:
    """The specification of a part, or of the members of a pool."""
    if isinstance(part, str):
        return part
    if isinstance(part, tuple):
        return " + ".join(_text(item[0]) if isinstance(item, tuple) else _text(item) for item in part)
    return str(part.name)


def _game(config: AnyConfig, streams: RunStreams) -> Any:
    kinds: dict[type, Callable[..., Any]] = {
        SpooferConfig: SpooferGame,
        DefenderConfig: DefenderGame,
        DuelSpooferConfig: DuelSpooferGame,
        DuelDefenderConfig: DuelDefenderGame,
    }
    return kinds[type(config)](config, len(streams), streams=streams)


def _play(game: Any, act: Act) -> Floats:
    """What each of N games is worth, taken when it ends, (N,)."""
    everyone = np.arange(game.num_lanes)
    game.reset(everyone)
    worth, over = np.zeros(len(everyone)), np.zeros(len(everyone), dtype=bool)
    while not over.all():
        outcome = game.step(act(game.observation()))
        ended = outcome.terminated & ~over
        if ended.any():
            worth[ended] = _worth(game, game.end_values(outcome))[ended]
        over |= outcome.terminated
    return worth


def _worth(game: Any, told: dict[str, Any]) -> Floats:
    for name in ("harm", "mean_error"):
        if name in told:
            return np.asarray(told[name])
    error: Floats = game.error
    if game.config.on_alarm == "end":
        return np.where(told["outcome"] == "undetected", error, 0.0)
    return error
