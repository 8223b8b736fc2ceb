"""Plays the matches of a benchmark: who may take part, with which thresholds, and where the games are kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.attacks import ATTACKS
from spoofgym.attacks.base import Attack
from spoofgym.calibration import calibrated_for_play
from spoofgym.calibration.cache import identity
from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.envs.duel_config import DuelConfig
from spoofgym.envs.duel_game import DuelGame
from spoofgym.envs.opponents import FITTED, make_spoofer, spoofer_pool
from spoofgym.envs.trained import defender_config, trained_on
from spoofgym.evaluation.benchmark import ATTACK, TRACKS, UNDETECTED, Benchmark, BenchmarkTask, Match, Place
from spoofgym.evaluation.cell_store import CellStore
from spoofgym.evaluation.duels import Cell, play_cell
from spoofgym.evaluation.engine import Engine, Notify, Task
from spoofgym.evaluation.metrics import undetected_error
from spoofgym.evaluation.monte_carlo import watch_attack
from spoofgym.policies.classical import watcher_and_response
from spoofgym.policies.learned import LearnedDefender, LearnedSpoofer, load_policy
from spoofgym.policies.optimal import ORACLES, oracle
from spoofgym.policies.published import POLICY, policy_folder, published_folder
from spoofgym.responses import RESPONSES
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.specification import Specification
from spoofgym.validation import one_of

OWNER = "benchmark"


@dataclass(frozen=True)
class BenchmarkGame:
    """Arguments of the games of a match, as plain values: they name its cells on disk.

    Attributes:
        scenario: specification.
        payoff: "undetected", or the payoff of a duel.
        detectors: specifications, each with its threshold; None = calibrated.
        clean: share of games without an attack.
        outage: share of games with outages; none in games that an alarm ends.
        multipath: share of games with multipath; none in games that an alarm ends.
        fidelity: of the simulation.
        arl0: of the monitors that optimal attacks assume, epochs.
    """

    scenario: str
    payoff: str
    detectors: tuple[tuple[str, float | None], ...]
    clean: float
    outage: float
    multipath: float
    fidelity: str
    arl0: float

    def ready(self) -> tuple[Detector, ...]:
        """The detectors with their thresholds.

        Raises:
            ValueError: one is unknown or does not fit the scenario.
        """
        scenario = make_scenario(self.scenario)
        detectors = []
        for name, threshold in self.detectors:
            detector = make_detector(name)
            if threshold is not None:
                detector.set_threshold(threshold, detector.target_arl0, None, identity(scenario))
            detectors.append(detector)
        return tuple(calibrated_for_play(detectors, scenario, self.fidelity))

    def duel(self) -> DuelConfig:
        """The arguments of a duel.

        Raises:
            ValueError: as `ready`.
        """
        return DuelConfig(
            scenario=self.scenario,
            detectors=self.ready(),
            payoff=self.payoff,
            fidelity=self.fidelity,
            clean=self.clean,
            outage=self.outage,
            multipath=self.multipath,
        )

    def spoofer(self, text: str) -> Any:
        """Who spoofs: an optimal attack by its name, else what `spoofgym.envs.opponents` builds."""
        return _oracle(text, self.scenario, self.arl0) if text in ORACLES else text


@lru_cache(maxsize=16)
def _oracle(name: str, scenario: str, arl0: float) -> Attack:
    return oracle(name, make_scenario(scenario), arl0)


def play_match(game: BenchmarkGame, spoofer: str, defender: str, games: int, seed: int) -> Cell:
    """Play whole games; what each was worth stands in the cell as its harm.

    Args:
        game: its arguments.
        spoofer: specification.
        defender: specification; of the detector where an alarm ends the game.
        games: how many.
        seed: of game 0.

    Raises:
        ValueError: a player that is unknown or does not fit.
    """
    if game.payoff != UNDETECTED:
        return play_cell(game.duel(), game.spoofer(spoofer), defender, games, seed)
    scenario = make_scenario(game.scenario)
    attack = spoofer_pool(game.spoofer(spoofer), game.clean)
    watched = watch_attack(scenario, attack, list(game.ready()), games, seed, fidelity=game.fidelity)
    worth = undetected_error(watched.together())
    return Cell(spoofer, defender, worth, np.zeros(len(worth), dtype=bool))


def try_match(game: BenchmarkGame, spoofer: str, defender: str) -> None:
    """Sit both players down, and play nothing.

    Raises:
        ValueError: one does not fit.
    """
    if game.payoff != UNDETECTED:
        DuelGame(game.duel(), 1, spoofer=game.spoofer(spoofer), defender=defender)
        return
    attack = spoofer_pool(game.spoofer(spoofer), game.clean)
    Simulation(make_scenario(game.scenario), attack, list(game.ready()), fidelity=game.fidelity)


def check_player(track: str, text: str) -> None:
    """Refuse a player that does not exist, cannot be read, or plays the other side.

    Args:
        track: "attack" or "defend".
        text: its specification.

    Raises:
        ValueError: saying which of these, and what is valid.
        FileNotFoundError: a folder without a policy.
    """
    one_of(OWNER, "track", track, TRACKS)
    given = text.strip()
    if given.startswith(POLICY):
        kind = LearnedSpoofer if track == ATTACK else LearnedDefender
        kind.load(policy_folder(given))
        return
    pair = watcher_and_response(given)
    name = Specification.parse(given).name if pair is None else ""
    spoofs = name in ATTACKS or name in FITTED or name in ORACLES
    defends = name in RESPONSES or pair is not None
    if track == ATTACK and defends:
        raise ValueError(f"{text!r} defends: it plays the track 'defend'")
    if track != ATTACK and spoofs:
        raise ValueError(f"{text!r} spoofs: it plays the track 'attack'")
    if track == ATTACK and given not in ORACLES:
        make_spoofer(given)


def described(track: str, text: str) -> dict[str, str | None]:
    """What a report says of a player: who it is, what it knows of the victim, and the scenario it was trained on.

    Args:
        track: "attack" or "defend".
        text: specification of a player that `check_player` lets pass.

    Raises:
        ValueError: a policy that cannot be read.
    """
    given = text.strip()
    told: dict[str, str | None] = {"policy": text, "identity": given, "knowledge": None, "trained_on": None}
    if given.startswith(POLICY):
        policy = load_policy(policy_folder(given))
        told |= {"identity": policy.weights_digest, "trained_on": str(trained_on(policy).scenario)}
    if track == ATTACK:
        told["knowledge"] = "shadow" if given in ORACLES else make_spoofer(given).knowledge
    return told


def watched_by(defender: str) -> tuple[str, ...]:
    """The detectors that a defender follows or sees, by their specifications.

    Raises:
        ValueError: a policy that cannot be read.
    """
    given = defender.strip()
    if given.startswith(POLICY):
        seen = defender_config(LearnedDefender.load(policy_folder(given))).detectors
        several = seen if isinstance(seen, tuple) else (seen,)
        return tuple(each if isinstance(each, str) else each.name for each in several)
    pair = None if given.startswith("pool:") else watcher_and_response(given)
    if pair is None:
        return ()
    detector, response = pair
    return detector, *watched_by(response)


class Matches:
    """The matches of a benchmark, whose games are kept in a folder."""

    def __init__(self, benchmark: Benchmark, folder: Path) -> None:
        """Keep games in ``folder``; it may hold those of other players and benchmarks, too."""
        self.benchmark, self._folder = benchmark, folder

    def check_agents(self) -> None:
        """Refuse to play where a published agent among the opponents is another one than the benchmark pins.

        Raises:
            ValueError: naming the agent.
        """
        for name, digest in self.benchmark.agents:
            found = load_policy(published_folder(name)).weights_digest
            if found != digest:
                raise ValueError(
                    f"{self.benchmark.name} is played against the agent {name!r} whose weights have the digest "
                    f"{digest[:12]}; here they have {found[:12]}"
                )

    def refusal(self, task: BenchmarkTask, player: str) -> str | None:
        """Why a player cannot play a task; None where it can. Its matches differ in the opponent alone."""
        match = task.matches[0]
        try:
            try_match(self._game(task, match, player), *_seated(task, match, player))
        except ValueError as error:
            return " ".join(str(error).split())
        return None

    def play(self, tasks: Sequence[BenchmarkTask], players: Sequence[str], engine: Engine, notify: Notify) -> None:
        """Play what has not been played of some tasks.

        Args:
            tasks: that all players fit.
            players: specifications.
            engine: plays.
            notify: told each match that is played.

        Raises:
            ValueError: a player that is unknown or does not fit, or a damaged file.
            RuntimeError: a failure of the engine.
        """
        missing: list[Task] = []
        for player in players:
            for task in tasks:
                for match in task.matches:
                    seated = _seated(task, match, player)
                    lacking = self._store(task, match, player).lacking({seated: match.games})
                    missing += [replace(each, name=f"{task.name}: {each.name}") for each in lacking]
        engine.run(missing, notify)

    def worth(self, task: BenchmarkTask, players: Sequence[str]) -> list[Floats]:
        """What every game of a task was worth, (players, games) of each match; played now where it was not before.

        Raises:
            ValueError: as `play`.
        """
        found = []
        for match in task.matches:
            cells = [
                self._store(task, match, player).cell(*_seated(task, match, player), match.games) for player in players
            ]
            found.append(np.array([cell.harm for cell in cells]))
        return found

    def detectors(self, task: BenchmarkTask) -> tuple[Detector, ...]:
        """The monitors of a task whose games end with an alarm, with their thresholds."""
        return self._game(task, task.matches[0], "").ready()

    def _store(self, task: BenchmarkTask, match: Match, player: str) -> CellStore:
        return CellStore(self._folder, self._game(task, match, player), match.games, match.seed, play_match)

    def _game(self, task: BenchmarkTask, match: Match, player: str) -> BenchmarkGame:
        benchmark, place = self.benchmark, self.benchmark.place(task.place)
        if task.payoff == UNDETECTED:
            names: tuple[str, ...] = (match.opponent,)
        else:
            names = (*place.world, *watched_by(_seated(task, match, player)[1]))
        return BenchmarkGame(
            scenario=place.scenario,
            payoff=task.payoff,
            detectors=_with_thresholds(place, names),
            clean=task.clean,
            outage=benchmark.outage,
            multipath=benchmark.multipath,
            fidelity=benchmark.fidelity,
            arl0=benchmark.arl0,
        )


def _seated(task: BenchmarkTask, match: Match, player: str) -> tuple[str, str]:
    """Who spoofs and who defends."""
    return (player, match.opponent) if task.track == ATTACK else (match.opponent, player)


def _with_thresholds(place: Place, names: Sequence[str]) -> tuple[tuple[str, float | None], ...]:
    """Detectors by their specifications, each once, with the thresholds that a place pins."""
    pinned = {make_detector(name).name: threshold for name, threshold in place.thresholds}
    known = dict.fromkeys(make_detector(name).name for name in names)
    return tuple((name, pinned.get(name)) for name in known)
