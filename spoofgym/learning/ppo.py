"""PPO on the native vector environment: its settings, and the policy it leaves behind.

A minibatch of SB3's default size trains at 4,000 steps/s, one of a few thousand at 30,000 and more: the update is the
cost, so the rollout is one whole game of many lanes, cut into a few large minibatches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv, VecMonitor

from spoofgym.envs.config import SpooferConfig, arguments_of
from spoofgym.envs.duel_config import DuelSpooferConfig
from spoofgym.envs.sb3 import SB3VecEnv
from spoofgym.envs.vector import DuelSpooferVectorEnv, SpooferVectorEnv
from spoofgym.learning import limits
from spoofgym.learning.expected_alarm import ExpectedAlarmVectorEnv, alarm_probability_is_known
from spoofgym.learning.scaled_rewards import ScaledRewards, duel_factor
from spoofgym.policies.learned import LearnedSpoofer

AnySpooferConfig = SpooferConfig | DuelSpooferConfig
SCRIPTED_START: dict[str, Any] = {"scripted": True, "trials": 1, "lanes": 128, "log_std": -3.0, "learning_rate": 1e-3}
"""Settings of a training that begins with a scripted attack: noise of the usual size would give the attack away."""
LAST_RATE = 0.02
"""Share of the learning rate at which its fall ends: the last rollout overshoots the number of steps."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the learner.

    Attributes:
        lanes: games played at once.
        trials: short trainings from different beginnings, an eighth of the steps each, of which the best goes on.
        minibatches: of a rollout, which is one whole game of every lane.
        epochs: passes over a rollout.
        learning_rate: at the start; falls linearly to almost zero at the last step.
        log_std: of the policy at the start.
        gae_lambda: of the advantage estimate; the discount is 1, since the game is finite.
        clip_range: of the policy ratio.
        max_grad_norm: at which the gradient of a minibatch is clipped.
        hidden: width of the two hidden layers of policy and value.
        scripted: begin with the best scripted or optimal attack (`spoofgym.learning.scripted_start`), in a duel.
        critic_games: games of every lane in which only the critic learns, after that.
    """

    lanes: int = 256
    trials: int = 3
    minibatches: int = 8
    epochs: int = 10
    learning_rate: float = 2e-3
    log_std: float = -1.5
    gae_lambda: float = 0.99
    clip_range: float = 0.2
    max_grad_norm: float = 10.0
    hidden: int = 64
    scripted: bool = False
    critic_games: int = 2

    def __post_init__(self) -> None:
        """Refuse a number that is none of a training.

        Raises:
            ValueError: naming the setting.
        """
        limits.check(
            self,
            limits.PPO
            | {
                "scripted": limits.SWITCH,
                "critic_games": limits.whole(0, 10_000),
                "trials": limits.whole(1, 1000),
                "log_std": limits.real(-20.0, 20.0),
                "max_grad_norm": limits.real(0.0, 1e6),
            },
        )


def make_learner(config: AnySpooferConfig, settings: Settings, seed: int, folder: Path) -> PPO:
    """A PPO learner on ``settings.lanes`` lanes of the game, seeded; TensorBoard writes into ``folder``."""
    vector = _lanes(config, settings.lanes)
    horizon = vector.game.scenario.timeline.num_epochs
    environment: VecEnv = VecMonitor(SB3VecEnv(vector))
    if isinstance(config, DuelSpooferConfig):
        environment = ScaledRewards(environment, duel_factor(config, vector.game.scenario) / horizon)
    return PPO(
        "MlpPolicy",
        environment,
        n_steps=horizon,
        batch_size=max(1, settings.lanes * horizon // settings.minibatches),
        n_epochs=settings.epochs,
        learning_rate=lambda remaining: settings.learning_rate * max(remaining, LAST_RATE),
        gamma=1.0,
        gae_lambda=settings.gae_lambda,
        clip_range=settings.clip_range,
        max_grad_norm=settings.max_grad_norm,
        policy_kwargs={"net_arch": [settings.hidden, settings.hidden], "log_std_init": settings.log_std},
        tensorboard_log=str(folder / "tensorboard"),
        seed=seed,
        device="cpu",
    )


def _lanes(config: AnySpooferConfig, lanes: int) -> SpooferVectorEnv | DuelSpooferVectorEnv:
    """The game, with alarms in expectation where their probability is known."""
    if isinstance(config, DuelSpooferConfig):
        return DuelSpooferVectorEnv(lanes, autoreset_mode=AutoresetMode.SAME_STEP, **arguments_of(config))
    if alarm_probability_is_known(config):
        return ExpectedAlarmVectorEnv(lanes, config, autoreset_mode=AutoresetMode.SAME_STEP)
    return SpooferVectorEnv(lanes, autoreset_mode=AutoresetMode.SAME_STEP, **arguments_of(config))


def export(learner: PPO, config: AnySpooferConfig, folder: Path) -> LearnedSpoofer:
    """The learner's policy as plain arrays."""
    layers = [*learner.policy.mlp_extractor.policy_net, learner.policy.action_net]
    vector: SpooferVectorEnv = learner.get_env().unwrapped.vector_env  # type: ignore[union-attr]
    layout = tuple(field.name for field in vector.game.fields)
    return LearnedSpoofer(folder, dict(vars(config)), layout, *arrays(layers))


Arrays = tuple[NDArray[np.float32], ...]


def arrays(layers: Sequence[torch.nn.Module]) -> tuple[Arrays, Arrays]:
    """Weights and biases of the linear ones among ``layers``."""
    linear = [layer for layer in layers if isinstance(layer, torch.nn.Linear)]
    return (
        tuple(layer.weight.detach().numpy().copy() for layer in linear),
        tuple(layer.bias.detach().numpy().copy() for layer in linear),
    )
