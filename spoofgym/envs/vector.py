"""The native vector forms of the environments: N lanes of a game in one batch."""

from __future__ import annotations

from spoofgym.arrays import Flags
from spoofgym.envs.config import DefenderConfig, SpooferConfig
from spoofgym.envs.defender_figure import DefenderFigure
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.duel_config import DuelConfig, DuelDefenderConfig, DuelSpooferConfig
from spoofgym.envs.duel_game import DuelDefenderGame, DuelGame, DuelSpooferGame
from spoofgym.envs.native import NativeVectorEnv
from spoofgym.envs.spoofer_figure import SpooferFigure
from spoofgym.envs.spoofer_game import SpooferGame


class SpooferVectorEnv(NativeVectorEnv):
    """N lanes of Spoofer-v0; arguments as `NativeVectorEnv` and those of `spoofgym.envs.spoofer.SpooferEnv`."""

    config_type = SpooferConfig
    game_type = SpooferGame
    figure_type = SpooferFigure


class DefendingVectorEnv(NativeVectorEnv):
    """N lanes of a defender's game."""

    def action_masks(self) -> Flags:
        """Which values of the actions are open to each lane, (N, M), as `DefenderSeat.action_masks`."""
        masks: Flags = self.game.seat.action_masks()
        return masks


class DefenderVectorEnv(DefendingVectorEnv):
    """N lanes of Defender-v0; arguments as `NativeVectorEnv` and those of `spoofgym.envs.defender.DefenderEnv`."""

    config_type = DefenderConfig
    game_type = DefenderGame
    figure_type = DefenderFigure


class DuelSpooferVectorEnv(NativeVectorEnv):
    """N lanes of DuelSpoofer-v0; arguments as `NativeVectorEnv` and `spoofgym.envs.duel_sides.DuelSpooferEnv`."""

    config_type = DuelSpooferConfig
    game_type = DuelSpooferGame
    figure_type = DefenderFigure


class DuelDefenderVectorEnv(DefendingVectorEnv):
    """N lanes of DuelDefender-v0; arguments as `NativeVectorEnv` and `spoofgym.envs.duel_sides.DuelDefenderEnv`."""

    config_type = DuelDefenderConfig
    game_type = DuelDefenderGame
    figure_type = DefenderFigure


class DuelVectorEnv(NativeVectorEnv):
    """N duels in one batch; arguments as `NativeVectorEnv` and those of `spoofgym.envs.duel.DuelParallelEnv`.

    Actions, observations and infos are dictionaries by agent, ``spoofer`` and ``defender``, of arrays of N lanes. The
    reward (N,) is the spoofer's; that of the defender is its negative.
    """

    config_type = DuelConfig
    game_type = DuelGame
    figure_type = DefenderFigure
