"""The duel: one game whose two seats are each filled by an agent outside, a policy, or a classical player."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from spoofgym import validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.attacks.base import Attack
from spoofgym.attacks.pool import AttackPool
from spoofgym.calibration import calibrated_for_play
from spoofgym.detectors.base import Detector
from spoofgym.envs.defender_seat import DefenderSeat, demands_on
from spoofgym.envs.duel_config import DuelConfig, DuelDefenderConfig, DuelSpooferConfig
from spoofgym.envs.game import Game
from spoofgym.envs.harm import Harm
from spoofgym.envs.monitors import make_monitors, require_fitting
from spoofgym.envs.opponents import make_defender, spoofer_pool
from spoofgym.envs.payoffs import make_payoff
from spoofgym.envs.privileged import PrivilegedState
from spoofgym.envs.spoofer_seat import SpooferSeat, frame_fields
from spoofgym.envs.view import OneSeatGame
from spoofgym.navigation.interface import Clock
from spoofgym.responses.pool import ResponsePool
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.confounders import Confounders, Disturbances
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams

OWNER = "duel"
SPOOFER, DEFENDER = "spoofer", "defender"
AGENTS = (SPOOFER, DEFENDER)


class AgentSpoofer(Attack):
    """The spoofer outside as an attack of the simulation: it sends what its seat says.

    Attributes:
        sent: at the coming epoch, (N, 3), m ENU, or (N, 4) with that of the receiver's clock, m.
    """

    closed_loop = True
    sent: Floats

    @property
    def name(self) -> str:
        """It has no specification."""
        return "agent"

    def offset(self, clock: Clock) -> Floats:
        """What is sent, (N, 3), m ENU."""
        return self.sent[:, :3]

    def clock_offset(self, clock: Clock) -> Floats:
        """How far the receiver's clock is pulled away, (N,), m."""
        return self.sent[:, 3] if self.sent.shape[1] == 4 else np.zeros(len(self.sent))


@dataclass(frozen=True)
class DuelOutcome:
    """What one step of N lanes gave.

    Attributes:
        reward: of the agent, or of the spoofer where both are outside, (N,).
        terminated: the game is over, (N,).
    """

    reward: Floats
    terminated: Flags


