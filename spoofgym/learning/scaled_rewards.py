"""Rewards of a size that a learner can work with."""

from __future__ import annotations

from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.envs.duel_config import DuelConfig
from spoofgym.scenario import Scenario

WORTH_OF_AN_EPOCH = 2.0
"""An epoch beyond the limit, in units of an error of the scenario's `defender_scale`."""


class ScaledRewards(VecEnvWrapper):
    """Rewards times a factor: returns of the order of one, so that the critic's gradient does not drown the actor's."""

    def __init__(self, venv: VecEnv, factor: float) -> None:
        """Scale the rewards of ``venv``."""
        super().__init__(venv)
        self._factor = factor

    def reset(self) -> VecEnvObs:
        """Start new episodes in all lanes."""
        return self.venv.reset()

    def step_wait(self) -> VecEnvStepReturn:
        """One step of all lanes."""
        observation, reward, done, infos = self.venv.step_wait()
        return observation, self._factor * reward, done, infos


def duel_factor(config: SpooferConfig | DefenderConfig | DuelConfig, scenario: Scenario) -> float:
    """Factor that brings the rewards of a duel to the size of those of the single games; 1 in these.

    A duel pays each epoch's share of the mean. Times this factor it pays errors over the scenario's `defender_scale`.

    Args:
        config: of the game.
        scenario: of the game.
    """
    if not isinstance(config, DuelConfig):
        return 1.0
    epochs = scenario.timeline.num_epochs
    if config.payoff.startswith("beyond"):
        return WORTH_OF_AN_EPOCH * epochs
    return epochs / scenario.defender_scale
