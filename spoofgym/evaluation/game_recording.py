"""Plays one game and records it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from spoofgym import validation
from spoofgym.arrays import Floats
from spoofgym.attacks.base import Attack
from spoofgym.attacks.pool import AttackPool
from spoofgym.calibration import calibrated_for_play
from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.envs.monitors import make_monitors, require_fitting
from spoofgym.envs.opponents import make_defender, make_spoofer
from spoofgym.envs.range_features import Bounding, direction_of, filter_protection_levels
from spoofgym.envs.trained import spoofer_config
from spoofgym.evaluation.benchmark_play import watched_by
from spoofgym.evaluation.departures import Departure
from spoofgym.evaluation.game_trace import GameTrace, Players, ProtectionLevel, Statistic
from spoofgym.geodesy import horizontal
from spoofgym.navigation.interface import Decision
from spoofgym.policies.learned import LearnedSpoofer
from spoofgym.policies.published import POLICY, policy_folder
from spoofgym.responses.base import Response
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

OWNER = "game"
DEFAULT_DETECTOR = "snapshot"
HORIZONTAL, UP = "horizontal", "up"
FILTER = "filter"


def play_game(
    scenario: str | Scenario,
    attack: str | Attack | None = None,
    detectors: Sequence[str | Detector] = (),
    response: str | Response | None = None,
    seed: int = 0,
    fidelity: str | None = None,
) -> GameTrace:
    """Play one game to its end, whatever alarms, and record it.

    Args:
        scenario: what is played on.
        attack: who spoofs, as `spoofgym.envs.opponents` spells it: a learned policy, too; None = nobody.
        detectors: that watch, calibrated where they have no threshold. Those that a player follows or was trained to
            see are added; where there is none, ``snapshot`` watches.
        response: who decides, as `spoofgym.envs.opponents` spells it: a learned policy, too; None = every fix is used.
        seed: of the game.
        fidelity: of the simulation; None = the first of the scenario's.

    Raises:
        ValueError: a part that is unknown or does not fit the scenario.
        FileNotFoundError: the folder of a policy holds none.
    """
    scenario = make_scenario(scenario)
    fidelity = scenario.fidelities[0] if fidelity is None else fidelity
    scenario.check_fidelity(fidelity)
    seed = validation.whole(OWNER, "seed", seed, 0, 2**62)
    spoofer = None if attack is None else make_spoofer(attack)
    watching = _detectors(scenario, fidelity, detectors, attack, response)
    defender = None if response is None else make_defender(response, scenario, watching)
    simulation = Simulation(
        scenario, spoofer, watching, defender, 1, seed, fidelity=fidelity, on_divergence="hold"
    )
    simulation.reset()
    return _Recorder(simulation, seed).play()


def _detectors(
    scenario: Scenario, fidelity: str, given: Sequence[str | Detector], attack: Any, response: Any
) -> list[Detector]:
    """The detectors of the game with their thresholds, each once.

    Raises:
        ValueError: one is unknown, given twice or does not fit.
    """
    detectors = make_monitors(OWNER, "detectors", tuple(given))
    names = {detector.name for detector in detectors}
    for needed in (*_seen_by(attack), *(watched_by(response) if isinstance(response, str) else ())):
        detector = make_detector(needed)
        if detector.name not in names:
            names.add(detector.name)
            detectors.append(detector)
    if not detectors:
        detectors = [make_detector(DEFAULT_DETECTOR)]
    require_fitting(detectors, scenario)
    with validation.argument(OWNER, "detectors"):
        return calibrated_for_play(detectors, scenario, fidelity)


def _seen_by(attack: Any) -> tuple[str | Detector, ...]:
    """The detectors that a learned spoofer sees; none where it does not know them."""
    if not isinstance(attack, str) or not attack.strip().startswith(POLICY):
        return ()
    config = spoofer_config(LearnedSpoofer.load(policy_folder(attack)))
    if config.knowledge != "full":
        return ()
    return config.detector if isinstance(config.detector, tuple) else (config.detector,)


@dataclass(frozen=True)
class _Moment:
    """What is noted of an epoch."""

    time: float
    error: Floats
    deviation: Floats
    offset: Floats
    attacked: bool
    sigma: tuple[float, float]
    innovation: Floats
    innovation_sigma: Floats
    statistics: list[float]
    levels: list[float]
    used: bool
    backtracked: int
    reset: bool
    left_out: int


class _Recorder:
    """Plays a simulation of one run that has been reset, and keeps what happens."""

    def __init__(self, simulation: Simulation, seed: int) -> None:
        self._simulation, self._seed = simulation, seed
        self._bounding = [part for part in simulation.detectors.values() if isinstance(part, Bounding)]

    def play(self) -> GameTrace:
        """Play to the end of the scenario, or until the filter diverges."""
        simulation = self._simulation
        last = simulation.scenario.timeline.num_epochs
        moments = [self._moment()]
        while len(moments) <= last and not simulation.navigator.diverged[0]:
            simulation.observe()
            moments.append(self._moment())
        return self._trace(moments)

    def _moment(self) -> _Moment:
        """Note the present epoch, resolve it, and note what became of it."""
        simulation = self._simulation
        epoch, decision = simulation.epoch, simulation.decision
        assert epoch.view is not None
        covariance = epoch.view.position_covariance
        innovation = epoch.innovation.in_position
        levels = [float(part.protection_level[0]) for part in self._bounding]
        if simulation.scenario.slots:
            levels = [*(float(level[0]) for level in filter_protection_levels(covariance)), *levels]
        sigma = float(np.sqrt(covariance[0, 0, 0] + covariance[0, 1, 1])), float(np.sqrt(covariance[0, 2, 2]))
        left_out = self._left_out(decision)
        deviation = np.zeros(3) if simulation.steering is None else simulation.steering.deviation[0]
        simulation.resolve()
        return _Moment(
            time=float(epoch.time[0]),
            error=simulation.error[0].copy(),
            deviation=deviation,
            offset=simulation.offset[0].copy(),
            attacked=bool(simulation.attacked[0]),
            sigma=sigma,
            innovation=innovation.residual[0, :3].copy(),
            innovation_sigma=np.sqrt(np.diagonal(innovation.covariance[0])[:3]),
            statistics=[float(values[0]) for values in epoch.statistics.values()],
            levels=levels,
            used=bool(simulation.used[0]),
            backtracked=int(simulation.navigator.backtracked[0]),
            reset=decision.reset is not None and bool(decision.use[0]) and float(decision.reset[0]) > 0.0,
            left_out=left_out,
        )

    def _left_out(self, decision: Decision) -> int:
        """Satellites in view that a decision leaves out of a fix that it uses."""
        present = self._simulation.epoch.innovation.present
        if decision.satellites is None or present is None or not decision.use[0]:
            return 0
        chosen = decision.satellites[0]
        return int(np.count_nonzero(present[0, : len(chosen)] & ~chosen))

    def _trace(self, moments: list[_Moment]) -> GameTrace:
        simulation = self._simulation
        column = {name: np.array([getattr(moment, name) for moment in moments]) for name in _Moment.__annotations__}
        true = simulation.scenario.track()[: len(moments)] + column["deviation"]
        guidance, departure = simulation.scenario.guidance, None
        if guidance is not None:
            departure = Departure(horizontal(column["deviation"]), guidance.width)
        return GameTrace(
            players=self._players(),
            time=column["time"],
            true=true,
            estimated=true + column["error"],
            spoofed=true + column["offset"],
            attacked=column["attacked"],
            sigma=column["sigma"],
            innovation=column["innovation"],
            innovation_sigma=column["innovation_sigma"],
            statistics=tuple(self._statistics(column["statistics"])),
            levels=tuple(self._levels(column["levels"])),
            used=column["used"],
            backtracked=column["backtracked"],
            reset=column["reset"],
            left_out=column["left_out"],
            diverged=bool(simulation.navigator.diverged[0]),
            departure=departure,
        )

    def _players(self) -> Players:
        simulation = self._simulation
        attack, response = simulation.attack, simulation.response
        drawn = None
        if isinstance(attack, AttackPool):
            drawn = (*attack.names, "none")[attack.member[0]]  # a clean game's member is -1: the last name
        return Players(
            scenario=simulation.scenario.name,
            fidelity=simulation.fidelity,
            attack=None if attack is None else attack.name,
            drawn=drawn,
            response=None if response is None else response.name,
            seed=self._seed,
        )

    def _statistics(self, values: Floats) -> list[Statistic]:
        found = []
        for place, detector in enumerate(self._simulation.detectors.values()):
            assert detector.threshold is not None
            known = detector.calibrated or self._simulation.scenario.matched
            arl0 = detector.arl0 if known else None
            found.append(Statistic(detector.name, float(detector.threshold), arl0, values[:, place]))
        return found

    def _levels(self, values: Floats) -> list[ProtectionLevel]:
        names = [(FILTER, HORIZONTAL), (FILTER, UP)] if self._simulation.scenario.slots else []
        names += [(part.name, direction_of(part)) for part in self._bounding]
        across, upward = self._simulation.scenario.alert_limits
        return [
            ProtectionLevel(name, direction, upward if direction == UP else across, values[:, place])
            for place, (name, direction) in enumerate(names)
        ]