class DuelGame(Game):
    """N lanes of the duel.

    Attributes:
        config: its arguments.
        attacks: the spoofer, or the pool from which each lane draws one, with the share of clean games.
        confounders: the receiver's outages and multipath.
        harm: what the game is worth.
        excluding: whether the last decision was to exclude, (N,).
        privileged: function that returns the truth that a critic may see in training, (N, P). No player sees it.
    """

    harm: Harm
    excluding: Flags

    def __init__(
        self,
        config: DuelConfig,
        num_lanes: int,
        *,
        spoofer: Any = None,
        defender: Any = None,
        streams: RunStreams | None = None,
    ) -> None:
        """Set the game up.

        Args:
            config: its arguments.
            num_lanes: N.
            spoofer: who spoofs, as `spoofgym.envs.opponents` spells it; None = an agent outside.
            defender: who defends; None = an agent outside.
            streams: random streams of the lanes; None = of fresh entropy, until the lanes are seeded.

        Raises:
            ValueError: a part that is unknown or does not fit the scenario.
        """
        self.config = config
        with validation.argument(OWNER, "scenario"):
            scenario = make_scenario(config.scenario, config.coupling)
        payoff = make_payoff(config.payoff, scenario)
        detectors = _detectors(config, scenario, num_lanes)
        names = [detector.name for detector in detectors]
        self._agent = AgentSpoofer()
        with validation.argument(OWNER, "spoofer"):
            outside = AttackPool([(self._agent, 1.0)], config.clean, self._agent.name)
            self.attacks = outside if spoofer is None else spoofer_pool(spoofer, config.clean)
        with validation.argument(OWNER, "defender"):
            self._response = None if defender is None else make_defender(defender, scenario, detectors)
        self.confounders = Confounders(Disturbances(outage_share=config.outage, multipath_share=config.multipath))
        simulation = Simulation(
            scenario,
            self.attacks,
            detectors,
            self._response,
            num_lanes,
            fidelity=config.fidelity,
            threads=config.threads,
            demands=demands_on(scenario),
            confounders=self.confounders,
            on_divergence="hold",
            streams=streams,
        )
        self.privileged = PrivilegedState(simulation, self.attacks, self.confounders, scenario.defender_scale)
        super().__init__(
            simulation,
            spoofer=_spoofer_seat(simulation, config, names) if spoofer is None else None,
            defender=DefenderSeat(simulation, config.defender_side, names) if defender is None else None,
            harm=Harm(simulation, payoff),
        )

    @property
    def seats(self) -> dict[str, SpooferSeat | DefenderSeat]:
        """The seats that are filled from outside, by agent."""
        pairs = ((SPOOFER, self.spoofer), (DEFENDER, self.defender))
        return {agent: seat for agent, seat in pairs if seat is not None}

    @property
    def error(self) -> Floats:
        """Horizontal error of the estimate when last resolved, (N,), m."""
        return next(iter(self.seats.values())).error

    @property
    def attacked(self) -> Flags:
        """Whether the present fix is spoofed, (N,)."""
        return self.simulation.attacked

    def _observe(self, sent: Floats | None) -> None:
        """Let the next epoch come; in clean games nothing of what the spoofer sends arrives."""
        if sent is not None:
            self._agent.sent = sent
        self.simulation.observe()

    def _decides_on_last_fix(self) -> bool:
        """Nobody decides on it, whoever sits where."""
        return False

    def step(self, actions: dict[str, NDArray[Any]], restarting: Runs | None = None) -> DuelOutcome:
        """One epoch of every lane; ``restarting`` lanes begin a new game instead, whatever their actions.

        Args:
            actions: by agent, (N, 3) or (N, 4) of the spoofer and (N, 2 + S) of the defender.
            restarting: indices of lanes.

        Raises:
            ValueError: the actions are not those of the agents outside, or one is refused by its seat; nothing has been
                played then.
        """
        check_agents(actions, tuple(self.seats))
        decided = ~self.simulation.decision.use
        self.advance(actions.get(SPOOFER), actions.get(DEFENDER), restarting)
        self.excluding = decided if self.defender is None else self.defender.excluding
        return DuelOutcome(self.harm.step, self._terminated())

    def _terminated(self) -> Flags:
        return (self.index == self._horizon) | self.simulation.navigator.diverged

    @property
    def observation_space(self) -> spaces.Dict:
        """Of one lane, by agent."""
        return spaces.Dict({agent: seat.observation_space for agent, seat in self.seats.items()})

    @property
    def action_space(self) -> spaces.Dict:
        """Of one lane, by agent."""
        return spaces.Dict({agent: seat.space for agent, seat in self.seats.items()})

    def observation(self) -> Any:
        """What each lane's agents see, by agent, (N, D)."""
        return {agent: seat.observation() for agent, seat in self.seats.items()}

    def reset_values(self) -> dict[str, Any]:
        """Infos after a reset, by agent."""
        return {agent: seat.reset_values() for agent, seat in self.seats.items()}

    def step_values(self, outcome: DuelOutcome) -> dict[str, Any]:
        """Infos after a step, by agent."""
        return {agent: self.seat_values(seat) for agent, seat in self.seats.items()}

    def end_values(self, outcome: DuelOutcome) -> dict[str, Any]:
        """Infos of games that are over, by agent, beside those of their last step."""
        return {agent: self.score_values() for agent in self.seats}

    def seat_values(self, seat: SpooferSeat | DefenderSeat) -> dict[str, Any]:
        """Infos of one agent after a step: the seat's own, without the terms of a reward that nobody gets here."""
        values: dict[str, Any] = seat.step_values(seat.outcome)  # type: ignore[arg-type]
        return {name: value for name, value in values.items() if name != "reward_terms"}

    def score_values(self) -> dict[str, Any]:
        """What games that are over were worth, and who played."""
        diverged = self.simulation.navigator.diverged
        return {
            "harm": self.harm.total,
            "outcome": np.where(diverged, "diverged", "finished").astype(object),
            # a clean game's member is -1: the last name
            "spoofer": np.array([*self.attacks.names, "none"], dtype=object)[self.attacks.member],
            "defender": self._defender_names(),
        }

    def _defender_names(self) -> NDArray[np.object_]:
        response = self._response
        if isinstance(response, ResponsePool):
            return np.array(response.names, dtype=object)[response.member]
        return np.full(self.num_lanes, "agent" if response is None else response.name, dtype=object)


