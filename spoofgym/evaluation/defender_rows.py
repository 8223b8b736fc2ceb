"""Rows of an evaluation of defenders: what came of their games, and how they compare."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from spoofgym.arrays import Floats
from spoofgym.evaluation.aggregate import aggregate, aggregate_row, of_one_setting
from spoofgym.evaluation.defence import DefenceEpisodes
from spoofgym.evaluation.defence_metrics import DefenderScore, defender_score, difference, paired_difference
from spoofgym.evaluation.departure_rows import departure_entry
from spoofgym.policies.learned import LearnedDefender

ORACLE_DEPTH = "oracle-depth"
LEARNED_MEAN = "mean of the learned"
"""Stands for all learned defenders of a comparison: their mean error in each game."""


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


def rows(played: Played, held_out: bool, pooled: str) -> list[dict[str, Any]]:
    """The rows of one defender: each attack by itself, games without one, and all games, which ``pooled`` names."""
    episodes = played.episodes
    parts = [(pooled, np.ones(len(episodes.member), dtype=bool)), ("none", episodes.member < 0)]
    parts += [(name, episodes.member == place) for place, name in enumerate(episodes.names)]
    return [
        _row(played.name, attack, held_out, defender_score(episodes.of(games)))
        | departure_entry(episodes.of(games).departures)
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


def aggregates(policies: Sequence[LearnedDefender], learned: Sequence[Played], population: str) -> list[dict[str, Any]]:
    """A row for the learned defenders of each setting of which there are several.

    Args:
        policies: all of them.
        learned: what they have played.
        population: that has attacked; games are drawn anew among those of one attack.
    """
    played = {item.name: item for item in learned}
    found = []
    for names in of_one_setting(policies):
        errors = np.stack([per_game(played[name]) for name in names])
        strata = played[names[0]].episodes.member
        found.append({"population": population, **aggregate_row(names, aggregate(errors, strata))})
    return found


def per_game(item: Played) -> Floats:
    """Mean error of each game, (n,), m."""
    return np.asarray(item.episodes.error.mean(axis=1))


def attacks_of(item: Played) -> np.ndarray:
    """The attack of each game; "none" in a clean one."""
    return np.array((*item.episodes.names, "none"))[item.episodes.member]


def gaps_of(played: Sequence[Played], held_out: bool) -> list[dict[str, Any]]:
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
