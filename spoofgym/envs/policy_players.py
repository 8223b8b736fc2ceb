"""Learned policies that fill a seat of somebody else's game, as an attack or as a response of its simulation.

Each has a seat of its own over the shared simulation and sees there what it was trained to see: its own knowledge,
frames, detectors and shadow filter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.attacks.base import Attack
from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.envs.defender_seat import DefenderSeat, demands_on
from spoofgym.envs.spoofer_seat import SpooferSeat
from spoofgym.envs.trained import defender_config, sees_decisions, spoofer_config
from spoofgym.navigation.interface import Clock, Decision, Epoch
from spoofgym.policies.learned import LearnedDefender, LearnedSpoofer
from spoofgym.responses.base import Response
from spoofgym.scenario import Scenario
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams


class PolicySpoofer(Attack):
    """A learned spoofer as an attack."""

    closed_loop = True

    def __init__(self, policy: LearnedSpoofer, name: str | None = None) -> None:
        """Let ``policy`` play.

        Args:
            policy: who plays.
            name: the specification that builds this attack; None = the name of the policy, which builds none.
        """
        self._policy, self._name = policy, policy.name if name is None else name
        self._config, self._sees_decisions = spoofer_config(policy), sees_decisions(policy)
        self.knowledge = self._config.knowledge
        self.has_tracking_error = self._config.tracking_sigma > 0.0

    @property
    def name(self) -> str:
        """The specification that builds this attack, or the name of the policy."""
        return self._name

    def join(self, simulation: Simulation) -> None:
        """Sit down in a simulation.

        Raises:
            ValueError: it does not offer what the policy was trained on.
        """
        config = self._config
        names = _names(config.detector) if config.knowledge == "full" else ()
        _require_detectors(self.name, names, simulation)
        try:
            self._seat = SpooferSeat(simulation, config, names, self._sees_decisions)
        except ValueError as error:
            raise ValueError(f"{self.name!r} cannot play on scenario {simulation.scenario.name!r}: {error}") from error
        self._policy.check_layout([field.name for field in self._seat.fields])
        rates, wanted = self._seat.space.shape[0], len(self._policy.biases[-1])
        if rates != wanted:
            raise ValueError(f"{self.name!r} was trained to choose {wanted} rates, the game has {rates}")
        self._sent = np.zeros((simulation.num_runs, rates))

    def reset(self, runs: Runs, streams: RunStreams) -> None:
        """Start new episodes: draw how the spoofer errs about the vehicle's position."""
        self._seat.draw(runs)

    def offset(self, clock: Clock) -> Floats:
        """See the present epoch and choose the offset of the coming one, (N, 3), m ENU."""
        seat = self._seat
        seat.observed(np.flatnonzero(seat.simulation.epoch.index == 0))
        actions = seat.read(self._policy.act(seat.observation()))
        self._sent = seat.act(actions, np.flatnonzero(clock.index <= 0))
        return self._sent[:, :3]

    def clock_offset(self, clock: Clock) -> Floats:
        """How far the receiver's clock is pulled away at the coming epoch, (N,), m; after `offset`."""
        return self._sent[:, 3] if self._sent.shape[1] == 4 else np.zeros(len(self._sent))


class PolicyDefender(Response):
    """A learned defender as a response: it follows its own observations, not an alarm."""

    in_position = False

    def __init__(self, policy: LearnedDefender, name: str, scenario: Scenario) -> None:
        """Let ``policy`` decide in games of ``scenario``; ``name`` is the specification that builds this response."""
        self._policy, self._name = policy, name
        self._config = defender_config(policy)
        self.demands = demands_on(scenario, self._config.bank)

    @property
    def name(self) -> str:
        """The specification that builds this response."""
        return self._name

    def join(self, simulation: Simulation) -> None:
        """Sit down in a simulation.

        Raises:
            ValueError: it does not offer what the policy was trained on.
        """
        names = _names(self._config.detectors)
        _require_detectors(self.name, names, simulation)
        self._seat = DefenderSeat(simulation, self._config, names)
        self._policy.check_layout([field.name for field in self._seat.fields])
        trained, here = (self._policy.depths, self._policy.slots), (len(self._seat.depths), simulation.scenario.slots)
        if trained != here:
            raise ValueError(
                f"{self.name!r} was trained on {trained[0]} depths and {trained[1]} slots of satellites, the game has "
                f"{here[0]} and {here[1]}"
            )

    def begin(self, runs: Runs, epoch: Epoch, alarm: Flags) -> Decision:
        """Decide on epoch 0 of some runs alone."""
        seat = self._seat
        seat.begin(runs)
        choice = seat.choice(self._policy.act(seat.observation()))
        seat.excluding[runs] = choice.exclude[runs]
        return choice.decision.of(runs)

    def decide(self, epoch: Epoch, alarm: Flags) -> Decision:
        """What becomes of this epoch's fix."""
        seat = self._seat
        seat.observed(np.flatnonzero(epoch.index == 0))
        return seat.act(self._policy.act(seat.observation()))


def _names(given: str | Detector | Sequence[str | Detector]) -> tuple[str, ...]:
    """Names of the detectors that a policy was trained to see."""
    several = given if isinstance(given, tuple | list) else (given,)
    return tuple(make_detector(part).name for part in several)


def _require_detectors(player: str, wanted: Sequence[str], simulation: Simulation) -> None:
    """Refuse a simulation that does not run the detectors of a policy.

    Raises:
        ValueError: naming those of the policy and those of the simulation.
    """
    running = tuple(simulation.detectors)
    if not set(wanted) <= set(running):
        here = ", ".join(running) or "none"
        raise ValueError(f"{player!r} was trained to see the detectors {', '.join(wanted)}; the game runs {here}")
