"""What a defender's delay costs in metres on the road: `spoofgym.evaluation.delay`, as a program.

spoofgym study delay --attack ramp:1,direction=0 --delay 0 --delay 10
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

from rich.table import Table

from spoofgym.command_line import STDOUT, Parser, add_import, add_json, add_seed, add_threads, count
from spoofgym.console import console
from spoofgym.evaluation.delay import delay_reports
from spoofgym.program import last_of, moved, program
from spoofgym.scenarios import make_scenario
from spoofgym.studies.giving import give

EXAMPLES = (
    "spoofgym study delay",
    "spoofgym study delay --attack fusion-ripper:0.7,f=1.1 --delay 5 --delay 20",
    "spoofgym study delay --scenario foi-drive:horizon=60,guidance=second-order:1",
)
SCENARIO = "foi-drive:horizon=60,guidance=first-order:1"
ATTACKS = ("ramp:0.5,direction=0", "ramp:1,direction=0", "ramp:2,direction=0")
DELAYS = (0.0, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0)
EPISODES = 1000


def parser() -> Parser:
    """The command line."""
    result = Parser(
        prog="spoofgym study delay", examples=EXAMPLES,
        description="What a defender that leaves every spoofed fix out, but too late, costs in metres on the road.",
    )
    add = result.add_argument
    add("--scenario", default=SCENARIO, help="with guidance= (default: %(default)s)")
    add("--attack", action="append", metavar="SPEC", help=f"repeatable (default: {', '.join(ATTACKS)})")
    add("--delay", action="append", type=float, metavar="S",
        help="from the first spoofed fix to the first that is left out; repeatable (default: 0 to 20 s)")
    add("--episodes", type=count, default=EPISODES, help="games of each row (default: %(default)s)")
    add_seed(result, "game 0")
    add_threads(result)
    add_import(result)
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    attacks, delays = options.attack or ATTACKS, options.delay or DELAYS
    games = (options.episodes, options.seed, options.threads)
    report = last_of(delay_reports(make_scenario(options.scenario), attacks, delays, *games, terminal.progress))
    give(report, delay_table(report), options.json, terminal)
    return 0


def delay_table(report: dict[str, Any]) -> Table:
    """A ``"delay"`` report for the terminal: a row for each delay, without and with taking back."""
    width = report["rows"][0]["deviation"]["corridor_m"]
    table = Table(
        title=f"{report['scenario']}, {report['episodes']} games each",
        caption="a defender that knows which fixes are spoofed leaves them out, from so long after the first one on; "
        "alone, or taking those used before back. largest: mean of each game's largest distance of the vehicle from "
        f"its path, with 95 % interval; left: share of games that leave the corridor of {width:g} m",
        box=None, padding=(0, 2, 0, 0),
    )
    table.add_column("attack\n", overflow="fold")
    for title in ("delay\ns", "left out:\nlargest, m", "\nleft", "taken back:\nlargest, m", "\nleft"):
        table.add_column(title, justify="right", no_wrap=True)
    pairs = zip(report["rows"][::2], report["rows"][1::2], strict=False)
    for alone, back in pairs:
        cells = [cell for row in (alone, back) for cell in _cells(row["deviation"])]
        table.add_row(alone["attack"], f"{alone['delay_s']:g}", *cells)
    return table


def _cells(deviation: dict[str, Any]) -> tuple[str, str]:
    low, high = deviation["largest_ci95_m"]
    return f"{deviation['largest_m']:.2f} ±{0.5 * (high - low):.2f}", f"{deviation['left_corridor']:.3f}"


if __name__ == "__main__":
    sys.exit(moved("spoofgym study delay"))
