"""The native vector forms of Spoofer-v0 and Defender-v0: N lanes of the same game in one batch."""

from __future__ import annotations

from typing import Any

from gymnasium.vector import AutoresetMode

from spoofgym.envs.config import DefenderConfig, SpooferConfig, configure
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.native import NativeVectorEnv, check_arguments
from spoofgym.envs.spoofer_game import SpooferGame


class SpooferVectorEnv(NativeVectorEnv):
    """N lanes of Spoofer-v0, each bit-identical to the single environment seeded ``seed + i``.

    Args:
        num_envs: lanes N.
        autoreset_mode: an `AutoresetMode` or its value; the default is Gymnasium's, NEXT_STEP.
        max_episode_steps: epochs after which a lane is truncated; None = never, the game ends by itself.
        render_mode: None; only the single environment draws.
        arguments: those of Spoofer-v0.

    Raises:
        ValueError: an argument out of range.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        check_arguments(num_envs, max_episode_steps, render_mode)
        self.config = configure(SpooferConfig, arguments)
        super().__init__(SpooferGame(self.config, num_envs), num_envs, autoreset_mode, max_episode_steps)


class DefenderVectorEnv(NativeVectorEnv):
    """N lanes of Defender-v0, each bit-identical to the single environment seeded ``seed + i``.

    Args:
        num_envs: lanes N.
        autoreset_mode: an `AutoresetMode` or its value; the default is Gymnasium's, NEXT_STEP.
        max_episode_steps: epochs after which a lane is truncated; None = never, the game ends by itself.
        render_mode: None; only the single environment draws.
        arguments: those of Defender-v0.

    Raises:
        ValueError: an argument out of range.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **arguments: Any,
    ) -> None:
        check_arguments(num_envs, max_episode_steps, render_mode)
        self.config = configure(DefenderConfig, arguments)
        super().__init__(DefenderGame(self.config, num_envs), num_envs, autoreset_mode, max_episode_steps)
