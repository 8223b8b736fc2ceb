"""The game of Spoofer-v0: the agent takes the spoofer's seat, detectors and a response sit opposite."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spoofgym import validation
from spoofgym.arrays import Runs
from spoofgym.calibration import calibrated_for_play
from spoofgym.envs.config import SpooferConfig
from spoofgym.envs.monitors import make_monitors
from spoofgym.envs.objectives import make_objective
from spoofgym.envs.opponents import make_defender
from spoofgym.envs.spoofer_seat import OWNER, SpooferOutcome, SpooferSeat, frame_fields
from spoofgym.envs.view import OneSeatGame
from spoofgym.responses.pool import ResponsePool
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams


class SpooferGame(OneSeatGame):
    """N lanes of the spoofer's game.

    Attributes:
        config: its arguments.
        seat: the agent's.
    """

    seat: SpooferSeat

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
        with validation.argument(OWNER, "objective"):
            objective = make_objective(config.objective, scenario)
        detectors = make_monitors(OWNER, "detector", config.detector)
        names = [detector.name for detector in detectors]
        frame_fields(config, scenario, names, num_lanes)  # refuses what does not fit before thresholds are looked for
        with validation.argument(OWNER, "detector"):
            detectors = calibrated_for_play(detectors, scenario, config.fidelity)
        with validation.argument(OWNER, "response"):
            defender = make_defender(config.response, scenario, detectors)
        self._defenders = defender if config.on_alarm == "respond" and isinstance(defender, ResponsePool) else None
        simulation = Simulation(
            scenario,
            None,
            detectors,
            defender if config.on_alarm == "respond" else None,
            num_lanes,
            fidelity=config.fidelity,
            threads=config.threads,
            on_divergence="hold",
            streams=streams,
        )
        self.seat = SpooferSeat(simulation, config, names, objective=objective)
        super().__init__(simulation, spoofer=self.seat, ends_on_alarm=config.on_alarm == "end")

    def step(self, actions: NDArray[Any], restarting: Runs | None = None) -> SpooferOutcome:
        """One epoch of every lane; ``restarting`` lanes begin a new game instead, whatever their action.

        Args:
            actions: in [-1, 1], (N, 3), or (N, 4) where the filter takes ranges.
            restarting: indices of lanes.

        Raises:
            ValueError: an action is not finite or no number, or the actions have the wrong shape.
        """
        self.advance(rates=actions, restarting=restarting)
        return self.seat.outcome

    def reset_values(self) -> dict[str, Any]:
        """Infos after a reset, of all lanes."""
        return {**super().reset_values(), **self._met()}

    def step_values(self, outcome: SpooferOutcome) -> dict[str, Any]:
        """Infos after a step, of all lanes."""
        return {**super().step_values(outcome), **self._met()}

    def _met(self) -> dict[str, Any]:
        """Which defender each lane has drawn, where there is a pool of them."""
        if self._defenders is None:
            return {}
        return {"opponent": np.array(self._defenders.names, dtype=object)[self._defenders.member]}
