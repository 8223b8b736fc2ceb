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
from spoofgym.evaluation.defence_metrics import DefenderScore, defender_score, difference, paired_difference
from spoofgym.evaluation.progress import Progress, silent
from spoofgym.evaluation.report import defenders_report
from spoofgym.policies.classical import PUBLISHED, WORLD_DETECTORS, ClassicalDefender, tuned_for, with_depth
from spoofgym.policies.learned import LearnedDefender, LearnedPolicy
from spoofgym.scenario import Scenario

POPULATIONS = {"training": False, "held-out": True}
"""Populations of attacks, and whether a defender never sees them in training."""
ORACLE_DEPTH = "oracle-depth"
LEARNED_MEAN = "mean of the learned"
"""Stands for all learned defenders of a comparison: their mean error in each game."""


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
    return {"published": PUBLISHED, "tuned": tuned_for(scenario.name)}


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


@dataclass(frozen=True)
class Played:
    """A defender and what came of its games.

    Attributes:
        name: of the defender.
        kind: "learned", "tuned", "published", "yardstick" or "given".
        episodes: its games.
    """

    name: str
    kind: str
    episodes: DefenceEpisodes


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
    return replace(
        one,
        error=np.where(less[:, None], other.error, one.error),
        excluded=np.where(less[:, None], other.excluded, one.excluded),
    )


def rows(played: Played, held_out: bool, pooled: str) -> list[dict[str, Any]]:
    """The rows of one defender: each attack by itself, games without one, and all games, which ``pooled`` names."""
    episodes = played.episodes
    parts = [(pooled, np.ones(len(episodes.member), dtype=bool)), ("none", episodes.member < 0)]
    parts += [(name, episodes.member == place) for place, name in enumerate(episodes.names)]
    return [
        _row(played.name, attack, held_out, defender_score(episodes.of(games)))
        for attack, games in parts
        if games.any()
    ]


def _row(defender: str, attack: str, held_out: bool, score: DefenderScore) -> dict[str, Any]:
    return {
        "defender": defender,
        "attack": attack,
        "held_out": held_out,
        "episodes": score.episodes,
        "mean_error_m": score.mean_error,
        "ci95_m": list(score.interval),
        "rmse_m": score.rmse,
        "max_error_m": score.max_error,
        "detection_probability": score.detection_probability,
        "median_time_to_detect_s": score.median_time_to_detect,
        "error_at_detection_m": score.error_at_detection,
        "median_time_to_reuse_s": score.median_time_to_reuse,
        "never_reused_fraction": score.never_reused,
        "clean_exclusion_fraction": score.clean_exclusion,
        "false_alarms_per_epoch": score.false_alarms,
    }


def comparisons(learned: Sequence[Played], others: Sequence[Played], held_out: bool) -> list[dict[str, Any]]:
    """Mean error of each learned defender, and of all of them averaged, minus that of every other on the same games."""
    result = []
    for other in others:
        mean = np.mean([one.episodes.error.mean(axis=1) for one in learned], axis=0)
        pairs = [(one.name, paired_difference(one.episodes, other.episodes)) for one in learned]
        if len(learned) > 1:
            pairs.append((LEARNED_MEAN, difference(mean, other.episodes.error.mean(axis=1))))
        for name, found in pairs:
            result.append(
                {
                    "defender": name,
                    "baseline": other.name,
                    "kind": other.kind,
                    "held_out": held_out,
                    "difference_m": found.mean,
                    "ci95_m": list(found.interval),
                }
            )
    return result


def closed_gap(learned: float, best_classical: float, oracle: float) -> float | None:
    """Share of the gap from the best tuned defender to `oracle-depth` that a defender closes; None if there is none."""
    gap = best_classical - oracle
    return (best_classical - learned) / gap if gap > 0 else None


def evaluate_defenders(
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
) -> dict[str, Any]:
    """The ``"defenders"`` report: every defender against every population.

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
    report_rows, pairs, gaps = [], [], []
    for population in populations:
        held_out = POPULATIONS.get(population, False)
        pooled = f"all-{population}" if population in POPULATIONS else "all-games"
        with progress("thresholds of the detectors"):
            world = world_of(scenario, population, fidelity, threads, company.detectors, policies, given)
        check_policies(world, policies)
        games = Defenders(world, episodes, seed, progress)
        played = list(games.play(company, given, policies))
        learned = [item for item in played if item.kind == "learned"]
        for item in played:
            kinds[item.name] = item.kind
            report_rows += rows(item, held_out, pooled)
        if learned:
            pairs += comparisons(learned, [item for item in played if item.kind != "learned"], held_out)
        gaps += _gaps(played, held_out)
    report = defenders_report(scenario, fidelity, kinds, report_rows, pairs, gaps)
    return report if set(populations) <= set(POPULATIONS) else {**report, "attack": populations[0]}


def _gaps(played: Sequence[Played], held_out: bool) -> list[dict[str, Any]]:
    """Shares of the gap between the best tuned defender of a fixed depth and `oracle-depth`."""
    means = {item.name: float(item.episodes.error.mean()) for item in played}
    tuned = [item.name for item in played if item.kind == "tuned"]
    if not tuned or ORACLE_DEPTH not in means:
        return []
    best = tuned[0]
    compared = [item.name for item in played if item.kind in ("learned", "given")] + tuned[1:]
    return [
        {
            "defender": name,
            "held_out": held_out,
            "from": best,
            "to": ORACLE_DEPTH,
            "closed": closed_gap(means[name], means[best], means[ORACLE_DEPTH]),
        }
        for name in compared
    ]
