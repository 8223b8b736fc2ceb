"""What the native vector environments have in common: seeds, autoreset modes, infos in Gymnasium's layout."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.envs.config import check_options, configure
from spoofgym.envs.rendering import METADATA, FigureType, Frame, Rendering, check_render_lanes, check_render_mode
from spoofgym.simulation import Simulation

MOST_LANES = 20_000
"""A defender's lane takes 100 kB and more: the history of its filter."""

Observations = Any
"""What the players of all lanes see: an array (N, D), or a dictionary of them where several play."""
Values = dict[str, Any]
"""Infos of all lanes: arrays (N,), or a dictionary of them."""


class AnyOutcome(Protocol):
    """What one step of N lanes gave, at least."""

    @property
    def reward(self) -> Floats:
        """Of the step, (N,)."""

    @property
    def terminated(self) -> Flags:
        """The game is over, (N,)."""


class Game(Protocol):
    """N lanes of a game, from one player's seat."""

    simulation: Simulation

    @property
    def observation_space(self) -> spaces.Space[Any]:
        """Of one lane."""

    @property
    def action_space(self) -> spaces.Space[Any]:
        """Of one lane."""

    @property
    def index(self) -> Runs:
        """Epoch of each lane, (N,)."""

    def reset(self, lanes: Runs) -> None:
        """Start new games, up to the clean epoch 0."""

    def step(self, actions: Any, restarting: Runs | None = None) -> Any:
        """One epoch of every lane; ``restarting`` lanes begin a new game instead, whatever their action."""

    def observation(self) -> Observations:
        """What each lane's player sees, (N, D)."""

    def reset_values(self) -> Values:
        """Infos after a reset."""

    def step_values(self, outcome: Any) -> Values:
        """Infos after a step."""

    def end_values(self, outcome: Any) -> Values:
        """Infos of a game that is over, beside those of its last step."""


