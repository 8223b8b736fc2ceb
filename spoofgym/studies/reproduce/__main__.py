"""Print published figures beside ours.

    spoofgym reproduce liu-2018
    spoofgym reproduce foi-r-5687 --json rows.json
    spoofgym reproduce shadmehri-2025
    spoofgym reproduce song-2021
    spoofgym reproduce kujur-2024

The argument names the paper.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from spoofgym.command_line import STDOUT, Parser, add_json, add_seed, count
from spoofgym.console import console
from spoofgym.program import do_all, give_json, moved, program
from spoofgym.studies.reproduce import foi_r_5687, kujur_2024, liu_2018, shadmehri_2025, song_2021
from spoofgym.studies.reproduce.table import WIDTH, print_reproduction

EXAMPLES = (
    "spoofgym reproduce liu-2018",
    "spoofgym reproduce foi-r-5687 --quick --json rows.json",
)

PAPERS = {module.PAPER: module.reproduce for module in (liu_2018, foi_r_5687, shadmehri_2025, song_2021, kujur_2024)}
RUNS, QUICK_RUNS = 40, 4


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym reproduce", examples=EXAMPLES, description="Published figures beside ours, with a verdict."
    )
    add = result.add_argument
    add("paper", choices=sorted(PAPERS), help="whose figures")
    add("--runs", type=count, help=f"of each game (default: {RUNS}, with --quick {QUICK_RUNS})")
    add_seed(result, "run 0")
    add("--quick", action="store_true", help="few runs: shows that everything works, and stands for nothing")
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    runs = options.runs or (QUICK_RUNS if options.quick else RUNS)
    terminal = console(stderr=options.json == STDOUT)
    if not terminal.is_terminal:
        terminal.width = WIDTH
    report = PAPERS[options.paper](runs, options.seed, options.quick)
    do_all(lambda: print_reproduction(report, terminal), lambda: give_json(report.as_json(), options.json))
    if options.json not in (None, STDOUT):
        terminal.print(f"rows in {options.json}", soft_wrap=True)
    return 0


if __name__ == "__main__":
    sys.exit(moved("spoofgym reproduce"))
