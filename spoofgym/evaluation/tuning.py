"""The classical defenders of the grid, ranked on games of the training population."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from spoofgym.detectors import make_detector
from spoofgym.evaluation.defence import play_response
from spoofgym.evaluation.defence_metrics import defender_score
from spoofgym.evaluation.defenders import common_detectors, world_of
from spoofgym.evaluation.progress import Progress, silent
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.policies.classical import grid
from spoofgym.responses import make_response
from spoofgym.scenario import Scenario


def tuning_reports(
    scenario: Scenario, episodes: int, seed: int, threads: int, progress: Progress = silent
) -> Iterator[dict[str, Any]]:
    """The ``"tuning"`` report after every defender of the grid: a row for each, the least mean error first.

    Args:
        scenario: of the games.
        episodes: games of each defender, the same ones for all.
        seed: of game 0.
        threads: of the simulation.
        progress: shows who plays.
    """
    world = world_of(scenario, "training", "linear", threads, common_detectors(scenario), (), grid())
    rows: list[dict[str, Any]] = []
    for defender in grid():
        with progress(defender.name):
            name, response = make_detector(defender.detector).name, make_response(defender.response)
            score = defender_score(play_response(world, name, response, episodes, seed))
        rows.append(
            {
                "detector": defender.detector,
                "response": defender.response,
                "mean_error_m": score.mean_error,
                "ci95_m": list(score.interval),
                "clean_exclusion_fraction": score.clean_exclusion,
            }
        )
        ranked = sorted(rows, key=lambda row: float(row["mean_error_m"]))
        yield {"schema_version": SCHEMA_VERSION, "kind": "tuning", "scenario": scenario.name, "rows": ranked}
