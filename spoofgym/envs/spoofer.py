"""Spoofer-v0: the single environment."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from spoofgym.envs.config import SpooferConfig, configure
from spoofgym.envs.rendering import SpooferFigure
from spoofgym.envs.spoofer_game import Outcome, SpooferGame

LANE = np.zeros(1, dtype=np.int64)


class SpooferEnv(gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    __doc__ = "SPOOFER PAGE"

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(self, render_mode: str | None = None, **arguments: Any) -> None:
        """Set the game up; ``arguments`` are those of the environment's page."""
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(f"unknown render_mode {render_mode!r}; valid modes: {self.metadata['render_modes']}")
        self.config = configure(SpooferConfig, arguments)
        self.game = SpooferGame(self.config, 1)
        self.observation_space = self.game.observation_space
        self.action_space = self.game.action_space
        self.render_mode = render_mode
        self._figure = SpooferFigure(self.game) if render_mode == "rgb_array" else None
        self._streamed: np.random.Generator | None = None
        self._playing = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start a new game; there are no options."""
        super().reset(seed=seed)
        if self.np_random is not self._streamed:
            self.game.simulation.streams.replace(0, self.np_random)
            self._streamed = self.np_random
        self.game.reset(LANE)
        self._playing = True
        if self._figure is not None:
            self._figure.restart()
        return self.game.observation()[0], {"epoch": 0, "error": float(self.game.error[0])}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """One GNSS epoch.

        Raises:
            ValueError: the action has the wrong shape or is not finite.
            RuntimeError: the game is over or has not been started.
        """
        if not self._playing:
            raise RuntimeError("the game is over: call reset() first")
        outcome = self.game.step(np.asarray(action, dtype=np.float64).reshape(1, -1))
        terminated = bool(outcome.terminated[0])
        self._playing = not terminated
        if self._figure is not None:
            self._figure.record()
        return self.game.observation()[0], float(outcome.reward[0]), terminated, False, self._info(outcome)

    def _info(self, outcome: Outcome) -> dict[str, Any]:
        info: dict[str, Any] = {
            "epoch": int(self.game.index[0]),
            "error": float(self.game.error[0]),
            "alarm": bool(outcome.alarm[0]),
            "reward_terms": {"growth": float(outcome.growth[0]), "forfeit": float(outcome.forfeit[0])},
        }
        if outcome.terminated[0]:
            info["outcome"] = "detected" if outcome.alarmed[0] else "undetected"
            info["is_success"] = not bool(outcome.alarmed[0])
        return info

    def render(self) -> NDArray[np.uint8] | None:
        """The figure of the game so far, (H, W, 3); None without a render mode."""
        return None if self._figure is None else self._figure.draw()

    def close(self) -> None:
        """Free the figure."""
        if self._figure is not None:
            self._figure.close()
