"""Bound the value of the duel from below, against a spoofer that draws its pull.

    spoofgym bound duel --scenario foi-drive --payoff error --payoff beyond:50

Prints what no defender can keep each payoff below. ``docs/results/bounds.md`` says what the bound is.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from typing import Any

from rich.table import Table

from spoofgym.command_line import STDOUT, Parser, add_import, add_json, add_seed, count, share
from spoofgym.console import console
from spoofgym.envs.payoffs import Beyond, make_payoff
from spoofgym.evaluation.progress import Progress, silent
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.navigation.facts import INERTIAL_SOLUTION, LINEAR_MODEL
from spoofgym.navigation.linear_model import LinearModel
from spoofgym.optimum.gaussian_spoofer import Loss, LowerBound, beyond_loss, error_loss, lower_bound
from spoofgym.optimum.pull_process import drift_pull, unseen_pull
from spoofgym.program import last_of, moved, program
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.studies.giving import give

EXAMPLES = (
    "spoofgym bound duel --scenario foi-drive",
    "spoofgym bound duel --payoff error --payoff beyond:50 --json -",
)

DRIFTS = (1.5, 2.0, 3.0, 4.0)
UNSEEN = (2.0, 3.0, 4.0, 6.0, 9.0)
Z95 = 1.96


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym bound duel", description="Bound the value of the duel from below.", examples=EXAMPLES
    )
    add = result.add_argument
    add("--scenario", default="foi-drive", help="what is driven or flown (default: %(default)s)")
    add("--payoff", action="append", metavar="SPEC",
        help="error, error:CAP or beyond:LIMIT; repeatable (default: error)")
    add("--clean", type=share, default=0.5, help="share of games without an attack (default: %(default)s)")
    add("--games", type=count, default=300, help="of each pull (default: %(default)s)")
    add_seed(result, "the random numbers", 0)
    add_import(result)
    add_json(result)
    return result


def loss_of(payoff: str, scenario: Scenario) -> Loss:
    """What an error costs the defender in a payoff.

    Args:
        payoff: ``error`` (clipped at the scenario's ``harm_cap``), ``error:CAP`` or ``beyond:LIMIT``, m.
        scenario: of the game.

    Raises:
        ValueError: it is unknown, its number is out of range, or it is not of the error.
    """
    made = make_payoff(payoff, scenario)
    if made.objective.drives:
        raise ValueError(f"the bound is of errors of the estimate, not of payoff {made.name!r}; valid: error, beyond")
    return beyond_loss(made.limit) if isinstance(made, Beyond) else error_loss(made.largest)


def bounds(
    model: LinearModel, losses: dict[str, Loss], clean: float, games: int, seed: int, progress: Progress = silent
) -> Iterator[dict[str, LowerBound]]:
    """The lower bounds against the pulls of this program, by their payoffs, after each of these."""
    pulls = [*(drift_pull(model, scale) for scale in DRIFTS), *(unseen_pull(model, scale) for scale in UNSEEN)]
    found: dict[str, LowerBound] = {}
    for name, loss in losses.items():
        with progress(f"payoff {name}"):
            found[name] = lower_bound(model, loss, pulls, clean, games, seed)
        yield dict(found)


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    scenario = make_scenario(options.scenario)
    scenario.facts.require("the bound of a duel", (INERTIAL_SOLUTION, LINEAR_MODEL))
    losses = {payoff: loss_of(payoff, scenario) for payoff in options.payoff or ["error"]}
    games = (options.clean, options.games, options.seed)
    series = bounds(scenario.linear_model(), losses, *games, terminal.progress)
    report = last_of(bound_report(scenario, found, *games) for found in series)
    give(report, bound_table(report), options.json, terminal)
    return 0


def bound_report(
    scenario: Scenario, found: dict[str, LowerBound], clean: float, games: int, seed: int
) -> dict[str, Any]:
    """The bounds as JSON content."""
    rows = [
        {
            "payoff": payoff,
            "value": bound.value,
            "ci95": [bound.value - Z95 * bound.deviation, bound.value + Z95 * bound.deviation],
            "clean": bound.clean,
            "attacked": bound.attacked,
            "shares": bound.shares,
            "rate_m_per_s": bound.rate,
        }
        for payoff, bound in found.items()
    ]
    settings = {"scenario": scenario.name, "clean": clean, "games": games, "seed": seed}
    return {"schema_version": SCHEMA_VERSION, "kind": "duel-bound", **settings, "rows": rows}


def bound_table(report: dict[str, Any]) -> Table:
    """A ``"duel-bound"`` report for the terminal."""
    title = f"{report['scenario']}: no defender keeps the mean payoff below; {report['games']} games of each pull"
    table = Table(title=title, box=None)
    for name in ("payoff", "at least", "clean games", "attacked games", "pulls drawn", "rate, m/s"):
        table.add_column(name, justify="left" if name in ("payoff", "pulls drawn") else "right")
    for row in report["rows"]:
        low, high = row["ci95"]
        drawn = ", ".join(f"{name} {part:.0%}" for name, part in row["shares"].items() if part >= 0.005)
        table.add_row(
            row["payoff"],
            f"{row['value']:.3g} ± {0.5 * (high - low):.2g}",
            f"{row['clean']:.3g}",
            f"{row['attacked']:.3g}",
            drawn,
            f"{row['rate_m_per_s']:.1f}",
        )
    return table


if __name__ == "__main__":
    sys.exit(moved("spoofgym bound duel"))
