"""PPO for the defender: a critic that knows the truth, an actor that does not, and what a run leaves behind.

The returns are heavy-tailed: a few games in which spoofed fixes stay in the estimate carry the mean. A critic that sees
the true error and the schedule of the attack explains most of that, so that the advantages of the actor's decisions
stand out. Both see one vector; the actor's network is given its first part only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.vec_env import VecMonitor
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn
from torch import nn

from spoofgym.envs.config import DefenderConfig, arguments_of
from spoofgym.envs.defender_seat import EXCLUDE
from spoofgym.envs.duel_config import DuelDefenderConfig
from spoofgym.envs.sb3 import SB3VecEnv
from spoofgym.envs.vector import DefenderVectorEnv, DefendingVectorEnv, DuelDefenderVectorEnv
from spoofgym.learning import limits
from spoofgym.learning.imitation import imitate
from spoofgym.learning.ppo import LAST_RATE, arrays
from spoofgym.learning.scaled_rewards import ScaledRewards, duel_factor
from spoofgym.policies.learned import SLOT_FIELD, LearnedDefender

TEACHING_LANES = 256
EXCLUDING_FIELD = "last decision was to exclude"
AnyDefenderConfig = DefenderConfig | DuelDefenderConfig


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the learner.

    Attributes:
        lanes: games played at once.
        clean: share of games without an attack in training.
        minibatches: of a rollout, which is one whole game of every lane.
        epochs: passes over a rollout.
        learning_rate: at the start; falls linearly to almost zero at the last step.
        gamma: discount per epoch.
        gae_lambda: of the advantage estimate.
        clip_range: of the policy ratio.
        entropy: weight of the policy's entropy.
        hidden: width of the two hidden layers of policy and value.
        imitate: begin with the actions of a classical defender (`spoofgym.learning.imitation`).
        critic_games: games of every lane in which only the critic learns, after that.
        reward_scale: factor on the rewards.
        privileged: whether the critic sees the privileged state.
        validation_episodes: games of the training attacks on which checkpoints are compared.
    """

    lanes: int = 256
    clean: float = 0.1
    minibatches: int = 8
    epochs: int = 6
    learning_rate: float = 5e-4
    gamma: float = 0.99
    gae_lambda: float = 0.95
    clip_range: float = 0.15
    entropy: float = 0.0
    hidden: int = 64
    imitate: bool = True
    critic_games: int = 6
    reward_scale: float = 0.1
    privileged: bool = True
    validation_episodes: int = 4000

    def __post_init__(self) -> None:
        """Refuse a number that is none of a training.

        Raises:
            ValueError: naming the setting.
        """
        limits.check(
            self,
            limits.PPO
            | {
                "clean": limits.real(0.0, 1.0),
                "gamma": limits.real(0.0, 1.0),
                "entropy": limits.real(0.0, 1e6),
                "imitate": limits.SWITCH,
                "privileged": limits.SWITCH,
                "critic_games": limits.whole(0, 10_000),
                "reward_scale": limits.real(0.0, 1e9),
                "validation_episodes": limits.whole(1, 10_000_000),
            },
        )


class PrivilegedVecEnv(SB3VecEnv):
    """The defender's lanes with the privileged state behind each observation."""

    def __init__(self, vector_env: DefendingVectorEnv) -> None:
        """Widen the observations of ``vector_env``."""
        super().__init__(vector_env)
        width = len(vector_env.game.fields) + len(vector_env.game.privileged.fields)
        self.observation_space = spaces.Box(-1.0, 1.0, (width,), np.float32)

    def _widen(self, observation: Any) -> NDArray[np.float32]:
        return np.concatenate([observation, self.vector_env.game.privileged()], axis=1)  # type: ignore[attr-defined]

    def reset(self) -> VecEnvObs:
        """Start new episodes in all lanes."""
        return self._widen(super().reset())

    def step_wait(self) -> VecEnvStepReturn:
        """One step of all lanes. Games end by termination only, so that the value of their last state is not needed."""
        observation, reward, done, infos = super().step_wait()
        return self._widen(observation), reward, done, infos


