"""The game of Spoofer-v0: the agent takes the spoofer's seat, detectors and a response sit opposite."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

from numpy.typing import NDArray

from spoofgym import validation
from spoofgym.arrays import Runs
from spoofgym.calibration import calibrated_for_play
from spoofgym.detectors import make_detector
from spoofgym.envs.config import SpooferConfig
from spoofgym.envs.spoofer_seat import OWNER, SpooferOutcome, SpooferSeat, frame_fields
from spoofgym.envs.view import OneSeatGame
from spoofgym.responses import make_response
from spoofgym.responses.base import Response
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
        given = config.detector if isinstance(config.detector, tuple | list) else (config.detector,)
        with validation.argument(OWNER, "detector"):
            # copies: an object that the caller gives to two environments must not carry memories between them
            detectors = [deepcopy(make_detector(part)) for part in given]
        names = [detector.name for detector in detectors]
        if len(set(names)) < len(names):
            raise ValueError(f"{OWNER}: detector: each detector can be given once only, got {', '.join(names)}")
        frame_fields(config, scenario, names, num_lanes)  # refuses what does not fit before thresholds are looked for
        with validation.argument(OWNER, "detector"):
            detectors = calibrated_for_play(detectors, scenario, config.fidelity)
        with validation.argument(OWNER, "response"):
            response: Response | None = deepcopy(make_response(config.response))
        if config.on_alarm == "end":
            response = None
        simulation = Simulation(
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
        self.seat = SpooferSeat(simulation, config, names)
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
