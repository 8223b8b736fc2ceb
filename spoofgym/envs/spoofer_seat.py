"""The spoofer's seat over N runs of a simulation: it turns actions into offsets, shows what is seen, scores it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.detectors.cpi_theory import kappa
from spoofgym.envs.actions import rates
from spoofgym.envs.config import SpooferConfig
from spoofgym.envs.frames import FrameStack, stacked_fields
from spoofgym.envs.objectives import ErrorObjective, Objective, deviation_values
from spoofgym.envs.observation import Field, Squash, observation_space, spoofer_fields
from spoofgym.envs.shadow import shadow_filter
from spoofgym.envs.standing import Standing, horizontal_error
from spoofgym.geodesy import AXES
from spoofgym.navigation.facts import RANGES
from spoofgym.navigation.interface import RangeNavigator
from spoofgym.navigation.mean import MeanFilter
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.tracking import draw_tracking_error
from spoofgym.simulation import Simulation

OWNER = "Spoofer-v0"
MOST_ENTRIES = 2**26
"""Of the observations of all lanes: 256 MiB."""
INNOVATION_UNIT = 4.0
"""One unit of the innovation action, in sigma per axis."""
DECISION_FIELDS = (Field("last fix used", "1", 0.0), Field("epochs taken back with it", "epochs", 20.0))
"""What a spoofer that sees the defender's decisions sees beside all else."""


@dataclass(frozen=True)
class SpooferOutcome:
    """What one step of N lanes gave the spoofer.

    Attributes:
        growth: reward for the growth of the objective, (N,).
        forfeit: what an alarm, or a filter that diverges, takes back, (N,).
        alarm: whether a detector alarmed in this epoch of the game, (N,).
        alarmed: whether one has alarmed since the game began, (N,).
        diverged: whether the victim's filter has diverged, (N,).
        terminated: the game is over, (N,).
    """

    growth: Floats
    forfeit: Floats
    alarm: Flags
    alarmed: Flags
    diverged: Flags
    terminated: Flags

    @property
    def reward(self) -> Floats:
        """The sum of the reward terms, (N,)."""
        return self.growth + self.forfeit


def frame_fields(
    config: SpooferConfig, scenario: Scenario, detectors: Sequence[str], num_lanes: int, sees_decisions: bool = False
) -> tuple[Field, ...]:
    """What one epoch shows a spoofer, checked before a simulation of so many lanes is built.

    Args:
        config: what the spoofer knows and does.
        scenario: of the game.
        detectors: names of those whose statistics a spoofer with knowledge "full" sees.
        num_lanes: N.
        sees_decisions: whether it sees what the defender decided last.

    Raises:
        ValueError: the action does not fit the scenario, or the observation is too large.
    """
    ranges = RANGES in scenario.offers
    if ranges and config.action == "innovation":
        raise ValueError(
            f"action 'innovation' is for filters on fixes: scenario {scenario.name!r} is tightly coupled, and no "
            "offset provokes any innovation of the ranges; use action='rate'"
        )
    fields = spoofer_fields(config.knowledge, 3 if ranges else scenario.dimension, tuple(detectors), ranges)
    if sees_decisions:
        fields += DECISION_FIELDS
    if num_lanes * config.frames * len(fields) > MOST_ENTRIES:
        raise ValueError(
            f"{config.owner}: frames times num_envs must leave {MOST_ENTRIES} entries of observations at most, got "
            f"frames={config.frames} with num_envs={num_lanes}"
        )
    return fields


