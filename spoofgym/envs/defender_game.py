"""The defender's game on N lanes: what the single and the vector environment have in common."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.attacks import opponents
from spoofgym.calibration import calibrated_all
from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.envs.actions import choices
from spoofgym.envs.config import DefenderConfig
from spoofgym.envs.defender_features import DefenderFeatures
from spoofgym.envs.observation import observation_space
from spoofgym.envs.privileged import PrivilegedState
from spoofgym.envs.range_features import satellites_in_view
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.confounders import Confounders, Disturbances
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams

OWNER = "Defender-v0"
USE, EXCLUDE = 0, 1


@dataclass(frozen=True)
class Outcome:
    """What one step of N lanes gave.

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


class DefenderGame:
    """N lanes of the defender's game.

    Attributes:
        config: its arguments.
        scenario: what is played on.
        simulation: the world.
        attacks: the population from which each lane draws its opponent.
        confounders: the receiver's outages and multipath.
        privileged: called, it gives what a critic may know in training and no defender ever, (N, P).
        depths: the depth table, (D,), epochs.
        error: horizontal error of the estimate when last resolved, (N,), m.
        coast: epochs since a fix was last used, (N,).
        excluding: whether the last decision was to exclude, (N,).
    """

    def __init__(
        self,
        config: DefenderConfig,
        num_lanes: int,
        beside: Sequence[Detector] = (),
        *,
        streams: RunStreams | None = None,
        disturbances: Disturbances | None = None,
    ) -> None:
        """Set the game up.

        Args:
            config: its arguments.
            num_lanes: N.
            beside: detectors, with their thresholds, among which are all of the game's own: the simulation runs these,
                the defender sees its own.
            streams: random streams of the lanes; None = of fresh entropy, until the lanes are seeded.
            disturbances: of the receiver, in place of those of ``config``.

        Raises:
            ValueError: a part that is unknown or does not fit the scenario.
        """
        self.config = config
        with validation.argument(OWNER, "scenario"):
            scenario = self.scenario = make_scenario(config.scenario, config.coupling)
        given = config.detectors if isinstance(config.detectors, tuple | list) else (config.detectors,)
        with validation.argument(OWNER, "detectors"):
            # copies: an object that the caller gives to two environments must not carry memories between them
            detectors = [deepcopy(make_detector(part)) for part in given]
        for detector in detectors:
            scenario.facts.require(
                f"detector {detector.name!r}", detector.needs, "choose others: detectors=('snapshot', 'windowed:n=5')"
            )
        if not beside:
            detectors = calibrated_all(detectors, scenario)
        names = [detector.name for detector in detectors]
        if len(set(names)) < len(names):
            raise ValueError(f"{OWNER}: detectors: each detector can be given once only, got {', '.join(names)}")
        running = [deepcopy(detector) for detector in beside] or detectors
        missing = set(names) - {detector.name for detector in running}
        if missing:
            raise ValueError(f"detectors of the game are not among those beside it: {', '.join(sorted(missing))}")
        self.num_lanes = num_lanes
        self.depths: Runs = np.array(scenario.depth_table, dtype=np.int64)
        with validation.argument(OWNER, "attacks"):
            self.attacks = opponents(config.attacks, config.clean)
        shares = Disturbances(outage_share=config.outage, multipath_share=config.multipath)
        self.confounders = Confounders(shares if disturbances is None else disturbances)
        self.simulation = Simulation(
            scenario,
            self.attacks,
            running,
            None,
            num_lanes,
            fidelity=config.fidelity,
            threads=config.threads,
            demands=Demands(excludes=True, history=max(scenario.history, int(self.depths.max()))),
            confounders=self.confounders,
            on_divergence="hold",
            streams=streams,
        )
        self.features = DefenderFeatures(scenario, self.simulation, names, num_lanes)
        self.privileged = PrivilegedState(self.simulation, self.attacks, self.confounders, scenario.defender_scale)
        self.fields = self.features.fields
        self.observation_space = observation_space(self.fields)
        self.action_space = spaces.MultiDiscrete([2, len(self.depths)] + [2] * scenario.slots)
        satellites = f", then {scenario.slots} times 0 or 1" if scenario.slots else ""
        self._valid = f"[0 or 1, 0 to {len(self.depths) - 1}{satellites}]"
        self.error = np.zeros(num_lanes)
        self.coast = np.zeros(num_lanes, dtype=np.int64)
        self.excluding = np.zeros(num_lanes, dtype=bool)
        self._scale = config.error_scale or scenario.defender_scale
        self._horizon = scenario.timeline.num_epochs
        self._total_error = np.zeros(num_lanes)
        self._all = np.arange(num_lanes)

    @property
    def index(self) -> Runs:
        """Epoch of each lane, (N,)."""
        return self.simulation.epoch.index

    def reset(self, lanes: Runs) -> None:
        """Start new games up to the clean epoch 0."""
        self.simulation.reset(lanes)
        self._begin(lanes)
        self.features.update(self.excluding, self.coast, lanes)

    def _begin(self, lanes: Runs) -> None:
        self.error[lanes] = self._horizontal()[lanes]
        self.coast[lanes] = 0
        self.excluding[lanes] = False
        self._total_error[lanes] = 0.0
        self.features.reset(lanes)

    def _horizontal(self) -> Floats:
        """Horizontal error of the estimate, (N,), m."""
        error = self.simulation.error
        return np.sqrt(error[:, 0] ** 2 + error[:, 1] ** 2)

    def step(self, actions: NDArray[Any], restarting: Runs | None = None) -> Outcome:
        """One epoch of every lane; ``restarting`` lanes begin a new game instead, whatever their action.

        Args:
            actions: (N, 2 + S): 0 = use or 1 = exclude, the place of the depth in the table and, where the filter takes
                ranges, 0 = use or 1 = leave out the satellite of each slot.
            restarting: indices of lanes.

        Raises:
            ValueError: an action lies outside the action space or is no number, or the actions have the wrong shape.
        """
        actions = choices(actions, self.num_lanes, self.action_space.nvec, self._valid)
        present, chosen = self.present, actions[:, 2:] == EXCLUDE
        in_view, out = np.add.reduce(present, axis=1, dtype=np.int64), present & chosen
        left_out = np.add.reduce(out, axis=1, dtype=np.int64)
        exclude = (actions[:, 0] == EXCLUDE) | ((left_out == in_view) & (left_out > 0))
        asked = np.where(exclude & ~self.excluding, self.depths[actions[:, 1]], 0)
        backtrack = np.where(asked > self.coast, asked, 0)
        simulation = self.simulation
        satellites = ~out if out.any() else None
        simulation.resolve(Decision(~exclude, backtrack if backtrack.any() else None, satellites=satellites))
        taken_back, used = simulation.navigator.backtracked.copy(), simulation.used.copy()
        self.excluding = exclude
        self.coast = np.where(used, 0, self.coast + 1)
        self.error = self._horizontal()
        self._total_error += self.error
        error = -np.minimum(self.error / self._scale, self.config.error_clip)
        share = np.where(exclude, 1.0, left_out / np.maximum(in_view, 1))
        exclusion = np.where((share > 0.0) & self.clean, -self.config.exclusion_cost * share, 0.0)
        left_out = np.where(used, left_out, 0)
        ignored = np.add.reduce(chosen & ~present, axis=1, dtype=np.int64)
        if restarting is not None and len(restarting):
            simulation.restart(restarting)
        simulation.observe()
        if restarting is not None and len(restarting):
            self._begin(restarting)
        self.features.update(self.excluding, self.coast, self._all)
        diverged = simulation.navigator.diverged.copy()
        if diverged.any():
            left = np.where(diverged, self._horizon - self.index, 0)
            self._total_error += left * self.error
            error = np.where(diverged, -self.config.error_clip * (left + 1), error)
        over = diverged | (self.index == self._horizon)
        return Outcome(error, exclusion, asked, taken_back, used, left_out, ignored, diverged, over)

    @property
    def present(self) -> Flags:
        """Whether each slot holds a satellite in the present epoch, (N, S); none in an outage, S = 0 on fixes."""
        return satellites_in_view(self.simulation)

    def action_masks(self) -> Flags:
        """Which value of each part of the action is open to it, part after part, (N, sum of the parts' numbers).

        As MaskablePPO of sb3-contrib expects. To leave a satellite out is open where its slot holds one; all else is
        always open.
        """
        masks = np.ones((self.num_lanes, int(self.action_space.nvec.sum())), dtype=bool)
        first = 2 + len(self.depths)
        masks[:, first + EXCLUDE :: 2] = self.present
        return masks

    @property
    def attacked(self) -> Flags:
        """Whether the present fix is spoofed, (N,)."""
        return self.simulation.attacked

    @property
    def clean(self) -> Flags:
        """Whether there is a present fix, neither spoofed nor disturbed by multipath, (N,)."""
        available = self.simulation.epoch.available
        assert available is not None
        return available & ~self.attacked & ~self.confounders.multipath[self._all, self.index]

    def observation(self) -> NDArray[np.float32]:
        """What each lane's defender sees, (N, D)."""
        return self.features.observation()

    def reset_values(self) -> dict[str, Any]:
        """Infos after a reset, of all lanes."""
        return {"epoch": self.index, "error": self.error}

    def step_values(self, outcome: Outcome) -> dict[str, Any]:
        """Infos after a step, of all lanes."""
        return {
            "epoch": self.index,
            "error": self.error,
            "alarm": self.simulation.alarm,
            "used": outcome.used,
            "coast": self.coast,
            "backtrack_asked": outcome.backtrack_asked,
            "backtrack": outcome.backtrack,
            "reward_terms": {"error": outcome.error, "exclusion": outcome.exclusion},
            **self._satellite_values(outcome),
        }

    def _satellite_values(self, outcome: Outcome) -> dict[str, Runs]:
        if not self.scenario.slots:
            return {}
        return {"satellites_left_out": outcome.left_out, "satellites_ignored": outcome.ignored}

    def end_values(self, outcome: Outcome) -> dict[str, Any]:
        """Infos of games that are over."""
        words = np.where(outcome.diverged, "diverged", "finished").astype(object)
        return {"mean_error": self._total_error / self._horizon, "outcome": words}
