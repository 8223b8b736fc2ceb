"""DuelSpoofer-v0 and DuelDefender-v0: the duel from one side, a given player on the other."""

from __future__ import annotations

from typing import Any

from spoofgym.arrays import Flags
from spoofgym.envs.config import configure
from spoofgym.envs.defender_figure import DefenderFigure
from spoofgym.envs.duel_config import DuelDefenderConfig, DuelSpooferConfig
from spoofgym.envs.duel_game import DuelDefenderGame, DuelGame, DuelSpooferGame
from spoofgym.envs.single import SingleEnv


class _SideEnv(SingleEnv):
    """One lane of the duel, one agent outside."""

    def __init__(self, game: DuelGame, render_mode: str | None) -> None:
        self.config = game.config
        super().__init__(game, render_mode, DefenderFigure)


class DuelSpooferEnv(_SideEnv):
    r"""The spoofer's side of the duel: raise the harm that a given defender, or a pool of them, lets happen.

    ## Description

    The game of `spoofgym.envs.duel.DuelParallelEnv`, whose page tells the rules, with a defender inside. A spoofer that
    learns here learns a best response to that defender; in a league the defender is a weighted pool.

    ```python
    import gymnasium

    env = gymnasium.make("spoofgym:spoofgym/DuelSpoofer-v0", defender="snapshot > exclude:reuse=5")
    ```

    ## Action Space

    `Box(-1.0, 1.0, (3,), float32)`, or `(4,)` on ranges, as in Spoofer-v0.

    ## Observation Space

    As in Spoofer-v0; with `knowledge="full"` it ends with the defender's last decision, as in the duel.

    ## Rewards

    What the step adds to the harm of the game, so the return is the harm (m, or share of epochs; `payoff`).

    ## Starting State, Episode End

    As in the duel.

    ## Information

    That of the duel's spoofer. With the last step come `harm`, `outcome`, and who played: `spoofer` ("agent", or "none"
    in a clean game) and `defender`.

    ## Arguments

    Those of the duel. In addition:

    | Name | Default | Meaning |
    |---|---|---|
    | `defender` | `"exclude"` | who defends: a response, `DETECTOR > RESPONSE`, `policy:FOLDER`, or a pool |

    `defender` is spelled as `response` of Spoofer-v0. The detector that a defender follows (`snapshot` of `snapshot >
    exclude`), and those that a policy sees, must be among `detectors`. Use `clean=0` to train on attacked games alone:
    in clean games nothing that the agent does has an effect.

    ## Version History

    - v0: first release.
    """

    def __init__(self, render_mode: str | None = None, **arguments: Any) -> None:
        """Set the game up; ``arguments`` are those of the environment's page."""
        self._check_render_mode(render_mode)
        super().__init__(DuelSpooferGame(configure(DuelSpooferConfig, arguments), 1), render_mode)


class DuelDefenderEnv(_SideEnv):
    r"""The defender's side of the duel: lower the harm that a given spoofer, or a pool of them, does.

    ## Description

    The game of `spoofgym.envs.duel.DuelParallelEnv`, whose page tells the rules, with a spoofer inside. A defender that
    learns here learns a best response to that spoofer; in a league the spoofer is a weighted pool.

    ```python
    import gymnasium

    env = gymnasium.make("spoofgym:spoofgym/DuelDefender-v0", spoofer=("ramp:0.5", "jump:20"))
    ```

    ## Action Space

    `MultiDiscrete([2, D])`, or `[2, D] + [2] * S` on ranges, as in Defender-v0.

    ## Observation Space

    As in Defender-v0.

    ## Rewards

    The negative of what the step adds to the harm of the game, so the return is the negative harm (m, or share of
    epochs; `payoff`). Excluding clean fixes costs nothing by itself, unlike in Defender-v0: the drift is its price.

    ## Starting State, Episode End

    As in the duel.

    ## Information

    That of the duel's defender. With the last step come `harm`, `outcome`, and who played: `spoofer` ("none" in a clean
    game) and `defender` ("agent").

    ## Arguments

    Those of the duel, without those of a spoofer outside (`knowledge`, `action`, `tracking_sigma`, `tracking_time`,
    `frames`, `shadow`): the spoofer inside brings its own. In addition:

    | Name | Default | Meaning |
    |---|---|---|
    | `spoofer` | `"training"` | who spoofs: a population, an attack, `policy:FOLDER`, or a pool |

    `spoofer` is spelled as `attacks` of Defender-v0.

    ## Version History

    - v0: first release.
    """

    def __init__(self, render_mode: str | None = None, **arguments: Any) -> None:
        """Set the game up; ``arguments`` are those of the environment's page."""
        self._check_render_mode(render_mode)
        super().__init__(DuelDefenderGame(configure(DuelDefenderConfig, arguments), 1), render_mode)

    def action_masks(self) -> Flags:
        """Which values of the action are open, (M,), as MaskablePPO of sb3-contrib expects."""
        masks: Flags = self.game.seat.action_masks()[0]
        return masks
