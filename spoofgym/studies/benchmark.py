"""Play spoofgym-bench v1: fixed opponents, seeds and numbers of games; scores with intervals, and one summary.

    spoofgym benchmark attack ramp:0.5
    spoofgym benchmark defend snapshot/exclude --json result.json
    spoofgym benchmark attack policy:runs/s0 policy:runs/s1 policy:runs/s2   # seeds of one method
    spoofgym benchmark defend policy:runs/d --tasks foi-drive
    spoofgym benchmark table --write docs/results/benchmark.md
    spoofgym benchmark references attack

A player is spelled as everywhere: an attack or a response, ``detector > response``, ``policy:NAME`` or
``policy:FOLDER``. Games are kept in a folder, so that a program that was stopped goes on with the same command. The
definition stands in `spoofgym.evaluation.benchmark_v1`, and docs/results/benchmark.md is the page.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.table import Table

from spoofgym.command_line import STDOUT, Parser, add_import, add_json, count, output, run_folder
from spoofgym.console import console, show
from spoofgym.evaluation.benchmark import ATTACK, DEFEND, TRACKS
from spoofgym.evaluation.benchmark_play import Matches
from spoofgym.evaluation.benchmark_report import measure, references
from spoofgym.evaluation.benchmark_v1 import V1
from spoofgym.evaluation.engine import Engine, Notify, make_engine
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.program import FAILURE, goes_on, moved, program
from spoofgym.studies.benchmark_page import page_results, write_rows
from spoofgym.studies.benchmark_presentation import (
    agrees,
    check_page,
    page_columns,
    page_rows,
    references_table,
    report_tables,
    write_page,
)
from spoofgym.studies.giving import give

EXAMPLES = (
    "spoofgym benchmark attack ramp:0.5",
    "spoofgym benchmark defend snapshot/exclude --tasks foi-drive",
    "spoofgym benchmark attack policy:runs/s0 policy:runs/s1 --json result.json",
)

TABLE, REFERENCES = "table", "references"
HELP = {
    ATTACK: "measure a spoofer: the share of the optimum, or of the best known attack",
    DEFEND: "measure a defender: harm on held-out attacks and in the worst case",
    TABLE: "the tables of all baselines and published agents",
    REFERENCES: "play the scores that are worth 0 and 1 again, and compare",
}


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(prog="spoofgym benchmark", examples=EXAMPLES, description=f"Play {V1.name} ({V1.digest}).")
    commands = result.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=Parser)
    for name, told in HELP.items():
        command = commands.add_parser(name, help=told, description=told[0].upper() + told[1:] + ".")
        add = command.add_argument
        if name in TRACKS:
            add("policies", metavar="POLICY", nargs="+", help="who plays; several are training seeds of one method")
        if name == REFERENCES:
            add("track", choices=TRACKS, help="whose references")
        if name != TABLE:
            add("--tasks", action="append", default=[], metavar="NAME[,NAME]",
                help="tasks, or beginnings of their names: foi-drive, foi-drive/error; repeatable (default: all)")
            add_json(command)
        else:
            add("--write", metavar="FILE", type=output,
                help="page whose tables are replaced, between their marks; rows are kept beside it as JSON")
            add("--again", action="store_true", help="take no row from the JSON file")
        add_import(command)
        add("--workers", type=count, help="processes (default: one for each core)")
        add("--out", type=run_folder, default=Path("runs/benchmark"),
            help="folder of the games (default: %(default)s)")
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    engine = make_engine("processes", options.workers)
    matches = Matches(V1, options.out / "cells")
    notify = partial(console(stderr=True).print, soft_wrap=True)
    with goes_on(options.out):
        if options.command == TABLE:
            return _table(options, matches, engine, notify)
        asked = [name for text in options.tasks for name in text.split(",")]
        if options.command == REFERENCES:
            return _references(options, matches, asked, engine, notify)
        report = measure(matches, options.command, options.policies, asked, engine, notify)
    _give(report_tables(report), report, options.json)
    return 0


def _references(
    options: argparse.Namespace, matches: Matches, asked: Sequence[str], engine: Engine, notify: Notify
) -> int:
    found = references(matches, V1.chosen(options.track, asked), engine, notify)
    tasks = [asdict(each) for each in found]
    pinned = {"benchmark": V1.name, "digest": V1.digest, "track": options.track}
    report = {"schema_version": SCHEMA_VERSION, "kind": "references", **pinned, "tasks": tasks}
    _give([references_table(found, V1)], report, options.json)
    return 0 if all(agrees(each, V1) for each in found) else FAILURE


def _table(options: argparse.Namespace, matches: Matches, engine: Engine, notify: Notify) -> int:
    page: Path | None = options.write
    kept = None if page is None else page.with_suffix(".json")
    if page is not None:
        check_page(page)
    rows = page_results(matches, None if options.again else kept, engine, notify)
    if page is not None and kept is not None:
        write_rows(kept, V1, rows)
        write_page(page, V1, rows)
    terminal = console()
    for track in TRACKS:
        table = Table(title=f"{V1.name} ({V1.digest}), track '{track}'", box=None)
        for name in page_columns(V1, track):
            table.add_column(name, justify="left" if name == "player" else "right")
        for row in page_rows(V1, track, rows[track]):
            table.add_row(*row)
        show(terminal, table)
    return 0


def _give(tables: Sequence[Table], report: dict[str, Any], destination: Any) -> None:
    give(report, Group(*tables), destination, console(stderr=destination == STDOUT))


if __name__ == "__main__":
    sys.exit(moved("spoofgym benchmark"))
