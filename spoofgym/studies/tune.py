"""Tune the classical defenders on the attacks of the training population.

    spoofgym tune --scenario foi-drive --json out.json

Plays every defender of the grid (`spoofgym.policies.classical.grid`: detector x depth or estimated onset x epochs until
re-use) on the same games and prints the best. `spoofgym.policies.classical.TUNED` holds what it found.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any

from rich.table import Table

from spoofgym.command_line import STDOUT, Parser, add_import, add_json, add_seed, add_threads, count
from spoofgym.console import console
from spoofgym.evaluation.tuning import tuning_reports
from spoofgym.program import last_of, moved, program
from spoofgym.scenarios import make_scenario
from spoofgym.studies.giving import give

EXAMPLES = (
    "spoofgym tune --scenario foi-drive",
    "spoofgym tune --scenario liu-flight:horizon=250,imu=tactical --json tuned.json",
)

SEED = 1_000_000_000
"""Of game 0: none of these games is one of a training, a validation or an evaluation."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(prog="spoofgym tune", examples=EXAMPLES, description="Tune the classical defenders.")
    add = result.add_argument
    add("--scenario", default="foi-drive", help="what is driven or flown (default: %(default)s)")
    add("--episodes", type=count, default=4000, help="games of each defender (default: %(default)s)")
    add_seed(result, "game 0", SEED)
    add_threads(result)
    add_import(result)
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    scenario = make_scenario(options.scenario)
    reports = tuning_reports(scenario, options.episodes, options.seed, options.threads, terminal.progress)
    report = last_of(reports)
    give(report, tuning_table(report, options.episodes), options.json, terminal)
    return 0


def tuning_table(report: dict[str, Any], episodes: int) -> Table:
    """The best of a ``"tuning"`` report for the terminal."""
    rows = report["rows"]
    table = Table(title=f"{report['scenario']}: best of {len(rows)} defenders, {episodes} games each", box=None)
    for title in ("detector", "response", "mean error, m", "clean out"):
        table.add_column(title, justify="left" if title in ("detector", "response") else "right")
    for row in rows[:12]:
        low, high = row["ci95_m"]
        table.add_row(
            str(row["detector"]),
            str(row["response"]),
            f"{row['mean_error_m']:.3f} ±{0.5 * (high - low):.3f}",
            f"{row['clean_exclusion_fraction']:.4f}",
        )
    return table


if __name__ == "__main__":
    sys.exit(moved("spoofgym tune"))