class _OneSide(DuelGame, OneSeatGame):
    """A duel with one agent outside."""

    def step(self, actions: NDArray[Any], restarting: Runs | None = None) -> DuelOutcome:  # type: ignore[override]
        """One epoch of every lane; ``restarting`` lanes begin a new game instead, whatever their action."""
        (agent,) = self.seats
        outcome = super().step({agent: actions}, restarting)
        return outcome if agent == SPOOFER else DuelOutcome(-outcome.reward, outcome.terminated)

    @property
    def observation_space(self) -> spaces.Box:  # type: ignore[override]
        """Of one lane."""
        return self.seat.observation_space

    @property
    def action_space(self) -> spaces.Space[Any]:  # type: ignore[override]
        """Of one lane."""
        return self.seat.space

    def observation(self) -> NDArray[np.float32]:
        """What each lane's agent sees, (N, D)."""
        return self.seat.observation()

    def reset_values(self) -> dict[str, Any]:
        """Infos after a reset, of all lanes."""
        return self.seat.reset_values()

    def step_values(self, outcome: DuelOutcome) -> dict[str, Any]:
        """Infos after a step, of all lanes."""
        return self.seat_values(self.seat)

    def end_values(self, outcome: DuelOutcome) -> dict[str, Any]:
        """Infos of games that are over, of all lanes, beside those of their last step."""
        return self.score_values()


class DuelSpooferGame(_OneSide):
    """N lanes of the duel, the spoofer outside."""

    seat: SpooferSeat

    def __init__(self, config: DuelSpooferConfig, num_lanes: int, *, streams: RunStreams | None = None) -> None:
        """Set the game up; arguments and errors as of `DuelGame`."""
        super().__init__(config, num_lanes, defender=config.defender, streams=streams)
        assert self.spoofer is not None
        self.seat = self.spoofer


class DuelDefenderGame(_OneSide):
    """N lanes of the duel, the defender outside."""

    seat: DefenderSeat

    def __init__(self, config: DuelDefenderConfig, num_lanes: int, *, streams: RunStreams | None = None) -> None:
        """Set the game up; arguments and errors as of `DuelGame`."""
        super().__init__(config, num_lanes, spoofer=config.spoofer, streams=streams)
        assert self.defender is not None
        self.seat = self.defender


def check_agents(actions: object, agents: Sequence[str]) -> None:
    """Refuse what does not name exactly the actions of some agents.

    Raises:
        ValueError: an action is missing, or an agent unknown; or it is no dictionary.
    """
    if not isinstance(actions, Mapping):
        raise ValueError(f"{OWNER}: a step needs a dictionary of actions by agent, got {validation.shown(actions)}")
    if set(actions) != set(agents):
        named = ", ".join(map(str, actions)) or "nobody"
        raise ValueError(
            f"{OWNER}: a step needs the actions of {' and '.join(agents) or 'nobody'}, got those of {named}"
        )


def _spoofer_seat(simulation: Simulation, config: DuelConfig, detectors: list[str]) -> SpooferSeat:
    return SpooferSeat(simulation, config.spoofer_side, detectors, config.sees_decisions)


def _detectors(config: DuelConfig, scenario: Scenario, num_lanes: int) -> list[Detector]:
    """The detectors of the game, calibrated where it is played.

    Raises:
        ValueError: one is unknown, given twice, or needs what the scenario does not give; or the spoofer's seat does
            not fit.
    """
    detectors = make_monitors(OWNER, "detectors", config.detectors)
    require_fitting(detectors, scenario)
    names = [detector.name for detector in detectors]
    # refuses what does not fit before thresholds are looked for
    frame_fields(config.spoofer_side, scenario, names, num_lanes, config.sees_decisions)
    with validation.argument(OWNER, "detectors"):
        return calibrated_for_play(detectors, scenario, config.fidelity)