class SpooferSeat:
    """The spoofer's seat over N runs of a simulation.

    Attributes:
        config: what the spoofer knows and does: the arguments of Spoofer-v0.
        simulation: the shared world.
        shadow: the spoofer's copy of the filter, or None for a blind one.
        fields: the entries of the observation, in order.
        observation_space: of one lane.
        space: of the action of one lane.
        error: horizontal error of the estimate when last resolved, (N,), m.
        clock_error: of the receiver's clock when last resolved, (N,), m; 0 where the filter takes fixes.
        offset: that the spoofer means to send in the present epoch, (N, 3), m ENU; (N, 4), with that of the receiver's
            clock, m, where the filter takes ranges.
        outcome: of the last step.
    """

    outcome: SpooferOutcome

    def __init__(
        self,
        simulation: Simulation,
        config: SpooferConfig,
        detectors: Sequence[str],
        sees_decisions: bool = False,
        objective: Objective | None = None,
    ) -> None:
        """Sit down.

        Args:
            simulation: the shared world; its spoofer is this one, or chosen by its actions.
            config: what the spoofer knows and does; its scenario, fidelity and response are those of the simulation.
            detectors: names of the simulation's detectors whose statistics a spoofer with knowledge "full" sees.
            sees_decisions: whether it sees what the defender decided last.
            objective: whose growth it is paid for; None = the error.

        Raises:
            ValueError: the scenario does not offer what the spoofer needs, or the observation is too large.
        """
        scenario = simulation.scenario
        self.config, self.simulation = config, simulation
        num_lanes = simulation.num_runs
        fields = frame_fields(config, scenario, detectors, num_lanes, sees_decisions)
        self._sees_decisions = sees_decisions
        self.fields = stacked_fields(fields, config.frames)
        self._ranges = RANGES in scenario.offers
        self.shadow: MeanFilter | None = None
        if config.knowledge != "blind":
            with validation.argument(config.owner, "shadow" if config.shadow is not None else "scenario"):
                believed = scenario if config.shadow is None else make_scenario(config.shadow, config.coupling)
                self.shadow = shadow_filter(scenario, believed, num_lanes, simulation.slices)
        self.observation_space = observation_space(self.fields)
        limits = (*scenario.drag_off_rate, scenario.clock_rate) if self._ranges else scenario.drag_off_rate
        self.space = spaces.Box(-1.0, 1.0, (len(limits),), np.float32)
        self.error = np.zeros(num_lanes)
        self.clock_error = np.zeros(num_lanes)
        self._squash = Squash(fields)
        self._frames = FrameStack(num_lanes, config.frames, len(fields))
        self._resolved_error = np.zeros(num_lanes)
        self._objective = ErrorObjective() if objective is None else objective
        self._value, self._start_value = np.zeros(num_lanes), np.zeros(num_lanes)
        self.offset = np.zeros((num_lanes, len(limits)))
        self._previous = self.offset
        self._velocity = scenario.velocity()
        timeline = scenario.timeline
        self._horizon, self._interval, self._intervals = timeline.num_epochs, timeline.interval, timeline.intervals
        self._reach = np.array(limits) * self._intervals[:, None]
        self._tracking_sigma = np.full((num_lanes, 1), config.tracking_sigma)
        self._all = np.arange(num_lanes)
        self._tracking = np.zeros((num_lanes, self._horizon + 1, 6))
        self._alarmed = np.zeros(num_lanes, dtype=bool)
        self._nobody = np.zeros(num_lanes, dtype=bool)
        self._detectors = tuple(detectors)
        self._thresholds = np.array([simulation.detectors[name].threshold for name in detectors])

    def draw(self, lanes: Runs) -> None:
        """Draw what is random of the spoofer in new games: how it errs about the vehicle's position."""
        if not self.config.tracking_sigma:
            return
        sigma, time, shape = self.config.tracking_sigma, self.config.tracking_time, self._tracking.shape[1:]
        for lane in lanes:
            stream = self.simulation.streams(lane, "tracking")
            self._tracking[lane] = draw_tracking_error(stream, shape, sigma, time, self._intervals)

    def begin(self, lanes: Runs) -> None:
        """Begin new games, whose present epoch is their clean epoch 0."""
        self._forget(lanes)
        self._frames.begin(lanes, self._frame()[lanes])

    def _forget(self, lanes: Runs) -> None:
        error = horizontal_error(self.simulation)[lanes]
        self.error[lanes] = error
        self._resolved_error[lanes] = error
        value = self._objective.of(self.simulation)[lanes]
        self._value[lanes] = value
        self._start_value[lanes] = value
        self._read_clock(lanes)
        self.offset[lanes] = 0.0
        self._alarmed[lanes] = False
        if self.shadow is not None:
            self.shadow.reset(lanes)

    def _read_clock(self, lanes: Runs) -> None:
        if self._ranges:
            self.clock_error[lanes] = cast(RangeNavigator, self.simulation.navigator).clock_error[lanes]

    def read(self, actions: NDArray[Any]) -> Floats:
        """Actions as numbers of double precision within [-1, 1], (N, 3) or (N, 4).

        Raises:
            ValueError: an action is not finite or no number, or the actions have the wrong shape.
        """
        return np.minimum(np.maximum(rates("spoofer", actions, self.offset.shape), -1.0), 1.0)

    def towards(self, offset: Floats) -> Floats:
        """The rates that send ``offset`` at the coming epoch, or come as near to it as they may, (N, 3) or (N, 4)."""
        index = np.minimum(self.simulation.epoch.index, self._horizon - 1)
        return np.minimum(np.maximum((offset - self.offset) / self._reach[index], -1.0), 1.0)

    def act(self, actions: Floats, restarting: Runs | None = None) -> Floats:
        """What is sent at the coming epoch.

        Args:
            actions: as `read` gives them, (N, 3), or (N, 4) where the filter takes ranges.
            restarting: indices of lanes whose coming epoch is the clean epoch 0 of a new game.

        Returns:
            Offsets, (N, 3), m ENU, or (N, 4) with that of the receiver's clock, m.
        """
        self._previous = self.offset
        self.offset = self._intend(actions)
        if restarting is not None and len(restarting):
            self.offset[restarting] = 0.0
        if not self.config.tracking_sigma:
            return self.offset
        following = np.minimum(self.simulation.epoch.index + 1, self._horizon)
        sent = self.offset.copy()
        sent[:, :3] += self._tracking[self._all, following, :3]
        if restarting is not None:
            sent[restarting] = 0.0
        return sent

    def _intend(self, actions: Floats) -> Floats:
        """The offset that the spoofer means to send, (N, 3) or (N, 4), m ENU and m."""
        index = self.simulation.epoch.index
        if self.config.action == "rate":
            return self.offset + actions * self._reach[np.minimum(index, self._horizon - 1)]
        assert self.shadow is not None  # the configuration refuses a blind spoofer with this action
        return self.shadow.offset_for(np.minimum(index + 1, self._horizon), INNOVATION_UNIT * actions)

    def resolved(self, lanes: Runs | None = None) -> None:
        """Note what the estimate became: the present fix of lanes (all by default) has been resolved."""
        error = horizontal_error(self.simulation)
        if lanes is None:
            self._resolved_error = error
            self._read_clock(self._all)
        else:
            self._resolved_error[lanes] = error[lanes]
            self._read_clock(lanes)

    def observed(self, restarting: Runs | None = None) -> None:
        """See the new present epoch; in ``restarting`` lanes it is the clean epoch 0 of a new game."""
        if restarting is not None and len(restarting):
            self._forget(restarting)
        if self.shadow is not None:
            index = self.simulation.epoch.index
            interval = self._intervals[np.maximum(index - 1, 0)]
            self.shadow.advance(index, self.offset, self._previous, interval)
        present = self._frame()
        self._frames.push(present)
        if restarting is not None:
            self._frames.begin(restarting, present[restarting])

    def score(self, standing: Standing) -> None:
        """Pay for the step: put its rewards and ends into `outcome`."""
        error, scale = self._resolved_error, self.simulation.scenario.error_scale
        value = self._objective.of(self.simulation) if self._objective.drives else error
        self._alarmed = self._alarmed | standing.alarm
        lost = standing.caught | standing.diverged if self.config.on_alarm == "end" else self._nobody
        growth = (value - self._value) / scale
        forfeit = np.where(lost, -self.config.forfeit * (value - self._start_value) / scale, 0.0)
        self.error, self._value = error, value.copy()
        self.outcome = SpooferOutcome(
            growth, forfeit, standing.alarm, self._alarmed, standing.diverged, standing.terminated
        )

    @property
    def reward(self) -> Floats:
        """Of the last step, (N,)."""
        return self.outcome.reward

    def observation(self) -> NDArray[np.float32]:
        """What each lane's spoofer sees, (N, frames * D)."""
        return self._frames.observation()

    def _frame(self) -> NDArray[np.float32]:
        """The present epoch's part of it, (N, D)."""
        epoch = self.simulation.epoch
        velocity = self._velocity[epoch.index]
        if self.config.tracking_sigma:
            velocity += self._tracking[self._all, epoch.index, 3:] / self._interval
        parts = [self.offset, (epoch.index / self._horizon)[:, None], velocity, self._tracking_sigma]
        shadow = self.shadow
        if shadow is not None:
            parts += [shadow.whitened, shadow.coming, shadow.position_error, shadow.velocity_error]
            if self._ranges:
                parts.append(shadow.clock_error[:, None])
            if self.config.knowledge == "full":
                parts.append(epoch.innovation.in_position.whitened)
                for name, threshold in zip(self._detectors, self._thresholds, strict=True):
                    ratio = epoch.statistics[name] / threshold
                    parts.append(np.stack([ratio, np.full(len(ratio), threshold)], axis=1))
        if self._sees_decisions:
            parts.append(self._last_decision())
        return self._squash(np.concatenate(parts, axis=1))

    def _last_decision(self) -> Floats:
        """Whether the fix before was used, and the epochs taken back with it, (N, 2); zeros at the start of a game."""
        simulation = self.simulation
        decided = simulation.epoch.index > 0
        return np.stack([simulation.used & decided, simulation.navigator.backtracked * decided], axis=1).astype(float)

    def reset_values(self) -> dict[str, Any]:
        """Infos after a reset, of all lanes."""
        return {"epoch": self.simulation.epoch.index, "error": self.error, **self._further_values()}

    def step_values(self, outcome: SpooferOutcome) -> dict[str, Any]:
        """Infos after a step, of all lanes."""
        return {
            "epoch": self.simulation.epoch.index,
            "error": self.error,
            "alarm": outcome.alarm,
            "reward_terms": {"growth": outcome.growth, "forfeit": outcome.forfeit},
            **self._kappa_values(),
            **self._further_values(),
        }

    def _kappa_values(self) -> dict[str, dict[str, Floats]]:
        """κ per axis of the position: what the tracking error adds to the variance of the CPI's summands."""
        if not self.config.tracking_sigma:
            return {}
        response = self.simulation.epoch.innovation.response
        information = np.zeros((len(response), 3))
        for measurement in range(response.shape[1]):
            information += response[:, measurement] ** 2
        return {"kappa": dict(zip(AXES, kappa(self.config.tracking_sigma, information).T, strict=True))}

    def _further_values(self) -> dict[str, Floats]:
        """Of the receiver's clock and of the vehicle, where the game has them."""
        clock = {"clock_error": self.clock_error} if self._ranges else {}
        return clock | deviation_values(self.simulation)

    def end_values(self, outcome: SpooferOutcome) -> dict[str, Any]:
        """Infos of games that are over, of all lanes."""
        words = np.where(outcome.alarmed, "detected", "undetected").astype(object)
        words[outcome.diverged] = "diverged"
        return {"outcome": words, "is_success": ~outcome.alarmed & ~outcome.diverged}
