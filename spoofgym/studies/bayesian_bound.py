"""What no defender can do better: the Bayesian who knows the population of attacks, beside defenders in the same games.

    spoofgym bound bayes --scenario foi-drive --population training --games 500 --json bound.json

Defenders of the table are the tuned ones of the scenario and three yardsticks, or those that ``--defender`` names. A
run that was stopped goes on with the same command. ``docs/results/bounds.md`` says what the bound is.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.table import Table

from spoofgym.command_line import STDOUT, Parser, add_import, add_json, add_seed, count, run_folder, share
from spoofgym.console import console
from spoofgym.envs.duel_config import DuelConfig
from spoofgym.evaluation.bayesian_bound import DEPTH, BoundSettings, bound_games, bound_report, same_games
from spoofgym.evaluation.defenders import fits
from spoofgym.evaluation.duels import with_detectors_of
from spoofgym.evaluation.engine import make_engine
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.optimum.bayes import POPULATION_SHAPES, RESOLUTIONS
from spoofgym.policies.classical import SEPARATOR, WORLD_DETECTORS, tuned_for
from spoofgym.program import goes_on, moved, program
from spoofgym.scenarios import make_scenario
from spoofgym.studies.giving import give

EXAMPLES = (
    "spoofgym bound bayes --scenario foi-drive --population training",
    "spoofgym bound bayes --games 100 --defender tuned-onset --json bound.json",
)

YARDSTICKS = ("multiple-hypothesis", "always-use", "always-exclude")
CHOOSERS = {
    "choosing": "Bayesian who uses a fix or leaves it out",
    "taking_back": f"  and may take back {DEPTH} epochs",
    "hindsight": "least of all uses of the fixes, expected",
    "choosing_expected": "Bayesian who uses or leaves out, expected",
}


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym bound bayes", examples=EXAMPLES, description="Bound what defenders lose to a population."
    )
    add = result.add_argument
    add("--scenario", default="foi-drive", help="what is driven or flown (default: %(default)s)")
    add("--population", action="append", choices=tuple(POPULATION_SHAPES),
        help="who attacks; repeatable (default: training)")
    add("--games", type=count, default=500, help="of each population (default: %(default)s)")
    add("--clean", type=share, default=0.5, help="share of games without an attack (default: %(default)s)")
    add("--resolution", choices=tuple(RESOLUTIONS), default="usual",
        help="how finely attacks are told apart (default: %(default)s)")
    add("--defender", action="append", metavar="SPEC",
        help="who plays the same games; repeatable (default: the tuned ones, and three yardsticks)")
    add("--detector", action="append", metavar="SPEC",
        help="that runs beside every defender; repeatable (default: those of the evaluations of defenders)")
    add("--workers", type=count, help="processes (default: one for each core)")
    add_seed(result, "game 0")
    add("--out", type=run_folder, default=Path("runs/bound"), help="folder of the games (default: %(default)s)")
    add_import(result)
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    scenario = make_scenario(options.scenario)
    tuned = [f"{each.detector}{SEPARATOR}{each.response}" for each in tuned_for(scenario.unguided.name)]
    defenders = list(options.defender or [*tuned, *YARDSTICKS])
    detectors = tuple(options.detector or (name for name in WORLD_DETECTORS if fits(name, scenario)))
    duel = DuelConfig(scenario=options.scenario, detectors=detectors, clean=options.clean)
    duel = with_detectors_of(duel, defenders)
    engine, notify = make_engine("processes", options.workers), partial(console(stderr=True).print, soft_wrap=True)
    rows = []
    with goes_on(options.out):
        for population in options.population or ["training"]:
            settings = BoundSettings(duel, population, options.games, options.seed, RESOLUTIONS[options.resolution])
            games = bound_games(settings, options.out / "bayesian", engine, notify)
            rows.append(bound_report(settings, games, same_games(settings, defenders, options.out / "cells")))
    report = {
        "schema_version": SCHEMA_VERSION,
        "kind": "bayesian-bound",
        "scenario": scenario.name,
        "clean": options.clean,
        "games": options.games,
        "seed": options.seed,
        "resolution": options.resolution,
        "rows": rows,
    }
    give(report, Group(*bound_tables(report)), options.json, console(stderr=options.json == STDOUT))
    return 0


def bound_tables(report: dict[str, Any]) -> list[Table]:
    """A table of each population: the Bayesian, then the defenders, the best first."""
    tables = []
    for row in report["rows"]:
        games = f"{report['games']} games, {report['clean']:.0%} clean"
        table = Table(title=f"{report['scenario']}, {row['population']}: {games}", box=None)
        for name in ("", "harm, m", "above the bound, m"):
            table.add_column(name, justify="right" if name else "left")
        bayesian = row["bayesian"]
        table.add_row("Bayesian, median of the posterior", _shown(bayesian, "harm"))
        table.add_row("  what the posterior expects", _shown(bayesian, "expected"), _shown(bayesian, "surprise"))
        table.add_row("Bayesian, mean of the posterior", _shown(bayesian, "of_mean"))
        for name, told in CHOOSERS.items():
            if name in row:
                table.add_row(told, _shown(row[name], "harm"), _shown(row[name], "above_bound"))
        for each in sorted(row["defenders"], key=lambda each: each["harm"]):
            table.add_row(each["defender"], _shown(each, "harm"), _shown(each, "above_bound"))
        table.add_row("best filter that uses every fix", _shown(row["trusting"], "harm"))
        tables.append(table)
    return tables


def _shown(values: dict[str, Any], name: str) -> str:
    low, high = values[f"{name}_ci95"]
    return f"{values[name]:.3f} ±{0.5 * (high - low):.3f}"


if __name__ == "__main__":
    sys.exit(moved("spoofgym bound bayes"))
