"""What a player is worth in a benchmark, as a report of plain values; and the references, played again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import spoofgym
from spoofgym.evaluation.benchmark import ATTACK, UNDETECTED, BenchmarkTask, groups_of
from spoofgym.evaluation.benchmark_play import Matches, check_player, described
from spoofgym.evaluation.benchmark_scores import Interval, Scores
from spoofgym.evaluation.engine import Engine, Notify
from spoofgym.optimum import bounded_optimum
from spoofgym.policies.baselines import exact_threshold
from spoofgym.scenarios import make_scenario

SCHEMA_VERSION = 1
OPTIMUM = "the optimum"
"""Stands where a reference is exact."""
NOBODY, NO_DEFENCE = "none", "always-use"


def measure(
    matches: Matches, track: str, policies: Sequence[str], asked: Sequence[str], engine: Engine, notify: Notify
) -> dict[str, Any]:
    """The report of a method in one track.

    Args:
        matches: of the benchmark.
        track: "attack" or "defend".
        policies: the policy of each training seed, or one player.
        asked: tasks, as `Benchmark.chosen` takes them; none = all.
        engine: plays.
        notify: told each match that is played, and each task that is refused.

    Raises:
        ValueError: a policy that does not exist, is given twice, plays the other side or fits no task; or a task that
            is not there.
        FileNotFoundError: a folder without a policy.
        RuntimeError: a failure of the engine.
    """
    benchmark, policies = matches.benchmark, [policy.strip() for policy in policies]
    chosen = benchmark.chosen(track, asked)
    for policy in policies:
        check_player(track, policy)
    if len(set(policies)) < len(policies):
        raise ValueError(f"each policy can be given once only, got {', '.join(policies)}")
    matches.check_agents()
    refused = _refused(matches, chosen, policies)
    for each in refused:
        notify(f"{each['task']} is left out: {each['reason']}")
    left_out = {each["task"] for each in refused}
    tasks = tuple(task for task in chosen if task.name not in left_out)
    if not tasks:
        raise ValueError(f"{refused[0]['policy']!r} fits none of the {len(chosen)} tasks: {refused[0]['reason']}")
    matches.play(tasks, policies, engine, notify)
    scores = Scores(tasks, [matches.worth(task, policies) for task in tasks], benchmark.resamples)
    return {
        "schema_version": SCHEMA_VERSION,
        "kind": "benchmark",
        "benchmark": benchmark.name,
        "digest": benchmark.digest,
        "version": spoofgym.__version__,
        "track": track,
        "policies": [described(track, policy) for policy in policies],
        "resamples": benchmark.resamples,
        "summary": _summary(scores, benchmark.chosen(track)),
        "tasks": [_row(scores, place, task) for place, task in enumerate(tasks)],
        "refused": refused,
    }


def _refused(matches: Matches, tasks: Sequence[BenchmarkTask], policies: Sequence[str]) -> list[dict[str, str]]:
    """The tasks that a policy does not fit, each with the first such policy."""
    refused = []
    for task in tasks:
        reasons = ((policy, matches.refusal(task, policy)) for policy in policies)
        found = next(((policy, reason) for policy, reason in reasons if reason is not None), None)
        if found is not None:
            refused.append({"task": task.name, "policy": found[0], "reason": found[1]})
    return refused


def _summary(scores: Scores, everything: Sequence[BenchmarkTask]) -> dict[str, Any]:
    """Over the tasks that were played, and over those of each group; with the numbers of tasks played and of all."""

    def over(group: str | None) -> dict[str, Any]:
        def belongs(task: BenchmarkTask) -> bool:
            return group is None or group in task.groups

        found = scores.interquartile_mean(belongs)
        counts = {"tasks": sum(map(belongs, scores.tasks)), "all_tasks": sum(map(belongs, everything))}
        return {**({} if found is None else found.content()), **counts}

    mean = scores.mean()
    return {
        "interquartile_mean": over(None),
        "mean": None if mean is None else mean.content(),
        "groups": {group: over(group) for group in groups_of(scores.tasks)},
    }


def _row(scores: Scores, place: int, task: BenchmarkTask) -> dict[str, Any]:
    means = scores.of_matches(place)
    return {
        "task": task.name,
        "kind": task.kind,
        "unit": task.unit,
        "score": scores.score(place).content(),
        "normalised": scores.normalised(place).content(),
        "references": {"zero": task.zero, "one": task.one, "best": task.best},
        "matches": [
            {"opponent": match.opponent, "games": match.games, "seed": match.seed, "means": means[:, i].tolist()}
            for i, match in enumerate(task.matches)
        ],
        "worst": task.matches[int(means.mean(axis=0).argmax())].opponent,
    }


def interval_of(content: dict[str, Any]) -> Interval:
    """The interval that a report holds."""
    return Interval(content["value"], *content["ci95"])


# --- references -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class References:
    """What is worth 0 and 1 in a task.

    Attributes:
        task: its name.
        zero: score.
        one: score.
        best: who has reached it.
    """

    task: str
    zero: float
    one: float
    best: str


def references(
    matches: Matches, tasks: Sequence[BenchmarkTask], engine: Engine, notify: Notify
) -> list[References]:
    """The references of tasks of one track, of the pinned players on the games of the benchmark.

    Args:
        matches: of the benchmark.
        tasks: of one track.
        engine: plays.
        notify: told each match that is played.

    Raises:
        ValueError: there are no tasks.
        RuntimeError: a failure of the engine.
    """
    track = tasks[0].track
    found: dict[str, dict[str, float]] = {task.name: {} for task in tasks}
    for player in matches.benchmark.baselines(track):
        fitting = [task for task in tasks if matches.refusal(task, player) is None]
        matches.play(fitting, [player], engine, notify)
        for task in fitting:
            found[task.name][player] = max(float(worth.mean()) for worth in matches.worth(task, [player]))
    return [_reference(matches, task, found[task.name]) for task in tasks]


def _reference(matches: Matches, task: BenchmarkTask, scores: dict[str, float]) -> References:
    if task.track != ATTACK:
        best = min(scores, key=lambda player: scores[player])
        return References(task.name, scores[NO_DEFENCE], scores[best], best)
    if task.payoff == UNDETECTED and (optimum := _optimum(matches, task)) is not None:
        return References(task.name, 0.0, optimum, OPTIMUM)
    best = max(scores, key=lambda player: scores[player])
    return References(task.name, 0.0 if task.payoff == UNDETECTED else scores[NOBODY], scores[best], best)


def _optimum(matches: Matches, task: BenchmarkTask) -> float | None:
    """The exact optimum of a game that an alarm ends; None where it is not known."""
    scenario = make_scenario(matches.benchmark.place(task.place).scenario)
    threshold = exact_threshold(scenario, list(matches.detectors(task)))
    if threshold is None:
        return None
    return float(bounded_optimum(scenario.linear_model(), threshold, np.array(scenario.drag_off_rate)).score)
