"""Loosely and tightly coupled filters side by side on a drive whose log has raw ranges, clean and pulled north.

``spoofgym study recorded-ranges PATH`` prints two tables: the filters on the clean drive, and games in
which all ranges (or the fixes made from them) are pulled as one position.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any

from spoofgym.command_line import STDOUT, Parser, add_json
from spoofgym.console import console
from spoofgym.evaluation.recorded_ranges import side_by_side
from spoofgym.program import last_of, moved, program
from spoofgym.studies.giving import give

EXAMPLES = (
    "spoofgym study recorded-ranges FOLDER --json out.json",
)


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def tables(report: dict[str, Any]) -> list[str]:
    """The lines of both tables, and the clock's."""
    lines = [
        "| filter, clean | epochs | median, m | 95 %, m | common epochs | median, m | 95 %, m | NIS per degree "
        "| false alarms per hour |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in report["clean"]:
        alarms = ", ".join(f"{name} {entry['per_hour']:.0f}" for name, entry in row["false_alarms"].items())
        lines.append(
            f"| {row['filter']} | {row['compared']} | {_number(row['median_m'], 2)} | {_number(row['p95_m'], 1)} "
            f"| {row['common']} | {_number(row['common_median_m'], 2)} | {_number(row['common_p95_m'], 1)} "
            f"| {row['nis_per_degree']:.2f} | {alarms} |"
        )
    lines += [
        "",
        "| filter, pulled | m/s north | median, m | 95 %, m | NIS per degree | detector | any alarm "
        "| alarm owed to the pull | after, s | pulled by then, m |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in report["pulled"]:
        owed = row["owed"]
        lines.append(
            f"| {row['filter']} | {row['rate_mps']:g} | {_number(row['median_m'], 1)} | {_number(row['p95_m'], 1)} "
            f"| {row['nis_per_degree']:.2f} | {row['detector']} | {row['any']['games']} of {row['games']} "
            f"| {owed['games']} of {row['games']} | {_number(owed['median_s'], 0)} "
            f"| {_number(owed['median_pull_m'], 0)} |"
        )
    clock = report["clock"]
    lines += [
        "",
        f"drift of the receiver's clock: {clock['by_pseudoranges_mps']:.1f} m/s by pseudoranges, "
        f"{clock['by_range_rates_mps']:.1f} m/s by range rates (medians); at most "
        f"{clock['largest_difference_mps']:.0f} m/s apart",
    ]
    return lines


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym study recorded-ranges",
        description="Filters side by side on a drive with raw ranges, clean and pulled.",
        examples=EXAMPLES,
    )
    result.add_argument("path", metavar="PATH", help="folder of a log with ranges.csv and ephemeris.csv")
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    report = last_of(side_by_side(options.path, terminal.progress))
    give(report, "\n".join(tables(report)), options.json, terminal)
    return 0


if __name__ == "__main__":
    sys.exit(moved("spoofgym study recorded-ranges"))
