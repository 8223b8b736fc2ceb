"""The duel as a PettingZoo parallel environment: a spoofer and a defender who both learn, or play."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from numpy.typing import NDArray

from spoofgym import validation
from spoofgym.envs.actions import as_numbers
from spoofgym.envs.config import configure
from spoofgym.envs.defender_figure import DefenderFigure
from spoofgym.envs.duel_config import DuelConfig
from spoofgym.envs.duel_game import AGENTS, DEFENDER, SPOOFER, DuelGame, check_agents
from spoofgym.envs.rendering import METADATA, Frame, Rendering, check_render_mode
from spoofgym.envs.single import LANE, only_lane

try:
    from pettingzoo import ParallelEnv
except ImportError as error:
    raise gym.error.DependencyNotInstalled(
        "the duel of two agents needs PettingZoo: pip install 'spoofgym[multiagent]'"
    ) from error

__all__ = ["DuelParallelEnv"]

Observations = dict[str, NDArray[np.float32]]
Infos = dict[str, dict[str, Any]]


class DuelParallelEnv(ParallelEnv[str, NDArray[np.float32], NDArray[Any]]):
    r"""The duel: a spoofer moves the GNSS position of a vehicle, a defender decides which fixes to trust.

    ## Description

    Both agents act at every epoch, and the game ends for both together. The defender's decision is about the fix that
    both have just seen. The spoofer's action is about the next one. The spoofer wants a large navigation error, the
    defender a small one: the game is zero-sum.

    In a share `clean` of the games nobody attacks. The spoofer's actions then have no effect, and no observation shows
    this: the defender must not exclude GNSS without a good reason. In all other games the spoofer chooses by its
    actions when to begin.
    The receiver may also lose GNSS for a while or suffer multipath, as in Defender-v0.

    ```python
    from spoofgym import duel

    env = duel.parallel_env(scenario="foi-drive")
    observations, infos = env.reset(seed=1)
    while env.agents:
        actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        observations, rewards, terminations, truncations, infos = env.step(actions)
    print(infos["spoofer"]["harm"])
    ```

    `duel.env()` is the same game in PettingZoo's agent-environment-cycle form.

    ## Action Space

    | Agent | Space | Meaning |
    |---|---|---|
    | `spoofer` | `Box(-1.0, 1.0, (3,), float32)`, on ranges `(4,)` | as Spoofer-v0: rates, or innovations |
    | `defender` | `MultiDiscrete([2, D])`, on ranges `[2, D] + [2] * S` | as Defender-v0: use or exclude, depth |

    ## Observation Space

    The spoofer sees what it sees in Spoofer-v0 with the same `knowledge`, `action`, `frames` and detectors. The
    defender sees what it sees in Defender-v0 with the same detectors. The pages of both have the tables. With
    `knowledge="full"` two entries follow those of Spoofer-v0 (in each frame):

    | Name | Unit | Scale |
    |---|---|---|
    | last fix used | 1 | not squashed |
    | epochs taken back with it | epochs | 20 |

    They tell what the defender decided about the fix before the present one; both are 0 at epoch 0.

    `state()` is what a central critic may see in training: both observations and the true state that
    `env.unwrapped.game.privileged()` gives.

    ## Rewards

    The harm of a game is the mean over its epochs of what the horizontal error of the estimate is worth, in real time:
    recomputing past epochs does not change the worth of their output. Where the scenario has `guidance=`
    (`docs/reference/guidance.md`), a payoff can be of the vehicle instead, and of where it is at epochs 1 to the last.

    | `payoff` | What one epoch is worth | Harm |
    |---|---|---|
    | `"error"` | the error, m, at most the scenario's `harm_cap` (200 m; 20 m on `song-robot`) | mean error, m |
    | `"error:CAP"` | the error, m, at most CAP | mean error, m |
    | `"beyond:LIMIT"` | 1 where the error exceeds LIMIT, m, else 0 | share of epochs |
    | `"deviation"` | distance of the vehicle from its path, m, at most `harm_cap` | mean distance, m |
    | `"deviation:CAP"` | the same distance, at most CAP | mean distance, m |
    | `"target:EAST/NORTH"` | how much nearer to that place the vehicle is than its path, m | mean, m |

    EAST and NORTH are metres from where the vehicle ought to be; the last payoff is negative where it is led away.

    The spoofer's reward of a step is what the epoch that the step resolves adds to the harm. The defender's reward is
    the negative of it. So the spoofer's return is the harm. If the filter diverges, this epoch and each that is left
    are worth the largest payoff, at once.

    ## Starting State

    As in Spoofer-v0 and Defender-v0: the filter is warm, and detectors remember clean epochs without an alarm.
    `reset` ends after the clean epoch 0. The defender's first decision is about its fix, the spoofer's first action
    about that of epoch 1. `reset` ignores options.

    ## Episode End

    - Terminated, for both: at the last epoch of the scenario, whose fix is observed and not decided on, or when the
      filter diverges.
    - Truncated: never.

    ## Information

    Of each agent, as in its own environment: `epoch`, `error`, `alarm`; `deviation` where the scenario has `guidance=`;
    `kappa` and `clock_error` of the spoofer;
    `used`, `coast`, `backtrack_asked`, `backtrack`, `satellites_left_out` and `satellites_ignored` of the defender.
    With the last step:

    - `harm`: of the game.
    - `outcome`: "finished" or "diverged".
    - `spoofer`, `defender`: who played, "agent" being the agent outside. `spoofer` is "none" in a clean game.

    `error` and all entries of the last step are for scores: no player knows them.

    ## Arguments

    | Name | Default | Meaning |
    |---|---|---|
    | `scenario` | `"foi-drive"` | specification `name[:value][,key=value...]`, or a `Scenario` |
    | `detectors` | as Defender-v0 | specification or `Detector`, or a tuple of them; both players may see them |
    | `knowledge` | `"shadow"` | what the spoofer knows: "blind", "shadow" or "full" |
    | `action` | `"rate"` | of the spoofer: "rate" or "innovation" |
    | `payoff` | `"error"` | "error", "beyond:LIMIT", "deviation" and others, see above |
    | `fidelity` | `"linear"` | "linear" (error states, one step per fix) or "strapdown" (IMU rate) |
    | `clean` | `0.5` | share of games without an attack |
    | `outage` | `0.15` | share of games in which the receiver loses GNSS for 10 to 40 s |
    | `multipath` | `0.15` | share of games with a burst of multipath, 3 to 8 m for 10 to 20 s |
    | `tracking_sigma` | `0.0` | how the spoofer errs about the vehicle's position, m, as in Spoofer-v0 |
    | `tracking_time` | `0.0` | correlation time of that error, s; 0: white |
    | `frames` | `1` | epochs that the spoofer's observation holds, the present one included |
    | `shadow` | `None` | scenario whose filter the spoofer takes for the victim's; None: the victim's own |
    | `coupling` | `None` | "loose" (the filter takes fixes) or "tight" (ranges); None: what the scenario is |
    | `threads` | `1` | threads for slices of lanes; results do not depend on it |
    | `render_mode` | `None` | "human", "rgb_array" or "ansi", see Rendering below |

    Every argument is checked when the environment is built. A value that is not valid is refused; the error names the
    argument and the valid values. So is a `tracking_time` without a `tracking_sigma`.

    ## Rendering

    | Mode | What `render()` gives | Needs |
    |---|---|---|
    | "human" | None: a window shows the figure at every `reset` and `step` | `spoofgym[render]` |
    | "rgb_array" | the figure of the game so far, (540, 960, 3) | `spoofgym[render]` |
    | "ansi" | a line that tells the present epoch | nothing |

    The N lanes of `duel.vector_env` show those that `render_lanes` says, the first ones (None: all of nine or fewer,
    else lane 0).

    ## One side, and many lanes

    A policy that learns one side alone plays `spoofgym/DuelSpoofer-v0` or `spoofgym/DuelDefender-v0`, Gymnasium
    environments whose argument `defender` or `spoofer` fills the other seat. `duel.vector_env(num_envs)` is N duels in
    one batch; lane i is bit-identical to this environment seeded `seed + i`.

    The same play has the same errors in every view, bit for bit: through this environment, its sides, and the N lanes.

    ## Version History

    - v0: first release.
    """

    metadata: dict[str, Any] = {
        "name": "spoofgym_duel_v0",
        **METADATA,
        "is_parallelizable": True,
    }

    def __init__(self, render_mode: str | None = None, **arguments: Any) -> None:
        """Set the game up; ``arguments`` are those of the environment's page."""
        check_render_mode("duel", render_mode)
        self.config = configure(DuelConfig, arguments)
        self.game = DuelGame(self.config, 1)
        self.render_mode = render_mode
        self.possible_agents = list(AGENTS)
        self.agents: list[str] = []
        self._observation_spaces = dict(self.game.observation_space)
        self._action_spaces = dict(self.game.action_space)
        self.state_space = self._state_space()
        self._rendering = Rendering(render_mode, self.game, DefenderFigure)
        self._generator: np.random.Generator | None = None

    def _state_space(self) -> spaces.Box:
        seen = [seat.observation_space.low for seat in self.game.seats.values()]
        low = np.concatenate([*seen, np.full(len(self.game.privileged.fields), -1.0, dtype=np.float32)])
        return spaces.Box(low, np.ones(len(low), dtype=np.float32), dtype=np.float32)

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Of an agent; the same object at every call."""
        return self._observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Of an agent; the same object at every call."""
        return self._action_spaces[agent]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observations, Infos]:
        """Start a new game. There are no options; what is given is ignored, as PettingZoo's own tests require.

        Raises:
            ValueError: a seed that is no integer or negative.
        """
        seed = validation.seed("duel", seed)
        if seed is not None or self._generator is None:
            self._generator, _ = seeding.np_random(seed)
            self.game.simulation.streams.replace(0, self._generator)
        self.game.reset(LANE)
        self.agents = list(self.possible_agents)
        self._rendering.restart(LANE)
        return self._observations(), only_lane(self.game.reset_values())

    def step(
        self, actions: dict[str, NDArray[Any]]
    ) -> tuple[Observations, dict[str, float], dict[str, bool], dict[str, bool], Infos]:
        """One GNSS epoch.

        Args:
            actions: of both agents, by their names.

        Raises:
            ValueError: an action is missing, is none of finite numbers, has the wrong shape, or lies outside the action
                space where that is discrete; or an agent is unknown.
            RuntimeError: the game is over or has not been started.
        """
        if not self.agents:
            raise RuntimeError("the game is over: call reset() first")
        check_agents(actions, AGENTS)
        lanes = {
            agent: as_numbers(f"the action of the {agent}", actions[agent], self._action_spaces[agent].shape)[None]
            for agent in AGENTS
        }
        outcome = self.game.step(lanes)
        terminated, payoff = bool(outcome.terminated[0]), float(outcome.reward[0])
        self._rendering.record()
        infos = only_lane(self.game.step_values(outcome))
        if terminated:
            self.agents = []
            for agent, values in only_lane(self.game.end_values(outcome)).items():
                infos[agent] |= values
        rewards = {SPOOFER: payoff, DEFENDER: -payoff}
        return self._observations(), rewards, dict.fromkeys(AGENTS, terminated), dict.fromkeys(AGENTS, False), infos

    def _observations(self) -> Observations:
        return {agent: observation[0] for agent, observation in self.game.observation().items()}

    def state(self) -> NDArray[np.float32]:
        """Both observations and the true state, for a central critic in training."""
        return np.concatenate([*self._observations().values(), self.game.privileged()[0]])

    def render(self) -> Frame | None:
        """The figure of the game so far, (H, W, 3), or a line; None without a render mode, and in a window."""
        return self._rendering.only_frame()

    def close(self) -> None:
        """Free the figure, and close the window."""
        self._rendering.close()
