"""A native vector environment of spoofgym as a Stable-Baselines3 `VecEnv` (extra ``spoofgym[sb3]``)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from spoofgym import validation
from spoofgym.envs.config import check_options

try:
    from stable_baselines3.common.vec_env import VecEnv
    from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn
except ImportError as error:
    raise gym.error.DependencyNotInstalled(
        "the adapter needs Stable-Baselines3: pip install 'spoofgym[sb3]'"
    ) from error


OF_LANES = ("np_random", "np_random_seed")
"""Attributes of a vector environment with an entry per lane."""


class SB3VecEnv(VecEnv):
    """Adapter of a Gymnasium vector environment in the autoreset mode SAME_STEP.

    Observations, rewards, dones, ``terminal_observation`` and ``TimeLimit.truncated`` are bit-equal to those of a
    `DummyVecEnv` of the single environments. To keep training fast, a lane's info is filled at the end of its episode
    only.

    Attributes:
        vector_env: the environment that is adapted.
    """

    def __init__(self, vector_env: VectorEnv) -> None:
        """Adapt ``vector_env``.

        Raises:
            ValueError: its autoreset mode is not SAME_STEP, whose observations Stable-Baselines3 expects.
            TypeError: it is no Gymnasium vector environment.
        """
        validation.instance("SB3VecEnv", "vector_env", vector_env, VectorEnv, "a Gymnasium vector environment")
        mode = vector_env.metadata.get("autoreset_mode")
        if mode != AutoresetMode.SAME_STEP:
            raise ValueError(f"the vector environment must have autoreset_mode={AutoresetMode.SAME_STEP}, got {mode}")
        self.vector_env = vector_env
        self._actions: Any = None
        super().__init__(vector_env.num_envs, vector_env.single_observation_space, vector_env.single_action_space)
        self.metadata = vector_env.metadata  # with the frames per second of a recording

    def reset(self) -> VecEnvObs:
        """Start new episodes in all lanes; seeds given by `seed` are used once.

        Raises:
            ValueError: `set_options` has given an option: there are none.
        """
        for options in self._options:
            check_options("SB3VecEnv", options)
        seeds = None if all(seed is None for seed in self._seeds) else list(self._seeds)
        observation, info = self.vector_env.reset(seed=seeds)  # type: ignore[arg-type]
        self.reset_infos = [_lane(info, lane) for lane in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return observation

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """One step of all lanes."""
        observation, reward, terminated, truncated, info = self.vector_env.step(self._actions)
        done = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for lane in np.flatnonzero(done).tolist():
            infos[lane] = _lane(info["final_info"], lane)
            infos[lane]["terminal_observation"] = info["final_obs"][lane]
            infos[lane]["TimeLimit.truncated"] = bool(truncated[lane] and not terminated[lane])
            self.reset_infos[lane] = _lane(info, lane)
        return observation, reward.astype(np.float32), done, infos

    def close(self) -> None:
        """Close the vector environment."""
        self.vector_env.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of the vector environment, once per lane asked for, or its part of it where lanes have parts."""
        value = getattr(self.vector_env, attr_name)
        return [value[lane] if attr_name in OF_LANES else value for lane in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Refused: lanes share one configuration.

        Raises:
            AttributeError: always.
        """
        raise AttributeError(f"lanes share one configuration: {attr_name!r} cannot be set")

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """What a method gives for each lane asked for.

        There are two: ``action_masks``, for MaskablePPO, where the vector environment has it, (D,), and ``render``.

        Raises:
            AttributeError: another method: lanes are no objects of their own.
        """
        if method_name == "render":
            frames = self.vector_env.render() or (None,) * self.num_envs
            return [frames[lane] for lane in self._get_indices(indices)]
        if method_name == "action_masks" and self.has_attr(method_name):
            masks = self.vector_env.action_masks()  # type: ignore[attr-defined]
            return [masks[lane] for lane in self._get_indices(indices)]
        raise AttributeError(f"lanes are no objects of their own: {method_name!r} cannot be called on them")

    def env_is_wrapped(self, wrapper_class: type[gym.Wrapper], indices: VecEnvIndices = None) -> list[bool]:
        """No lane is wrapped."""
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[np.ndarray | None]:
        """The figures of the lanes that are shown, which SB3 puts side by side; without them None per lane."""
        if self.render_mode != "rgb_array":
            return [None] * self.num_envs
        return [frame for frame in self.vector_env.render() or () if isinstance(frame, np.ndarray)]


def _lane(info: dict[str, Any], lane: int) -> dict[str, Any]:
    """One lane's info out of Gymnasium's vector layout, as the single environment gives it."""
    result: dict[str, Any] = {}
    for key, value in info.items():
        if key.startswith("_") or key in ("final_obs", "final_info") or not info[f"_{key}"][lane]:
            continue
        if isinstance(value, dict):
            result[key] = _lane(value, lane)
        else:
            result[key] = value[lane].item() if isinstance(value[lane], np.generic) else value[lane]
    return result
