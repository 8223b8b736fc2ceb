"""A classical defender in the seat of a learner: what it would do is what a policy begins with.

In every lane of Defender-v0 the features say whether a classical defender would exclude (a signed mean of 5 epochs,
until 5 fixes in a row agree) and when it believes that the attack began. A teacher excludes where they say so, perhaps
until more fixes agree, and goes back either to the estimated onset plus a margin, rounded up to the depth table, or a
fixed depth. Where the defender sees a bank of hypotheses, a teacher follows that: it excludes where the error is
expected to be less by more than a margin. Of all these the one whose error is least on games of the training population
is taken. A policy that is first taught to do that starts where the best classical defenders stand, and what
reinforcement adds is its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from torch.nn import functional

from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.duel_game import DuelDefenderGame
from spoofgym.envs.vector import DefendingVectorEnv
from spoofgym.responses.onset_depth import DEFAULT_MARGIN

GAMES = 4
"""Games of every lane that a policy is taught from."""
REUSES = (5, 12)
MARGINS = (0.0, 0.01, 0.03)
"""By how much exclusion must be expected to err less than use, as shares of the scenario's `defender_scale`."""
FEW, MANY = 4, 24
"""Games of every lane in which teachers are compared, all of them and the best quarter."""
PASSES = 30
MINIBATCH = 4096
LEARNING_RATE = 2e-3
STRAY = 0.02
"""Share of decisions in which the classical defender is made to do the other thing, so that what follows is seen."""


@dataclass(frozen=True)
class Teacher:
    """A classical defender that acts by the features of Defender-v0.

    Attributes:
        depth: place in the depth table; None = the estimated onset.
        reuse: fixes in a row that agree before GNSS is used again; 5 or more.
    """

    depth: int | None
    reuse: int

    def act(self, game: DefenderGame | DuelDefenderGame) -> NDArray[np.int64]:
        """What it does in the present epoch, (N, 2 + S); it leaves no single satellite out."""
        features = game.seat.features
        if self.depth is None:
            place = np.searchsorted(game.seat.depths, features.onset_depth + DEFAULT_MARGIN)
            place = np.minimum(place, len(game.seat.depths) - 1)
        else:
            place = np.full(game.num_lanes, self.depth)
        exclude = features.suspicion | (game.seat.excluding & (features.agreeing < self.reuse))
        action = np.zeros((game.num_lanes, len(game.seat.space.nvec)), dtype=np.int64)
        action[:, 0], action[:, 1] = exclude, place
        return action


@dataclass(frozen=True)
class BankTeacher:
    """The defender that follows the bank of hypotheses it sees.

    Exclusion is for good, while the use of a fix can be taken back later: a margin in favour of use pays.

    Attributes:
        margin: by how much exclusion must be expected to err less, m.
    """

    margin: float

    def act(self, game: DefenderGame | DuelDefenderGame) -> NDArray[np.int64]:
        """What it does in the present epoch, (N, 2)."""
        bank = game.seat.features.bank
        assert bank is not None
        return np.stack([bank.gain > self.margin, bank.place], axis=1).astype(np.int64)


AnyTeacher = Teacher | BankTeacher


def teachers_of(vector: DefendingVectorEnv) -> list[AnyTeacher]:
    """Those that see what the learner sees."""
    seat = vector.game.seat
    if seat.features.bank is not None:
        return [BankTeacher(margin * vector.game.scenario.defender_scale) for margin in MARGINS]
    return [Teacher(depth, reuse) for depth in (None, *range(len(seat.depths))) for reuse in REUSES]


def best_teacher(vector: DefendingVectorEnv, seed: int) -> AnyTeacher:
    """The one whose error is least on common games: all are tried on a few, the best quarter on many."""
    tried = sorted(teachers_of(vector), key=lambda teacher: total_error(vector, teacher, FEW, seed))
    best = tried[: -(-len(tried) // 4)]
    return best[0] if len(best) == 1 else min(best, key=lambda teacher: total_error(vector, teacher, MANY, seed))


def total_error(vector: DefendingVectorEnv, teacher: AnyTeacher, games: int, seed: int) -> float:
    """Sum of the errors of all decisions in ``games`` of every lane, m."""
    vector.reset(seed=seed)
    total = 0.0
    for _ in range(games * vector.game.scenario.timeline.num_epochs):
        vector.step(teacher.act(vector.game))
        total += float(vector.game.error.sum())
    return total


def examples(
    vector: DefendingVectorEnv, teacher: AnyTeacher, seed: int
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Observations (n, D) of games that a teacher plays, and its actions (n, 2 + S)."""
    rng = np.random.default_rng(seed)
    observation, _ = vector.reset(seed=seed)
    observations, actions = [], []
    for _ in range(GAMES * vector.game.scenario.timeline.num_epochs):
        action = teacher.act(vector.game)
        observations.append(observation)
        actions.append(action)
        strayed = action.copy()
        stray = rng.random(len(action)) < STRAY
        strayed[stray, 0] = 1 - strayed[stray, 0]
        observation, *_ = vector.step(strayed)
    return np.concatenate(observations), np.concatenate(actions)


def imitate(learner: PPO, vector: DefendingVectorEnv, seed: int) -> float:
    """Teach the learner's policy the best teacher's actions; the share of its decisions that then agree.

    Args:
        learner: whose policy is changed, not its critic.
        vector: lanes of the learner's game, whose streams go on from ``seed``.
        seed: of the games and of the order of the examples.
    """
    observations, actions = examples(vector, best_teacher(vector, seed), seed)
    inputs, labels = torch.as_tensor(observations), torch.as_tensor(actions)
    extractor, head = learner.policy.mlp_extractor, learner.policy.action_net
    optimizer = torch.optim.Adam([*extractor.policy_net.parameters(), *head.parameters()], lr=LEARNING_RATE)
    generator, sizes = torch.Generator().manual_seed(seed), vector.game.action_space.nvec.tolist()
    for _ in range(PASSES):
        for batch in torch.randperm(len(inputs), generator=generator).split(MINIBATCH):
            logits = head(extractor.policy_net(inputs[batch]))
            parts = zip(logits.split(sizes, dim=1), labels[batch].T, strict=True)
            loss = torch.stack([functional.cross_entropy(part, label) for part, label in parts]).sum()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
    with torch.no_grad():
        decided = head(extractor.policy_net(inputs))[:, :2].argmax(dim=1)
    return float((decided == labels[:, 0]).float().mean())
