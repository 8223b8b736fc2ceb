"""Print published figures beside ours.

    spoofgym reproduce liu-2018
    spoofgym reproduce foi-r-5687 --json rows.json
    spoofgym reproduce shadmehri-2025
    spoofgym reproduce song-2021
    spoofgym reproduce kujur-2024
    spoofgym reproduce all

The argument names the paper; `all` prints how many figures of each came out.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from spoofgym.command_line import STDOUT, Parser, add_json, add_seed, count
from spoofgym.console import console
from spoofgym.evaluation.progress import Progress
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.program import COMPLETE, last_of, moved, program
from spoofgym.studies.giving import give
from spoofgym.studies.reproduce.papers import PAPERS, reproductions
from spoofgym.studies.reproduce.rows import Reproduction
from spoofgym.studies.reproduce.table import WIDTH, reproduction_parts, summary

EXAMPLES = (
    "spoofgym reproduce liu-2018",
    "spoofgym reproduce foi-r-5687 --quick --json rows.json",
    "spoofgym reproduce all --json all.json",
)
ALL = "all"

RUNS, QUICK_RUNS = 40, 4


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym reproduce", examples=EXAMPLES, description="Published figures beside ours, with a verdict."
    )
    add = result.add_argument
    add("paper", choices=[*sorted(PAPERS), ALL], help="whose figures; all = a summary of all papers")
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
    if options.paper == ALL:
        reports = last_of(_all(options, runs, terminal.progress), list)
        give(_whole(reports), summary(reports), options.json, terminal)
        return 0
    series = reproductions(options.paper, runs, options.seed, options.quick, terminal.progress)
    report = last_of(series, partial(replace, complete=False))
    give(report.as_json(), reproduction_parts(report, terminal.width), options.json, terminal)
    return 0


def _all(options: argparse.Namespace, runs: int, progress: Progress) -> Iterator[list[Reproduction]]:
    """All papers that have been reproduced, after each."""
    done: list[Reproduction] = []
    for paper in PAPERS:
        *_, whole = reproductions(paper, runs, options.seed, options.quick, progress)
        done.append(whole)
        yield list(done)


def _whole(reports: Sequence[Reproduction]) -> dict[str, Any]:
    """The rows of several papers with plain types."""
    complete = {} if len(reports) == len(PAPERS) else {COMPLETE: False}
    return {
        "schema_version": SCHEMA_VERSION,
        "kind": "reproductions",
        "papers": [report.as_json() for report in reports],
        **complete,
    }


if __name__ == "__main__":
    sys.exit(moved("spoofgym reproduce"))
