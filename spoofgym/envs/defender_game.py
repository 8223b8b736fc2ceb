"""The game of Defender-v0: the agent takes the defender's seat, a pool of attacks sits opposite."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from typing import Any

from numpy.typing import NDArray

from spoofgym import validation
from spoofgym.arrays import Flags, Runs
from spoofgym.calibration import calibrated_for_play
from spoofgym.detectors.base import Detector
from spoofgym.envs.config import DefenderConfig
from spoofgym.envs.defender_seat import DefenderOutcome, DefenderSeat, demands_on
from spoofgym.envs.monitors import make_monitors, require_fitting
from spoofgym.envs.opponents import spoofer_pool
from spoofgym.envs.privileged import PrivilegedState
from spoofgym.envs.view import OneSeatGame
from spoofgym.scenarios import make_scenario
from spoofgym.sensors.confounders import Confounders, Disturbances
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams

OWNER = "Defender-v0"


class DefenderGame(OneSeatGame):
    """N lanes of the defender's game.

    Attributes:
        config: its arguments.
        seat: the agent's.
        attacks: the population from which each lane draws its opponent.
        confounders: the receiver's outages and multipath.
        privileged: function that returns the truth that a critic may see in training, (N, P). No defender sees it.
    """

    seat: DefenderSeat

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
            beside: detectors that the simulation runs, with thresholds set; empty = the detectors of ``config``. They
                must include those of ``config``. The defender sees the statistics of its own detectors only.
            streams: random streams of the lanes; None = of fresh entropy, until the lanes are seeded.
            disturbances: of the receiver, in place of those of ``config``.

        Raises:
            ValueError: a part that is unknown or does not fit the scenario.
        """
        self.config = config
        with validation.argument(OWNER, "scenario"):
            scenario = make_scenario(config.scenario, config.coupling)
        own = make_monitors(OWNER, "detectors", config.detectors)
        require_fitting(own, scenario)
        names = [detector.name for detector in own]
        detectors = [deepcopy(detector) for detector in beside] or calibrated_for_play(
            own, scenario, config.fidelity
        )
        missing = set(names) - {detector.name for detector in detectors}
        if missing:
            raise ValueError(f"detectors of the game are not among those beside it: {', '.join(sorted(missing))}")
        with validation.argument(OWNER, "attacks"):
            self.attacks = spoofer_pool(config.attacks, config.clean)
        shares = Disturbances(outage_share=config.outage, multipath_share=config.multipath)
        self.confounders = Confounders(shares if disturbances is None else disturbances)
        simulation = Simulation(
            scenario,
            self.attacks,
            detectors,
            None,
            num_lanes,
            fidelity=config.fidelity,
            threads=config.threads,
            demands=demands_on(scenario, config.bank),
            confounders=self.confounders,
            on_divergence="hold",
            streams=streams,
        )
        with validation.argument(OWNER, "bank"):
            self.seat = DefenderSeat(simulation, config, names)
        self.privileged = PrivilegedState(simulation, self.attacks, self.confounders, scenario.defender_scale)
        super().__init__(simulation, defender=self.seat)

    @property
    def excluding(self) -> Flags:
        """Whether the last decision was to exclude, (N,)."""
        return self.seat.excluding

    def step(self, actions: NDArray[Any], restarting: Runs | None = None) -> DefenderOutcome:
        """One epoch of every lane; ``restarting`` lanes begin a new game instead, whatever their action.

        Args:
            actions: (N, 2 + S): 0 = use or 1 = exclude, the place of the depth in the table and, where the filter takes
                ranges, 0 = use or 1 = leave out the satellite of each slot.
            restarting: indices of lanes.

        Raises:
            ValueError: an action lies outside the action space or is no number, or the actions have the wrong shape.
        """
        self.advance(decisions=actions, restarting=restarting)
        return self.seat.outcome
