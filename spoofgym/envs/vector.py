"""The native vector forms of Spoofer-v0 and Defender-v0: N lanes of the same game in one batch."""

from __future__ import annotations

from spoofgym.arrays import Flags
from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.native import NativeVectorEnv
from spoofgym.envs.spoofer_game import SpooferGame


class SpooferVectorEnv(NativeVectorEnv):
    """N lanes of Spoofer-v0; arguments as `NativeVectorEnv` and those of `spoofgym.envs.spoofer.SpooferEnv`."""

    config_type = SpooferConfig
    game_type = SpooferGame


class DefenderVectorEnv(NativeVectorEnv):
    """N lanes of Defender-v0; arguments as `NativeVectorEnv` and those of `spoofgym.envs.defender.DefenderEnv`."""

    config_type = DefenderConfig
    game_type = DefenderGame

    def action_masks(self) -> Flags:
        """Which values of the actions are open to each lane, (N, M), as `DefenderSeat.action_masks`."""
        masks: Flags = self.game.seat.action_masks()
        return masks