class SlicedNetworks(nn.Module):
    """Two tanh networks: the policy's sees the first ``width`` entries, the value's all of them."""

    def __init__(self, width: int, whole: int, hidden: int) -> None:
        super().__init__()
        self.latent_dim_pi = self.latent_dim_vf = hidden
        self.width = width
        self.policy_net = _tanh_network(width, hidden)
        self.value_net = _tanh_network(whole, hidden)

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Latents of both."""
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        """Latent of the policy."""
        return self.policy_net(features[:, : self.width])

    def forward_critic(self, features: torch.Tensor) -> torch.Tensor:
        """Latent of the value."""
        return self.value_net(features)


def _tanh_network(inputs: int, hidden: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(inputs, hidden), nn.Tanh(), nn.Linear(hidden, hidden), nn.Tanh())


class DefenderPolicy(ActorCriticPolicy):
    """An actor that sees the first ``width`` entries of the observation, and a critic that sees all.

    The depth of a backtrack counts only where the action begins an exclusion, and the choice of a satellite only where
    it is in view and the epoch is used, as in the environment: elsewhere they have no probability and no entropy, so
    that no gradient rewards or blames them.
    """

    def __init__(
        self, *args: Any, width: int, hidden: int, excluding: int, slots: tuple[int, ...], **kwargs: Any
    ) -> None:
        """Let the actor see ``width`` entries.

        Args:
            width: of what the actor sees.
            hidden: width of the hidden layers.
            excluding: the entry that tells whether GNSS is left out already.
            slots: the entries that tell whether a slot holds a satellite, of every slot.
            args: of SB3's policy.
            kwargs: of SB3's policy.
        """
        self._width, self._hidden, self._excluding, self._slots = width, hidden, excluding, slots
        super().__init__(*args, **kwargs)

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor: Any = SlicedNetworks(self._width, self.features_dim, self._hidden)

    def forward(
        self, obs: torch.Tensor, deterministic: bool = False
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Actions, values and the probability of the actions."""
        latent, value = self.mlp_extractor(obs)
        distribution = self._get_action_dist_from_latent(latent)
        actions = distribution.get_actions(deterministic=deterministic)
        log_probability, _ = self._judge(distribution, obs, actions)
        return actions, self.value_net(value), log_probability

    def evaluate_actions(
        self, obs: torch.Tensor, actions: torch.Tensor  # type: ignore[override]
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Values, the probability of the actions, and the entropy."""
        latent, value = self.mlp_extractor(obs)
        log_probability, entropy = self._judge(self._get_action_dist_from_latent(latent), obs, actions)
        return self.value_net(value), log_probability, entropy

    def _judge(
        self, distribution: Any, obs: torch.Tensor, actions: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        decision, depth, *satellites = distribution.distribution
        excludes = actions[:, 0] == EXCLUDE
        begins = excludes & (obs[:, self._excluding] < 0.5)
        log_probability = decision.log_prob(actions[:, 0]) + begins * depth.log_prob(actions[:, 1])
        entropy = decision.entropy() + begins * depth.entropy()
        for place, (slot, satellite) in enumerate(zip(self._slots, satellites, strict=True), start=2):
            read = ~excludes & (obs[:, slot] > 0.5)
            log_probability = log_probability + read * satellite.log_prob(actions[:, place])
            entropy = entropy + read * satellite.entropy()
        return log_probability, entropy


def make_learner(config: AnyDefenderConfig, settings: Settings, seed: int, folder: Path) -> PPO:
    """A PPO learner on ``settings.lanes`` lanes of the game, seeded; TensorBoard writes into ``folder``."""
    vector = lanes(config, settings)
    horizon = vector.game.scenario.timeline.num_epochs
    layout = [field.name for field in vector.game.fields]
    adapted = PrivilegedVecEnv(vector) if settings.privileged else SB3VecEnv(vector)
    return PPO(
        DefenderPolicy,
        ScaledRewards(VecMonitor(adapted), settings.reward_scale * duel_factor(config, vector.game.scenario)),
        n_steps=horizon,
        batch_size=max(1, settings.lanes * horizon // settings.minibatches),
        n_epochs=settings.epochs,
        learning_rate=lambda remaining: settings.learning_rate * max(remaining, LAST_RATE),
        gamma=settings.gamma,
        gae_lambda=settings.gae_lambda,
        clip_range=settings.clip_range,
        ent_coef=settings.entropy,
        policy_kwargs={
            "width": len(layout),
            "hidden": settings.hidden,
            "excluding": layout.index(EXCLUDING_FIELD),
            "slots": tuple(place for place, name in enumerate(layout) if name.startswith(SLOT_FIELD)),
        },
        tensorboard_log=str(folder / "tensorboard"),
        seed=seed,
        device="cpu",
    )


def lanes(config: AnyDefenderConfig, settings: Settings) -> DefendingVectorEnv:
    """The lanes of a training."""
    trained = replace(config, clean=settings.clean)
    kind = DuelDefenderVectorEnv if isinstance(config, DuelDefenderConfig) else DefenderVectorEnv
    return kind(settings.lanes, autoreset_mode=AutoresetMode.SAME_STEP, **arguments_of(trained))


def begin(learner: PPO, config: AnyDefenderConfig, settings: Settings, seed: int) -> None:
    """Teach the policy a classical defender's actions, then the critic that policy's returns."""
    imitate(learner, lanes(config, replace(settings, lanes=TEACHING_LANES)), seed)
    policy = learner.policy
    actor = [*policy.mlp_extractor.policy_net.parameters(), *policy.action_net.parameters()]
    for parameter in actor:
        parameter.requires_grad_(False)
    learner.learn(settings.critic_games * settings.lanes * learner.n_steps, tb_log_name="critic")
    for parameter in actor:
        parameter.requires_grad_(True)


def export(learner: PPO, config: AnyDefenderConfig, folder: Path) -> LearnedDefender:
    """The learner's policy as plain arrays."""
    layers = [*learner.policy.mlp_extractor.policy_net, learner.policy.action_net]
    vector: DefendingVectorEnv = learner.get_env().unwrapped.vector_env  # type: ignore[union-attr]
    layout = tuple(field.name for field in vector.game.fields)
    return LearnedDefender(folder, dict(vars(config)), layout, *arrays(layers))
