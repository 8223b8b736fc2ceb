"""All defenders of one game, evaluated on the same episodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from spoofgym.calibration import calibrated_for_play
from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.envs.defender_game import DefenderGame
from spoofgym.envs.opponents import make_defender, spoofer_pool
from spoofgym.envs.trained import defender_config
from spoofgym.evaluation.defence import (
    DefenceEpisodes,
    World,
    play_always,
    play_never,
    play_oracle_onset,
    play_policy,
    play_random,
    play_response,
)
from spoofgym.evaluation.defender_rows import (
    ORACLE_DEPTH,
    Played,
    aggregates,
    attacks_of,
    comparisons,
    gaps_of,
    per_game,
    rows,
)
from spoofgym.evaluation.departure_rows import departure_figures
from spoofgym.evaluation.game_log import GameLog
from spoofgym.evaluation.progress import Progress, silent
from spoofgym.evaluation.report import defenders_report
from spoofgym.policies.classical import PUBLISHED, WORLD_DETECTORS, ClassicalDefender, tuned_for, with_depth
from spoofgym.policies.learned import LearnedDefender, LearnedPolicy
from spoofgym.scenario import Scenario

POPULATIONS = {"training": False, "held-out": True}
"""Populations of attacks, and whether a defender never sees them in training."""


YARDSTICKS = ("never", "always", "random", "oracle-onset", ORACLE_DEPTH)


def fits(detector: str, scenario: Scenario) -> bool:
    """Whether a scenario offers what the detector of a specification needs."""
    return set(make_detector(detector).needs) <= set(scenario.offers)


@dataclass(frozen=True)
class Company:
    """Who plays beside the defenders that are evaluated.

    Attributes:
        published: defenders of the literature.
        tuned: on the attacks of the training population.
        yardsticks: names of `YARDSTICKS`.
        detectors: that run beside every defender, so that the same episode begins the same in every evaluation.
    """

    published: tuple[ClassicalDefender, ...] = ()
    tuned: tuple[ClassicalDefender, ...] = ()
    yardsticks: tuple[str, ...] = ()
    detectors: tuple[str, ...] = ()


NOBODY = Company()


def everybody(scenario: Scenario) -> Company:
    """All yardsticks, and all classical defenders and `WORLD_DETECTORS` that fit a scenario."""
    listed = listed_for(scenario)
    return Company(tuple(listed["published"]), tuple(listed["tuned"]), YARDSTICKS, common_detectors(scenario))


def common_detectors(scenario: Scenario) -> tuple[str, ...]:
    """Those of `WORLD_DETECTORS` that fit a scenario."""
    return tuple(name for name in WORLD_DETECTORS if fits(name, scenario))


def listed_for(scenario: Scenario) -> dict[str, list[ClassicalDefender]]:
    """The defenders that are always played in a scenario, by their kind: those whose detectors fit."""
    return {
        kind: [item for item in listed if fits(item.detector, scenario)] for kind, listed in _listed(scenario).items()
    }


def left_out(scenario: Scenario) -> list[str]:
    """A line for each kind of which some defenders are not played, since their detectors do not fit the scenario."""
    lines = []
    for listed in _listed(scenario).values():
        names = [f"{item.name} ({item.detector})" for item in listed if not fits(item.detector, scenario)]
        if names:
            lines.append(f"left out, as scenario {scenario.name} does not give what they need: {', '.join(names)}")
    return lines


def _listed(scenario: Scenario) -> dict[str, Sequence[ClassicalDefender]]:
    return {"published": PUBLISHED, "tuned": tuned_for(scenario.unguided.name)}


def world_of(
    scenario: Scenario,
    attacks: str,
    fidelity: str,
    threads: int,
    common: Sequence[str],
    policies: Sequence[LearnedDefender],
    classical: Sequence[ClassicalDefender],
) -> World:
    """The world of an evaluation: half of the games are clean.

    The detectors of all players run, and those that are ``common`` to all evaluations.

    Raises:
        ValueError: a detector cannot be built, or one that a policy or a defender watches does not fit the scenario.
    """
    wanted = [str(part) for policy in policies for part in _watched(policy)]
    names = dict.fromkeys([*common, *wanted, *(item.detector for item in classical)])
    built = {detector.name: detector for detector in map(make_detector, names)}
    detectors = tuple(calibrated_for_play(list(built.values()), scenario, fidelity))
    return World(scenario, attacks, 0.5, detectors, fidelity=fidelity, threads=threads)


def _watched(policy: LearnedDefender) -> tuple[str | Detector, ...]:
    """The detectors whose statistics a policy sees."""
    detectors = defender_config(policy).detectors
    return detectors if isinstance(detectors, tuple) else (detectors,)


def check_names(policies: Sequence[LearnedPolicy]) -> None:
    """Refuse policies that a report could not tell apart.

    Raises:
        ValueError: two policies of one name.
    """
    names = [policy.name for policy in policies]
    if len(set(names)) < len(names):
        raise ValueError(f"run folders of one name cannot be told apart: {', '.join(names)}")


def check_policies(world: World, policies: Sequence[LearnedDefender]) -> None:
    """Refuse policies that do not fit the game.

    Raises:
        ValueError: a policy was trained on another observation, or on another number of depths.
    """
    for policy in policies:
        config = replace(defender_config(policy), scenario=world.scenario, fidelity=world.fidelity)
        game = DefenderGame(config, 1, world.detectors)
        policy.check_layout([field.name for field in game.fields])
        if policy.depths != len(game.seat.depths):
            raise ValueError(
                f"policy {policy.name!r} was trained on {policy.depths} depths, the game has {len(game.seat.depths)}"
            )


class Defenders:
    """Plays every defender in a world."""

    def __init__(self, world: World, episodes: int, seed: int, progress: Progress = silent) -> None:
        """Play ``episodes`` games each, the first of which is seeded ``seed``."""
        self._world, self._episodes, self._seed, self._progress = world, episodes, seed, progress

    def play(
        self, company: Company, given: Sequence[ClassicalDefender], policies: Sequence[LearnedDefender]
    ) -> Iterator[Played]:
        """All games of all defenders, one defender after the other."""
        world, episodes, seed = self._world, self._episodes, self._seed
        yardsticks: dict[str, Callable[[], DefenceEpisodes]] = {
            "never": lambda: play_never(world, episodes, seed),
            "always": lambda: play_always(world, episodes, seed),
            "random": lambda: play_random(world, episodes, seed),
            "oracle-onset": lambda: play_oracle_onset(world, episodes, seed),
        }
        best = next((item for item in company.tuned if "onset" not in item.response), None)
        if best is not None:
            yardsticks[ORACLE_DEPTH] = lambda: self.oracle_depth(best)
        for name in company.yardsticks:
            if name in yardsticks:
                yield self._played(name, "yardstick", yardsticks[name])
        for kind, classical in (("published", company.published), ("tuned", company.tuned), ("given", given)):
            for defender in classical:
                yield self._played(defender.name, kind, partial(self._classical, defender))
        for policy in policies:
            games = partial(play_policy, world, defender_config(policy), policy.act, episodes, seed)
            yield self._played(policy.name, "learned", games)

    def _played(self, name: str, kind: str, games: Callable[[], DefenceEpisodes]) -> Played:
        with self._progress(f"{self._world.attacks}: {name}"):
            return Played(name, kind, games())

    def _classical(self, defender: ClassicalDefender) -> DefenceEpisodes:
        name = make_detector(defender.detector).name
        response = make_defender(defender.response, self._world.scenario, self._world.detectors)
        return play_response(self._world, name, response, self._episodes, self._seed)

    def oracle_depth(self, defender: ClassicalDefender) -> DefenceEpisodes:
        """The games of a backtracking defender, each with the depth that turned out best in it."""
        _, _, options = defender.response.partition("," if "backtrack" in defender.response else ":")
        best: DefenceEpisodes | None = None
        for depth in self._world.scenario.depth_table:
            games = self._classical(replace(defender, response=with_depth(depth, options)))
            best = games if best is None else _better(best, games)
        assert best is not None
        return best


def _better(one: DefenceEpisodes, other: DefenceEpisodes) -> DefenceEpisodes:
    """Of each game that one of the two in which the mean error is less."""
    less = other.error.mean(axis=1) < one.error.mean(axis=1)
    departures = one.departures
    if departures is not None and other.departures is not None:
        departures = other.departures.where(less, departures)
    return replace(
        one,
        departures=departures,
        error=np.where(less[:, None], other.error, one.error),
        excluded=np.where(less[:, None], other.excluded, one.excluded),
    )


def defenders_reports(
    scenario: Scenario,
    fidelity: str,
    policies: Sequence[LearnedDefender],
    given: Sequence[ClassicalDefender],
    populations: Sequence[str],
    company: Company,
    episodes: int,
    seed: int,
    threads: int,
    progress: Progress = silent,
    log: GameLog | None = None,
) -> Iterator[dict[str, Any]]:
    """The ``"defenders"`` report after every defender that has played; the last one has all, in every population.

    Defenders are compared with each other when all have played in a population.

    Args:
        scenario: of the games.
        fidelity: of the simulation.
        policies: learned defenders.
        given: classical ones beside those of the company.
        populations: names of `POPULATIONS`, or one attack.
        company: who plays beside them: `everybody`, or `NOBODY`.
        episodes: games per population and defender.
        seed: of game 0.
        threads: of the simulation.
        progress: shows what is played.
        log: keeps what came of every game; None = of no further use.

    Raises:
        ValueError: nobody plays, a given defender that is unknown, two policies of one name, one that was trained on
            another observation, or one or a given defender whose detector does not fit the scenario.
    """
    check_names(policies)
    for defender in given:
        make_detector(defender.detector)
        make_defender(defender.response, scenario, ())
    for population in populations:
        spoofer_pool(population, 0.5)
    if company == NOBODY and not given and not policies:
        raise ValueError("there is no defender to evaluate: name one")
    kinds: dict[str, str] = {}
    report_rows, pairs, gaps, together = (list[dict[str, Any]]() for _ in range(4))
    one = {} if set(populations) <= set(POPULATIONS) else {"attack": populations[0]}
    for population in populations:
        held_out = POPULATIONS.get(population, False)
        pooled = f"all-{population}" if population in POPULATIONS else "all-games"
        with progress("thresholds of the detectors"):
            world = world_of(scenario, population, fidelity, threads, company.detectors, policies, given)
        check_policies(world, policies)
        games = Defenders(world, episodes, seed, progress)
        played = []
        for item in games.play(company, given, policies):
            played.append(item)
            kinds[item.name] = item.kind
            report_rows += rows(item, held_out, pooled)
            if log is not None:
                vehicle = departure_figures(item.episodes.departures)
                log.note(item.name, population, mean_error_m=per_game(item), attack=attacks_of(item), **vehicle)
            report = defenders_report(scenario, fidelity, dict(kinds), list(report_rows), list(pairs), list(gaps))
            yield {**report, **one, "aggregates": list(together)}
        learned = [item for item in played if item.kind == "learned"]
        together += aggregates(policies, learned, population)
        if learned:
            pairs += comparisons(learned, [item for item in played if item.kind != "learned"], held_out)
        gaps += gaps_of(played, held_out)
    yield {**defenders_report(scenario, fidelity, kinds, report_rows, pairs, gaps), **one, "aggregates": together}
