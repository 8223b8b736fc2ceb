"""Spoofer-v0, native vector form: N lanes of the same game in one batch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from spoofgym.arrays import Flags
from spoofgym.envs.config import SpooferConfig, configure
from spoofgym.envs.spoofer_game import Outcome, SpooferGame

Observations = NDArray[np.float32]


class SpooferVectorEnv(VectorEnv[Observations, NDArray[np.float32], NDArray[Any]]):
    """N lanes of Spoofer-v0, each bit-identical to the single environment seeded ``seed + i``.

    Observations, rewards, ends and infos are those of a `gymnasium.vector.SyncVectorEnv` of single environments, in all
    three autoreset modes. Lanes do not depend on their number nor on ``threads``.

    Args:
        num_envs: lanes N.
        autoreset_mode: an `AutoresetMode` or its value; the default is Gymnasium's, NEXT_STEP.
        max_episode_steps: epochs after which a lane is truncated; None = never, the game ends by itself.
        arguments: those of Spoofer-v0.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        """Set N lanes up.

        Raises:
            ValueError: an argument out of range, or a render mode, which only the single environment has.
        """
        if num_envs < 1:
            raise ValueError(f"num_envs must be 1 or more, got {num_envs}")
        if render_mode is not None:
            raise ValueError(f"the vector environment draws nothing: render_mode must be None, got {render_mode!r}")
        if max_episode_steps is not None and max_episode_steps < 1:
            raise ValueError(f"max_episode_steps must be 1 or more, got {max_episode_steps}")
        self.num_envs = num_envs
        self.config = configure(SpooferConfig, arguments)
        self.game = SpooferGame(self.config, num_envs)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = None
        self.single_observation_space = self.game.observation_space
        self.single_action_space = self.game.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._max_episode_steps = max_episode_steps
        self._all = np.arange(num_envs)
        self._done = np.zeros(num_envs, dtype=bool)
        self._started = np.zeros(num_envs, dtype=bool)
        self._generators: list[np.random.Generator | None] = [None] * num_envs

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start new games.

        Args:
            seed: lane i is seeded ``seed + i``; or a sequence with a seed (or None) per lane; None = the streams go on.
            options: ``{"reset_mask": bool (N,)}`` resets those lanes only.

        Raises:
            ValueError: a sequence of seeds of the wrong length, or a mask of the wrong shape or without any lane.
            TypeError: a mask that is not a boolean array.
        """
        mask = self._reset_mask(options)
        lanes = np.flatnonzero(mask)
        seeds: Sequence[int | None]
        if seed is None or isinstance(seed, int | np.integer):
            seeds = [None if seed is None else int(seed) + i for i in range(self.num_envs)]
        else:
            seeds = list(seed)
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed must be one number or {self.num_envs} of them, got {len(seeds)}")
        for lane in lanes:
            if seeds[lane] is not None or self._generators[lane] is None:
                generator, _ = seeding.np_random(seeds[lane])
                self._generators[lane] = generator
                self.game.simulation.streams.replace(int(lane), generator)
        self.game.reset(lanes)
        self._done[lanes] = False
        self._started[lanes] = True
        return self.game.observation(), self._reset_info(mask)

    def _reset_mask(self, options: dict[str, Any] | None) -> Flags:
        if options is None or "reset_mask" not in options:
            return np.ones(self.num_envs, dtype=bool)
        mask = options["reset_mask"]
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            raise TypeError(f"options['reset_mask'] must be a boolean array, got {mask!r}")
        if mask.shape != (self.num_envs,) or not mask.any():
            raise ValueError(
                f"options['reset_mask'] must have shape ({self.num_envs},) and at least one True, got {mask!r}"
            )
        return mask

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observations, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """One GNSS epoch of every lane.

        Raises:
            ValueError: the actions have the wrong shape or are not finite.
            RuntimeError: a lane has never been reset or, where the autoreset mode is DISABLED, its game is over.
        """
        if not self._started.all():
            lanes = np.flatnonzero(~self._started).tolist()
            raise RuntimeError(f"the game of lanes {lanes} has not begun: call reset() first")
        if self.autoreset_mode == AutoresetMode.NEXT_STEP:
            return self._step_then_reset(actions)
        if self._done.any():
            lanes = np.flatnonzero(self._done).tolist()
            raise RuntimeError(
                f"the game of lanes {lanes} is over: reset them first, with options={{'reset_mask': ...}}"
            )
        outcome, truncated = self._play(actions, None)
        done = outcome.terminated | truncated
        if self.autoreset_mode == AutoresetMode.DISABLED or not done.any():
            self._done = done & (self.autoreset_mode == AutoresetMode.DISABLED)
            info = self._step_info(outcome, np.ones(self.num_envs, dtype=bool))
            return self.game.observation(), outcome.reward, outcome.terminated, truncated, info
        return self._reset_in_step(outcome, truncated, done)

    def _play(self, actions: NDArray[np.float32], restarting: NDArray[np.int64] | None) -> tuple[Outcome, Flags]:
        outcome = self.game.step(actions, restarting)
        truncated = np.zeros(self.num_envs, dtype=bool)
        if self._max_episode_steps is not None:
            truncated = self.game.index >= self._max_episode_steps
        return outcome, truncated

    def _step_then_reset(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observations, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """NEXT_STEP: the step after a lane's end begins its new game, with no reward."""
        restarted = self._done
        outcome, truncated = self._play(actions, np.flatnonzero(restarted))
        reward = np.where(restarted, 0.0, outcome.reward)
        terminated, truncated = outcome.terminated & ~restarted, truncated & ~restarted
        info = {} if restarted.all() else self._step_info(outcome, ~restarted)
        if restarted.any():
            _fill(info, self._reset_info(restarted), restarted)
        self._done = terminated | truncated
        return self.game.observation(), reward, terminated, truncated, info

    def _reset_in_step(
        self, outcome: Outcome, truncated: Flags, done: Flags
    ) -> tuple[Observations, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """SAME_STEP: the observation is that of the new game, the old one's end is in the info."""
        final = self.game.observation()
        final_obs = np.full(self.num_envs, None, dtype=object)
        for lane in np.flatnonzero(done):
            final_obs[lane] = final[lane]
        final_info = self._step_info(outcome, done)
        info = {} if done.all() else self._step_info(outcome, ~done)
        self.game.reset(np.flatnonzero(done))
        _fill(info, self._reset_info(done), done)
        info |= {
            "final_obs": final_obs,
            "_final_obs": done.copy(),
            "final_info": final_info,
            "_final_info": done.copy(),
        }
        return self.game.observation(), outcome.reward, outcome.terminated, truncated, info

    def _reset_info(self, mask: Flags) -> dict[str, Any]:
        return _masked({"epoch": self.game.index, "error": self.game.error}, mask)

    def _step_info(self, outcome: Outcome, mask: Flags) -> dict[str, Any]:
        """The single environment's infos in Gymnasium's layout: arrays, each with its mask."""
        info = _masked({"epoch": self.game.index, "error": self.game.error, "alarm": outcome.alarm}, mask)
        info["reward_terms"] = _masked({"growth": outcome.growth, "forfeit": outcome.forfeit}, mask)
        info["_reward_terms"] = mask.copy()
        over = outcome.terminated & mask
        if over.any():
            words = np.full(self.num_envs, None, dtype=object)
            words[over] = np.where(outcome.alarmed[over], "detected", "undetected")
            info |= {"outcome": words, "_outcome": over}
            info |= {"is_success": over & ~outcome.alarmed, "_is_success": over.copy()}
        return info


def _masked(values: dict[str, NDArray[Any]], mask: Flags) -> dict[str, Any]:
    """Each array with zeros where the mask is False, and the mask beside it."""
    everyone = bool(mask.all())
    info: dict[str, Any] = {}
    for key, value in values.items():
        info[key] = value.copy() if everyone else np.where(mask, value, np.zeros((), dtype=value.dtype))
        info[f"_{key}"] = mask.copy()
    return info


def _fill(info: dict[str, Any], part: dict[str, Any], mask: Flags) -> None:
    """Put the entries of the lanes in ``mask`` beside those of the others."""
    for key, value in part.items():
        if key in info:
            info[key][mask] = value[mask]
        else:
            info[key] = value
