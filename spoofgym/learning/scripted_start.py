"""The best scripted attack in the seat of a learner: a spoofer that learns in the duel may begin with it.

Offsets that are known in advance can be followed by any spoofer, as fast as it may drag. Each scripted and each optimal
attack that a league begins with is followed in games against the learner's opponent, and the policy is taught the one
that harms most. The critic then learns what that policy is worth. What reinforcement adds is its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3 import PPO
from torch.nn import functional

from spoofgym.arrays import Floats
from spoofgym.envs.config import arguments_of
from spoofgym.envs.duel_config import DuelSpooferConfig
from spoofgym.envs.opponents import make_spoofer
from spoofgym.envs.vector import DuelSpooferVectorEnv
from spoofgym.fitting import fit_attack
from spoofgym.streams import RunStreams

SCRIPTED = ("ramp:0.1", "ramp:0.2", "ramp:0.5", "ramp:1", "ramp:2", "jump:20")
OPTIMAL = ("unseen:4", "unseen:16", "unseen:64")
FEW, MANY = 64, 256
"""Games in which all attacks are compared, and games that the best one is taught from."""
CATCH_UP = 0.1
"""Share of the distance to the attack's offset that is made good in an epoch."""
STRAY = 0.1
"""Standard deviation of what is added to the actions of the games that are taught from: they lead off the attack."""
PASSES = 30
MINIBATCH = 4096
LEARNING_RATE = 2e-3
OWNER = "scripted start"


class Follower:
    """Plays an attack whose offsets are known in advance through the actions of the spoofer's seat."""

    def __init__(self, attack: str, vector: DuelSpooferVectorEnv) -> None:
        """Look at all that the attack will send.

        Args:
            attack: its specification; no pool, and not closed-loop.
            vector: lanes of the game.

        Raises:
            ValueError: the attack does not fit the scenario.
        """
        made, lanes = make_spoofer(attack), vector.num_envs
        fit_attack(OWNER, made, vector.game.scenario, lanes)
        self._offsets = made.episode(np.arange(lanes), RunStreams.from_seed(0, lanes))
        self._game, self._lanes = vector.game, np.arange(lanes)

    def act(self) -> Floats:
        """The actions of the present epoch, (N, 3), or (N, 4) where the filter takes ranges."""
        seat, index = self._game.seat, self._game.index
        following = np.minimum(index + 1, self._offsets.shape[1] - 1)
        here, there = self._offsets[self._lanes, index], self._offsets[self._lanes, following]
        aim = seat.offset.copy()
        aim[:, :3] += there - here + CATCH_UP * (here - aim[:, :3])
        return seat.towards(aim)


def best_attack(vector: DuelSpooferVectorEnv, seed: int) -> str:
    """The attack that harms most in one game of every lane, all on the same random numbers."""
    return max((*SCRIPTED, *OPTIMAL), key=lambda attack: _harm(vector, attack, seed))


def _harm(vector: DuelSpooferVectorEnv, attack: str, seed: int) -> float:
    """Mean harm of one game of every lane."""
    follower = Follower(attack, vector)
    vector.reset(seed=seed)
    harm = 0.0
    for _ in range(vector.game.scenario.timeline.num_epochs):
        _, reward, *_ = vector.step(follower.act())
        harm += float(reward.mean())
    return harm


def examples(vector: DuelSpooferVectorEnv, attack: str, seed: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Observations (n, D) of one game of every lane that stays near an attack, and the actions that lead back, (n, A).

    Args:
        vector: lanes of the game.
        attack: that is followed.
        seed: of the games, and of the noise in the actions.
    """
    rng = np.random.default_rng(seed)
    follower = Follower(attack, vector)
    observation, _ = vector.reset(seed=seed)
    observations, actions = [], []
    for _ in range(vector.game.scenario.timeline.num_epochs):
        action = follower.act()
        observations.append(observation)
        actions.append(action.astype(np.float32))
        observation, *_ = vector.step(action + STRAY * rng.standard_normal(action.shape))
    return np.concatenate(observations), np.concatenate(actions)


def teach(learner: PPO, vector: DuelSpooferVectorEnv, attack: str, seed: int) -> None:
    """Teach the learner's policy to follow an attack.

    Args:
        learner: whose policy is changed, not its critic.
        vector: lanes of the learner's game, whose streams go on from ``seed``.
        attack: that is followed.
        seed: of the games and of the order of the examples.
    """
    observations, actions = examples(vector, attack, seed)
    inputs, wanted = torch.as_tensor(observations), torch.as_tensor(actions)
    policy: Any = learner.policy
    network, head = policy.mlp_extractor.policy_net, policy.action_net
    optimizer = torch.optim.Adam([*network.parameters(), *head.parameters()], lr=LEARNING_RATE)
    generator = torch.Generator().manual_seed(seed)
    for _ in range(PASSES):
        for batch in torch.randperm(len(inputs), generator=generator).split(MINIBATCH):
            loss = functional.mse_loss(head(network(inputs[batch])), wanted[batch])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()


def begin(learner: PPO, config: DuelSpooferConfig, critic_games: int, seed: int) -> str:
    """Teach the policy the best attack, then the critic that policy's returns; the attack.

    Args:
        learner: on lanes of the duel.
        config: of the duel.
        critic_games: of every lane, in which only the critic learns.
        seed: of the games.
    """
    attack = best_attack(_lanes(config, FEW), seed)
    teach(learner, _lanes(config, MANY), attack, seed)
    policy: Any = learner.policy
    actor = [*policy.mlp_extractor.policy_net.parameters(), *policy.action_net.parameters(), policy.log_std]
    for parameter in actor:
        parameter.requires_grad_(False)
    learner.learn(critic_games * learner.n_envs * learner.n_steps, tb_log_name="critic")
    for parameter in actor:
        parameter.requires_grad_(True)
    learner.num_timesteps = 0  # of what counts, nothing has been played
    return attack


def _lanes(config: DuelSpooferConfig, lanes: int) -> DuelSpooferVectorEnv:
    return DuelSpooferVectorEnv(lanes, autoreset_mode=AutoresetMode.SAME_STEP, **arguments_of(config))
