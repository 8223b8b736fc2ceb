"""What the single environments have in common: one lane of a game."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from spoofgym import validation
from spoofgym.envs.actions import as_numbers
from spoofgym.envs.config import check_options
from spoofgym.envs.native import Game, Values
from spoofgym.envs.rendering import METADATA, FigureType, Frame, Rendering, check_render_mode

LANE = np.zeros(1, dtype=np.int64)


class SingleEnv(gym.Env[NDArray[np.float32], NDArray[Any]]):
    """One lane of a game."""

    metadata: dict[str, Any] = dict(METADATA)

    def __init__(self, game: Game, render_mode: str | None, figure: FigureType) -> None:
        """Take a game of one lane; ``figure`` draws it."""
        self.game: Any = game
        self.observation_space = game.observation_space
        self.action_space = game.action_space
        self.render_mode = render_mode
        self._rendering = Rendering(render_mode, game, figure)
        self._streamed: np.random.Generator | None = None
        self._playing = False

    @classmethod
    def _check_render_mode(cls, render_mode: str | None) -> None:
        check_render_mode(cls.__name__, render_mode)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start a new game; there are no options.

        Raises:
            ValueError: a seed that is no integer or negative, or an option.
            TypeError: options that are no dictionary.
        """
        check_options(type(self).__name__, options)
        super().reset(seed=validation.seed(type(self).__name__, seed))
        if self.np_random is not self._streamed:
            self.game.simulation.streams.replace(0, self.np_random)
            self._streamed = self.np_random
        self.game.reset(LANE)
        self._playing = True
        self._rendering.restart(LANE)
        return self.game.observation()[0], only_lane(self.game.reset_values())

    def step(self, action: NDArray[Any]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """One GNSS epoch.

        Raises:
            ValueError: the action is none of finite numbers, has the wrong shape, or lies outside the action space
                where that is discrete.
            RuntimeError: the game is over or has not been started.
        """
        if not self._playing:
            raise RuntimeError("the game is over: call reset() first")
        outcome = self.game.step(as_numbers("the action", action, self.action_space.shape)[None])
        terminated = bool(outcome.terminated[0])
        self._playing = not terminated
        self._rendering.record()
        info = only_lane(self.game.step_values(outcome))
        if terminated:
            info |= only_lane(self.game.end_values(outcome))
        return self.game.observation()[0], float(outcome.reward[0]), terminated, False, info

    def render(self) -> Frame | None:
        """The figure of the game so far, (H, W, 3), or a line; None without a render mode, and in a window.

        Raises:
            RuntimeError: there is a figure to draw and no game has begun.
        """
        return self._rendering.only_frame()

    def close(self) -> None:
        """Free the figure, and close the window."""
        self._rendering.close()


def only_lane(values: Values) -> dict[str, Any]:
    """Infos of the only lane as plain Python values."""
    info: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, dict):
            info[key] = only_lane(value)
        else:
            info[key] = value[0] if value.dtype == object else value[0].item()
    return info