class NativeVectorEnv(VectorEnv[Observations, NDArray[Any], NDArray[Any]]):
    """N lanes of a game, each bit-identical to the single environment seeded ``seed + i``.

    Observations, rewards, ends and infos are those of a `gymnasium.vector.SyncVectorEnv` of single environments, in all
    three autoreset modes. Lanes do not depend on their number nor on ``threads``.

    Args:
        num_envs: lanes N.
        autoreset_mode: an `AutoresetMode` or its value; the default is Gymnasium's, NEXT_STEP.
        max_episode_steps: epochs after which a lane is truncated; None = never, the game ends by itself.
        render_mode: of the single environment; `render` gives a frame per lane.
        render_lanes: lanes that are shown, the first ones; None = all of nine or fewer lanes, lane 0 of more.
        arguments: those of the single environment.

    Attributes:
        config_type: of the arguments.
        game_type: builds a game of N lanes from them.
        figure_type: draws one lane of it.
    """

    metadata: dict[str, Any] = dict(METADATA)

    config_type: type
    game_type: Callable[[Any, int], Game]
    figure_type: FigureType

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        render_lanes: int | None = None,
        **arguments: Any,
    ) -> None:
        """Set N lanes up.

        Raises:
            ValueError: an argument out of range.
            DependencyNotInstalled: the render mode needs a package that is missing.
        """
        owner = type(self).__name__
        num_envs = validation.whole(owner, "num_envs", num_envs, 1, MOST_LANES)
        render_mode = check_render_mode(owner, render_mode)
        shown_lanes = check_render_lanes(owner, render_lanes, num_envs, render_mode)
        if max_episode_steps is not None:
            max_episode_steps = validation.whole(owner, "max_episode_steps", max_episode_steps, 1)
        if not isinstance(autoreset_mode, AutoresetMode):
            modes = tuple(mode.value for mode in AutoresetMode)
            autoreset_mode = AutoresetMode(validation.one_of(owner, "autoreset_mode", autoreset_mode, modes))
        self.num_envs = num_envs
        self.config: Any = configure(self.config_type, arguments)
        self.game: Any = type(self).game_type(self.config, num_envs)
        self.autoreset_mode = autoreset_mode
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = render_mode
        self._rendering = Rendering(render_mode, self.game, type(self).figure_type, shown_lanes)
        self.single_observation_space = self.game.observation_space
        self.single_action_space = self.game.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._max_episode_steps = max_episode_steps
        self._all = np.arange(num_envs)
        self._done = np.zeros(num_envs, dtype=bool)
        self._started = np.zeros(num_envs, dtype=bool)
        self._generators: dict[int, np.random.Generator] = {}
        self._seeds: dict[int, int] = {}

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Start new games.

        Args:
            seed: lane i is seeded ``seed + i``; or a sequence with a seed (or None) per lane; None = the streams go on.
            options: ``{"reset_mask": bool (N,)}`` resets those lanes only.

        Raises:
            ValueError: a seed that is no integer or negative, a sequence of them of the wrong length, an unknown
                option, or a mask of the wrong shape or without any lane.
            TypeError: options that are no dictionary, or a mask that is not a boolean array.
        """
        mask = self._reset_mask(options)
        lanes = np.flatnonzero(mask)
        seeds: Sequence[int | None]
        owner = type(self).__name__
        if isinstance(seed, list | tuple | range) or (isinstance(seed, np.ndarray) and seed.ndim == 1):
            seeds = [validation.seed(owner, item) for item in seed]
        else:
            first = validation.seed(owner, seed)
            seeds = [None if first is None else first + i for i in range(self.num_envs)]
        if len(seeds) != self.num_envs:
            raise ValueError(f"{owner}: seed must be one number or {self.num_envs} of them, got {len(seeds)}")
        for lane in lanes:
            if seeds[lane] is not None or lane not in self._generators:
                self._seed_lane(int(lane), seeds[lane])
        self.game.reset(lanes)
        self._done[lanes] = False
        self._started[lanes] = True
        self._rendering.restart(lanes)
        return self.game.observation(), self._reset_info(mask)

    def _seed_lane(self, lane: int, seed: int | None) -> None:
        self._generators[lane], self._seeds[lane] = seeding.np_random(seed)
        self.game.simulation.streams.replace(lane, self._generators[lane])

    def _seed_rest(self) -> None:
        """Give the lanes that were never reset random seeds, as `gymnasium.Env` does when it is asked for its own."""
        for lane in range(self.num_envs):
            if lane not in self._generators:
                self._seed_lane(lane, None)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """Generator of each lane, as of `gymnasium.vector.SyncVectorEnv`."""
        self._seed_rest()
        return tuple(self._generators[lane] for lane in range(self.num_envs))

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """Seed of each lane; a reset with None leaves it."""
        self._seed_rest()
        return tuple(self._seeds[lane] for lane in range(self.num_envs))

    def _reset_mask(self, options: dict[str, Any] | None) -> Flags:
        check_options(type(self).__name__, options, ("reset_mask",))
        if not options:
            return np.ones(self.num_envs, dtype=bool)
        mask = options["reset_mask"]
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            raise TypeError(f"options['reset_mask'] must be a boolean array, got {validation.shown(mask)}")
        if mask.shape != (self.num_envs,) or not mask.any():
            raise ValueError(
                f"options['reset_mask'] must have shape ({self.num_envs},) and at least one True, got "
                f"{validation.shown(mask)}"
            )
        return mask

    def step(
        self, actions: NDArray[Any]
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

    def _play(self, actions: NDArray[Any], restarting: Runs | None) -> tuple[Any, Flags]:
        outcome = self.game.step(actions, restarting)
        self._rendering.record(restarting)
        truncated = np.zeros(self.num_envs, dtype=bool)
        if self._max_episode_steps is not None:
            truncated = self.game.index >= self._max_episode_steps
        return outcome, truncated

    def _step_then_reset(
        self, actions: NDArray[Any]
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
        self, outcome: AnyOutcome, truncated: Flags, done: Flags
    ) -> tuple[Observations, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """SAME_STEP: the observation is that of the new game, the old one's end is in the info."""
        final = self.game.observation()
        final_obs = np.full(self.num_envs, None, dtype=object)
        for lane in np.flatnonzero(done):
            final_obs[lane] = _of_lane(final, int(lane))
        final_info = self._step_info(outcome, done)
        info = {} if done.all() else self._step_info(outcome, ~done)
        self.game.reset(np.flatnonzero(done))
        self._rendering.restart(np.flatnonzero(done))
        _fill(info, self._reset_info(done), done)
        info |= {
            "final_obs": final_obs,
            "_final_obs": done.copy(),
            "final_info": final_info,
            "_final_info": done.copy(),
        }
        return self.game.observation(), outcome.reward, outcome.terminated, truncated, info

    def render(self) -> tuple[Frame | None, ...] | None:  # type: ignore[override]
        """A frame per lane: the figure of its game so far, (H, W, 3), or a line.

        Lanes that are not shown have None in place of it. None without a render mode, and where a window shows them.

        Raises:
            RuntimeError: there are figures to draw and a game has not begun.
        """
        frames = self._rendering.frames()
        return None if frames is None else (*frames, *[None] * (self.num_envs - len(frames)))

    def close_extras(self, **kwargs: Any) -> None:
        """Free the figures, and close the window."""
        self._rendering.close()

    def _reset_info(self, mask: Flags) -> dict[str, Any]:
        return _masked(self.game.reset_values(), mask)

    def _step_info(self, outcome: AnyOutcome, mask: Flags) -> dict[str, Any]:
        """The single environment's infos in Gymnasium's layout: arrays, each with its mask."""
        info = _masked(self.game.step_values(outcome), mask)
        over = outcome.terminated & mask
        if over.any():
            _put(info, _masked(self.game.end_values(outcome), over))
        return info


def _of_lane(observation: Observations, lane: int) -> Any:
    if isinstance(observation, dict):
        return {agent: seen[lane] for agent, seen in observation.items()}
    return observation[lane]


def _masked(values: Values, mask: Flags) -> dict[str, Any]:
    """Each array with zeros (None for objects) where the mask is False, and the mask beside it."""
    everyone = bool(mask.all())
    info: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, dict):
            info[key] = _masked(value, mask)
        elif everyone:
            info[key] = value.copy()
        else:
            absent = None if value.dtype == object else np.zeros((), dtype=value.dtype)
            info[key] = np.where(mask, value, absent)
        info[f"_{key}"] = mask.copy()
    return info


def _put(info: dict[str, Any], part: dict[str, Any]) -> None:
    """Put further entries into an info, those of each agent into its own dictionary."""
    for key, value in part.items():
        if isinstance(value, dict) and key in info:
            _put(info[key], value)
        else:
            info[key] = value


def _fill(info: dict[str, Any], part: dict[str, Any], mask: Flags) -> None:
    """Put the entries of the lanes in ``mask`` beside those of the others."""
    for key, value in part.items():
        if key not in info:
            info[key] = value
        elif isinstance(value, dict):
            _fill(info[key], value, mask)
        else:
            info[key][mask] = value[mask]
