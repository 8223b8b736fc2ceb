"""The defender's seat over N runs of a simulation: it turns actions into decisions, shows what is seen, scores it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.envs.actions import choices
from spoofgym.envs.config import DefenderConfig
from spoofgym.envs.defender_features import DefenderFeatures
from spoofgym.envs.objectives import deviation_values
from spoofgym.envs.observation import observation_space
from spoofgym.envs.range_features import satellites_in_view
from spoofgym.envs.standing import Standing, horizontal_error
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.scenario import Scenario
from spoofgym.simulation import Simulation

USE, EXCLUDE = 0, 1


def demands_on(scenario: Scenario, bank: str | None = None) -> Demands:
    """What a defender in the seat asks of the scenario's navigator.

    Args:
        scenario: of the game.
        bank: of hypotheses that it sees, if any: it looks at the unaided inertial solution.
    """
    history = max(scenario.history, *scenario.depth_table)
    return Demands(excludes=True, history=history, auxiliary=bank is not None)


@dataclass(frozen=True)
class DefenderOutcome:
    """What one step of N lanes gave the defender.

    Attributes:
        error: reward for the error of the estimate, (N,).
        exclusion: reward for leaving clean GNSS out, (N,).
        backtrack_asked: epochs that the action asked to take back, (N,); 0 where its depth was not read.
        backtrack: epochs whose fixes were taken back, (N,).
        used: whether the fix was used, (N,).
        left_out: satellites in view that were left out of a fix that was used, (N,).
        ignored: choices to leave a satellite out in an empty slot, (N,).
        diverged: whether the filter has diverged, (N,).
        terminated: the game is over, (N,).
    """

    error: Floats
    exclusion: Floats
    backtrack_asked: Runs
    backtrack: Runs
    used: Flags
    left_out: Runs
    ignored: Runs
    diverged: Flags
    terminated: Flags

    @property
    def reward(self) -> Floats:
        """The sum of the reward terms, (N,)."""
        return self.error + self.exclusion


@dataclass(frozen=True)
class Choice:
    """What the actions of N lanes mean in their present epoch.

    Attributes:
        exclude: whether the whole fix is left out, (N,).
        asked: epochs that are asked to be taken back, (N,); 0 where the depth is not read.
        backtrack: epochs to take back, (N,): none where the coast is as long.
        in_view: satellites in view, (N,); 0 on fixes.
        out: whether each slot's satellite is left out, (N, S).
        ignored: choices to leave a satellite out in an empty slot, (N,).
    """

    exclude: Flags
    asked: Runs
    backtrack: Runs
    in_view: Runs
    out: Flags
    ignored: Runs

    @property
    def decision(self) -> Decision:
        """As the simulation takes it."""
        satellites = ~self.out if self.out.any() else None
        return Decision(~self.exclude, self.backtrack if self.backtrack.any() else None, satellites=satellites)


class DefenderSeat:
    """The defender's seat over N runs of a simulation.

    Attributes:
        config: what the defender is paid: the arguments of Defender-v0.
        simulation: the shared world.
        features: what the observation is made of.
        fields: the entries of the observation, in order.
        observation_space: of one lane.
        space: of the action of one lane.
        depths: the depth table, (D,), epochs.
        error: horizontal error of the estimate when last resolved, (N,), m.
        coast: epochs since a fix was last used, (N,).
        excluding: whether the last decision was to exclude, (N,).
        outcome: of the last step.
    """

    outcome: DefenderOutcome

    def __init__(self, simulation: Simulation, config: DefenderConfig, detectors: Sequence[str]) -> None:
        """Sit down.

        Args:
            simulation: the shared world; its navigator was built with `demands_on` its scenario.
            config: what the defender is paid; its scenario, attacks and fidelity are those of the simulation.
            detectors: names of the simulation's detectors whose statistics the defender sees.

        Raises:
            ValueError: the bank of the ``config`` is none, or needs what the scenario does not give.
        """
        scenario, num_lanes = simulation.scenario, simulation.num_runs
        self.config, self.simulation = config, simulation
        self.depths: Runs = np.array(scenario.depth_table, dtype=np.int64)
        self.features = DefenderFeatures(scenario, simulation, detectors, num_lanes, config.bank)
        self.fields = self.features.fields
        self.observation_space = observation_space(self.fields)
        self.space = spaces.MultiDiscrete([2, len(self.depths)] + [2] * scenario.slots)
        satellites = f", then {scenario.slots} times 0 or 1" if scenario.slots else ""
        self._valid = f"[0 or 1, 0 to {len(self.depths) - 1}{satellites}]"
        self.error = np.zeros(num_lanes)
        self.coast = np.zeros(num_lanes, dtype=np.int64)
        self.excluding = np.zeros(num_lanes, dtype=bool)
        self._scale = config.error_scale or scenario.defender_scale
        self._horizon = scenario.timeline.num_epochs
        self._total_error = np.zeros(num_lanes)
        self._all = np.arange(num_lanes)

    def begin(self, lanes: Runs) -> None:
        """Begin new games, whose present epoch is their clean epoch 0."""
        self._forget(lanes)
        self.features.update(self.excluding, self.coast, lanes)

    def _forget(self, lanes: Runs) -> None:
        self.error[lanes] = horizontal_error(self.simulation)[lanes]
        self.coast[lanes] = 0
        self.excluding[lanes] = False
        self._total_error[lanes] = 0.0
        self.features.reset(lanes)

    def read(self, actions: NDArray[Any]) -> Runs:
        """Actions as whole numbers, (N, 2 + S).

        Raises:
            ValueError: an action lies outside the action space or is no number, or the actions have the wrong shape.
        """
        return choices("defender", actions, len(self._all), self.space.nvec, self._valid)

    def act(self, actions: Runs) -> Decision:
        """What becomes of the present fixes.

        Args:
            actions: as `read` gives them, (N, 2 + S): 0 = use or 1 = exclude, the place of the depth in the table and,
                where the filter takes ranges, 0 = use or 1 = leave out the satellite of each slot.
        """
        self._choice = self.choice(actions)
        self.excluding = self._choice.exclude
        return self._choice.decision

    def choice(self, actions: Runs) -> Choice:
        """What actions (N, 2 + S) mean in the present epoch; nothing is done yet."""
        present, chosen = self.present, actions[:, 2:] == EXCLUDE
        in_view, out = np.add.reduce(present, axis=1, dtype=np.int64), present & chosen
        left_out = np.add.reduce(out, axis=1, dtype=np.int64)
        exclude = (actions[:, 0] == EXCLUDE) | ((left_out == in_view) & (left_out > 0))
        asked = np.where(exclude & ~self.excluding, self.depths[actions[:, 1]], 0)
        backtrack = np.where(asked > self.coast, asked, 0)
        ignored = np.add.reduce(chosen & ~present, axis=1, dtype=np.int64)
        return Choice(exclude, asked, backtrack, in_view, out, ignored)

    def resolved(self) -> None:
        """Note what the estimate became and price the decision: the present fix of every lane has been resolved."""
        simulation, choice = self.simulation, self._choice
        self._backtracked, self._used = simulation.navigator.backtracked.copy(), simulation.used.copy()
        self.error = horizontal_error(simulation)
        self._total_error += self.error
        self._error_term = -np.minimum(self.error / self._scale, self.config.error_clip)
        left_out = np.add.reduce(choice.out, axis=1, dtype=np.int64)
        share = np.where(choice.exclude, 1.0, left_out / np.maximum(choice.in_view, 1))
        self._exclusion_term = np.where((share > 0.0) & self.clean, -self.config.exclusion_cost * share, 0.0)
        self._left_out = np.where(self._used, left_out, 0)

    def observed(self, restarting: Runs | None = None) -> None:
        """See the new present epoch; in ``restarting`` lanes it is the clean epoch 0 of a new game."""
        self.coast = np.where(self.simulation.used, 0, self.coast + 1)
        if restarting is not None and len(restarting):
            self._forget(restarting)
        self.features.update(self.excluding, self.coast, self._all)

    def score(self, standing: Standing) -> None:
        """Pay for the step: put its rewards and ends into `outcome`."""
        error, diverged, choice = self._error_term, standing.diverged, self._choice
        if diverged.any():
            left = np.where(diverged, self._horizon - self.simulation.epoch.index, 0)
            self._total_error += left * self.error
            error = np.where(diverged, -self.config.error_clip * (left + 1), error)
        self.outcome = DefenderOutcome(
            error,
            self._exclusion_term,
            choice.asked,
            self._backtracked,
            self._used,
            self._left_out,
            choice.ignored,
            diverged,
            standing.terminated,
        )

    @property
    def reward(self) -> Floats:
        """Of the last step, (N,)."""
        return self.outcome.reward

    @property
    def present(self) -> Flags:
        """Whether each slot holds a satellite in the present epoch, (N, S); none in an outage, S = 0 on fixes."""
        return satellites_in_view(self.simulation)

    def action_masks(self) -> Flags:
        """Which value of each part of the action is open to it, part after part, (N, sum of the parts' numbers).

        As MaskablePPO of sb3-contrib expects. To leave a satellite out is open where its slot holds one; all else is
        always open.
        """
        masks = np.ones((len(self._all), int(self.space.nvec.sum())), dtype=bool)
        first = 2 + len(self.depths)
        masks[:, first + EXCLUDE :: 2] = self.present
        return masks

    @property
    def clean(self) -> Flags:
        """Whether there is a present fix, neither spoofed nor disturbed by multipath, (N,)."""
        simulation = self.simulation
        epoch, confounders = simulation.epoch, simulation.confounders
        assert epoch.available is not None
        clean = epoch.available & ~simulation.attacked
        return clean if confounders is None else clean & ~confounders.multipath[self._all, epoch.index]

    def observation(self) -> NDArray[np.float32]:
        """What each lane's defender sees, (N, D)."""
        return self.features.observation()

    def reset_values(self) -> dict[str, Any]:
        """Infos after a reset, of all lanes."""
        return {"epoch": self.simulation.epoch.index, "error": self.error, **deviation_values(self.simulation)}

    def step_values(self, outcome: DefenderOutcome) -> dict[str, Any]:
        """Infos after a step, of all lanes."""
        return {
            "epoch": self.simulation.epoch.index,
            "error": self.error,
            "alarm": self.simulation.alarm,
            "used": outcome.used,
            "coast": self.coast,
            "backtrack_asked": outcome.backtrack_asked,
            "backtrack": outcome.backtrack,
            "reward_terms": {"error": outcome.error, "exclusion": outcome.exclusion},
            **self._satellite_values(outcome),
            **deviation_values(self.simulation),
        }

    def _satellite_values(self, outcome: DefenderOutcome) -> dict[str, Runs]:
        if not self.simulation.scenario.slots:
            return {}
        return {"satellites_left_out": outcome.left_out, "satellites_ignored": outcome.ignored}

    def end_values(self, outcome: DefenderOutcome) -> dict[str, Any]:
        """Infos of games that are over, of all lanes."""
        words = np.where(outcome.diverged, "diverged", "finished").astype(object)
        return {"mean_error": self._total_error / self._horizon, "outcome": words}
