"""A classical defender in the seat of a learner: what it would do is what a policy begins with.

In every lane of Defender-v0 the features say whether a classical defender would exclude (a signed mean of 10 epochs,
until 5 fixes in a row agree) and how far back it would go (the estimated onset plus a margin, rounded up to the depth
table). A policy that is first taught to do that starts where the best classical defenders stand, and what
reinforcement adds is its own.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from torch.nn import functional

from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.vector import DefenderVectorEnv
from spoofgym.responses.onset_depth import DEFAULT_MARGIN

GAMES = 4
"""Games of every lane that a policy is taught from."""
PASSES = 30
MINIBATCH = 4096
LEARNING_RATE = 2e-3
STRAY = 0.02
"""Share of decisions in which the classical defender is made to do the other thing, so that what follows is seen."""


def classical_action(game: DefenderGame) -> NDArray[np.int64]:
    """What a classical defender would do in the present epoch, (N, 2)."""
    depth = game.features.onset_depth + DEFAULT_MARGIN
    place = np.minimum(np.searchsorted(game.depths, depth), len(game.depths) - 1)
    return np.stack([game.features.suspicion.astype(np.int64), place], axis=1)


def examples(vector: DefenderVectorEnv, seed: int) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Observations (n, D) of games that the classical defender plays, and its actions (n, 2)."""
    rng = np.random.default_rng(seed)
    observation, _ = vector.reset(seed=seed)
    observations, actions = [], []
    for _ in range(GAMES * vector.game.scenario.timeline.num_epochs):
        action = classical_action(vector.game)
        observations.append(observation)
        actions.append(action)
        strayed = action.copy()
        stray = rng.random(len(action)) < STRAY
        strayed[stray, 0] = 1 - strayed[stray, 0]
        observation, *_ = vector.step(strayed)
    return np.concatenate(observations), np.concatenate(actions)


def imitate(learner: PPO, vector: DefenderVectorEnv, seed: int) -> float:
    """Teach the learner's policy the classical defender's actions; the share of its decisions that then agree.

    Args:
        learner: whose policy is changed, not its critic.
        vector: lanes of the learner's game, whose streams go on from ``seed``.
        seed: of the games and of the order of the examples.
    """
    observations, actions = examples(vector, seed)
    inputs, labels = torch.as_tensor(observations), torch.as_tensor(actions)
    extractor, head = learner.policy.mlp_extractor, learner.policy.action_net
    optimizer = torch.optim.Adam([*extractor.policy_net.parameters(), *head.parameters()], lr=LEARNING_RATE)
    generator = torch.Generator().manual_seed(seed)
    for _ in range(PASSES):
        for batch in torch.randperm(len(inputs), generator=generator).split(MINIBATCH):
            logits = head(extractor.policy_net(inputs[batch]))
            loss = functional.cross_entropy(logits[:, :2], labels[batch, 0])
            loss = loss + functional.cross_entropy(logits[:, 2:], labels[batch, 1])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
    with torch.no_grad():
        decided = head(extractor.policy_net(inputs))[:, :2].argmax(dim=1)
    return float((decided == labels[:, 0]).float().mean())
