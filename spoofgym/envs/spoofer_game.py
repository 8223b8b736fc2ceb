"""The spoofer's game on N lanes: what the single and the vector environment have in common."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.calibration import calibrated
from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.detectors.cpi_theory import kappa
from spoofgym.envs.actions import rates
from spoofgym.envs.config import SpooferConfig
from spoofgym.envs.frames import FrameStack, stacked_fields
from spoofgym.envs.observation import AXES, Squash, observation_space, spoofer_fields
from spoofgym.envs.shadow import shadow_filter
from spoofgym.navigation.interface import RangeNavigator
from spoofgym.navigation.mean import MeanFilter
from spoofgym.responses import make_response
from spoofgym.responses.base import Response
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.tracking import draw_tracking_error
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams

OWNER = "Spoofer-v0"
MOST_ENTRIES = 2**26
"""Of the observations of all lanes: 256 MiB."""
INNOVATION_UNIT = 4.0
"""One unit of the innovation action, in sigma per axis."""


@dataclass(frozen=True)
class Outcome:
    """What one step of N lanes gave.

    Attributes:
        growth: reward for the growth of the error, (N,).
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


class SpooferGame:
    """N lanes of the spoofer's game.

    Attributes:
        config: its arguments.
        simulation: the world.
        shadow: the spoofer's copy of the filter, or None for a blind one.
        error: horizontal error of the estimate when last resolved, (N,), m.
        clock_error: of the receiver's clock when last resolved, (N,), m; 0 where the filter takes fixes.
        offset: that the spoofer means to send in the present epoch, (N, 3), m ENU; (N, 4), with that of the receiver's
            clock, m, where the filter takes ranges.
    """

    def __init__(self, config: SpooferConfig, num_lanes: int, *, streams: RunStreams | None = None) -> None:
        """Set the game up.

        Args:
            config: its arguments.
            num_lanes: N.
            streams: random streams of the lanes; None = of fresh entropy, until the lanes are seeded.

        Raises:
            ValueError: a part that is unknown or does not fit the scenario.
        """
        self.config = config
        with validation.argument(OWNER, "scenario"):
            scenario = make_scenario(config.scenario, config.coupling)
        self._ranges = scenario.coupling == "tight"
        if self._ranges and config.action == "innovation":
            raise ValueError(
                f"action 'innovation' is for filters on fixes: scenario {scenario.name!r} is tightly coupled, and no "
                "offset provokes any innovation of the ranges; use action='rate'"
            )
        given = config.detector if isinstance(config.detector, tuple | list) else (config.detector,)
        with validation.argument(OWNER, "detector"):
            # copies: an object that the caller gives to two environments must not carry memories between them
            detectors: Sequence[Detector] = [calibrated(deepcopy(make_detector(part)), scenario) for part in given]
        names = [detector.name for detector in detectors]
        if len(set(names)) < len(names):
            raise ValueError(f"{OWNER}: detector: each detector can be given once only, got {', '.join(names)}")
        dimension = 3 if self._ranges else scenario.dimension
        fields = spoofer_fields(config.knowledge, dimension, tuple(names), self._ranges)
        self.fields = stacked_fields(fields, config.frames)
        if num_lanes * len(self.fields) > MOST_ENTRIES:
            raise ValueError(
                f"{OWNER}: frames times num_envs must leave {MOST_ENTRIES} entries of observations at most, got frames="
                f"{config.frames} with num_envs={num_lanes}"
            )
        with validation.argument(OWNER, "response"):
            response: Response | None = deepcopy(make_response(config.response))
        if config.on_alarm == "end":
            response = None
        self.simulation = Simulation(
            scenario,
            None,
            detectors,
            response,
            num_lanes,
            fidelity=config.fidelity,
            threads=config.threads,
            on_divergence="hold",
            streams=streams,
        )
        self.scenario = scenario
        self.num_lanes = num_lanes
        self.shadow: MeanFilter | None = None
        if config.knowledge != "blind":
            with validation.argument(OWNER, "shadow" if config.shadow is not None else "scenario"):
                believed = scenario if config.shadow is None else make_scenario(config.shadow, config.coupling)
                self.shadow = shadow_filter(scenario, believed, num_lanes, self.simulation.slices)
        self.observation_space = observation_space(self.fields)
        rates = (*scenario.drag_off_rate, scenario.clock_rate) if self._ranges else scenario.drag_off_rate
        self.action_space = spaces.Box(-1.0, 1.0, (len(rates),), np.float32)
        self.error = np.zeros(num_lanes)
        self.clock_error = np.zeros(num_lanes)
        self._squash = Squash(fields)
        self._frames = FrameStack(num_lanes, config.frames, len(fields))
        self._start_error = np.zeros(num_lanes)
        self.offset = np.zeros((num_lanes, len(rates)))
        self._velocity = scenario.velocity()
        timeline = scenario.timeline
        self._horizon, self._interval, self._intervals = timeline.num_epochs, timeline.interval, timeline.intervals
        self._reach = np.array(rates) * self._intervals[:, None]
        self._tracking_sigma = np.full((num_lanes, 1), config.tracking_sigma)
        self._all = np.arange(num_lanes)
        self._tracking = np.zeros((num_lanes, self._horizon + 1, 6))
        self._alarmed = np.zeros(num_lanes, dtype=bool)
        self._nobody = np.zeros(num_lanes, dtype=bool)
        self._thresholds = np.array([detector.threshold for detector in detectors])

    @property
    def index(self) -> Runs:
        """Epoch of each lane, (N,)."""
        return self.simulation.epoch.index

    def reset(self, lanes: Runs) -> None:
        """Start new games up to the clean epoch 0."""
        self.simulation.reset(lanes)
        self._begin(lanes)
        self._frames.begin(lanes, self._frame()[lanes])

    def _begin(self, lanes: Runs) -> None:
        error = self._horizontal()[lanes]
        self.error[lanes] = error
        self._start_error[lanes] = error
        self._read_clock(lanes)
        self.offset[lanes] = 0.0
        self._alarmed[lanes] = False
        if self.config.tracking_sigma:
            sigma, time, shape = self.config.tracking_sigma, self.config.tracking_time, self._tracking.shape[1:]
            for lane in lanes:
                stream = self.simulation.streams(lane, "tracking")
                self._tracking[lane] = draw_tracking_error(stream, shape, sigma, time, self._intervals)
        if self.shadow is not None:
            self.shadow.reset(lanes)

    def _horizontal(self) -> Floats:
        """Horizontal error of the estimate, (N,), m."""
        error = self.simulation.error
        return np.sqrt(error[:, 0] ** 2 + error[:, 1] ** 2)

    def _read_clock(self, lanes: Runs) -> None:
        if self._ranges:
            self.clock_error[lanes] = cast(RangeNavigator, self.simulation.navigator).clock_error[lanes]

    def step(self, actions: NDArray[Any], restarting: Runs | None = None) -> Outcome:
        """One epoch of every lane; ``restarting`` lanes begin a new game instead, whatever their action.

        Args:
            actions: in [-1, 1], (N, 3), or (N, 4) where the filter takes ranges.
            restarting: indices of lanes.

        Raises:
            ValueError: an action is not finite or no number, or the actions have the wrong shape.
        """
        actions = rates(actions, self.offset.shape)
        simulation = self.simulation
        simulation.resolve()
        error = self._horizontal()
        self._read_clock(self._all)
        previous = self.offset
        self.offset = self._intend(np.minimum(np.maximum(actions, -1.0), 1.0), previous)
        if restarting is not None and len(restarting):
            simulation.restart(restarting)
            self.offset[restarting] = 0.0
        sent = self.offset
        if self.config.tracking_sigma:
            following = np.minimum(simulation.epoch.index + 1, self._horizon)
            sent = sent.copy()
            sent[:, :3] += self._tracking[self._all, following, :3]
            if restarting is not None:
                sent[restarting] = 0.0
        epoch = simulation.observe(sent)
        if restarting is not None and len(restarting):
            self._begin(restarting)
            error[restarting] = self.error[restarting]
        if self.shadow is not None:
            interval = self._intervals[np.maximum(epoch.index - 1, 0)]
            self.shadow.advance(epoch.index, self.offset, previous, interval)
        outcome = self._score(error)
        present = self._frame()
        self._frames.push(present)
        if restarting is not None:
            self._frames.begin(restarting, present[restarting])
        return outcome

    def _intend(self, actions: Floats, previous: Floats) -> Floats:
        """The offset that the spoofer means to send, (N, 3) or (N, 4), m ENU and m."""
        if self.config.action == "rate":
            return previous + actions * self._reach[np.minimum(self.index, self._horizon - 1)]
        assert self.shadow is not None  # the configuration refuses a blind spoofer with this action
        following = np.minimum(self.index + 1, self._horizon)
        return self.shadow.offset_for(following, INNOVATION_UNIT * actions)

    def _score(self, error: Floats) -> Outcome:
        """Rewards and ends after the new epoch; ``error`` is that of the epoch just resolved, (N,)."""
        index = self.simulation.epoch.index
        alarm = self.simulation.alarm & (index > 0)
        self._alarmed = self._alarmed | alarm
        caught = alarm if self.config.on_alarm == "end" else self._nobody
        diverged = self.simulation.navigator.diverged
        last = (index == self._horizon) & ~caught & ~diverged
        if last.any():
            lanes = np.flatnonzero(last)
            self.simulation.resolve(runs=lanes)
            error[lanes] = self._horizontal()[lanes]
            self._read_clock(lanes)
        scale = self.scenario.error_scale
        diverged = diverged.copy()  # the last fix of a game, too, can make its filter diverge
        lost = caught | diverged if self.config.on_alarm == "end" else self._nobody
        growth = (error - self.error) / scale
        forfeit = np.where(lost, -self.config.forfeit * (error - self._start_error) / scale, 0.0)
        self.error = error
        return Outcome(growth, forfeit, alarm, self._alarmed, diverged, caught | last | diverged)

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
                for statistic, threshold in zip(epoch.statistics.values(), self._thresholds, strict=True):
                    parts.append(np.stack([statistic / threshold, np.full(self.num_lanes, threshold)], axis=1))
        return self._squash(np.concatenate(parts, axis=1))

    def _kappa_values(self) -> dict[str, dict[str, Floats]]:
        """κ per axis of the position: what the tracking error adds to the variance of the CPI's summands."""
        if not self.config.tracking_sigma:
            return {}
        information = np.zeros((self.num_lanes, 3))
        response = self.simulation.epoch.innovation.response
        for measurement in range(response.shape[1]):
            information += response[:, measurement] ** 2
        return {"kappa": dict(zip(AXES, kappa(self.config.tracking_sigma, information).T, strict=True))}

    def reset_values(self) -> dict[str, Any]:
        """Infos after a reset, of all lanes."""
        return {"epoch": self.index, "error": self.error, **self._clock_values()}

    def step_values(self, outcome: Outcome) -> dict[str, Any]:
        """Infos after a step, of all lanes."""
        return {
            "epoch": self.index,
            "error": self.error,
            "alarm": outcome.alarm,
            "reward_terms": {"growth": outcome.growth, "forfeit": outcome.forfeit},
            **self._kappa_values(),
            **self._clock_values(),
        }

    def _clock_values(self) -> dict[str, Floats]:
        return {"clock_error": self.clock_error} if self._ranges else {}

    def end_values(self, outcome: Outcome) -> dict[str, Any]:
        """Infos of games that are over."""
        words = np.where(outcome.alarmed, "detected", "undetected").astype(object)
        words[outcome.diverged] = "diverged"
        return {"outcome": words, "is_success": ~outcome.alarmed & ~outcome.diverged}
