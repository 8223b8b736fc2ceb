"""Filters of recorded logs before and after their noises were estimated, on fixes that the estimate has not seen.

    spoofgym study noise FOLDER ...

estimates the noises on the first half of each log and judges the second; ``--of OTHER`` estimates them on another log.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from typing import Any

from spoofgym.command_line import STDOUT, Parser, add_json
from spoofgym.console import console
from spoofgym.evaluation.noise.report import blind_reports
from spoofgym.program import last_of, moved, program
from spoofgym.studies.evaluate.recorded import recorded_log
from spoofgym.studies.giving import give

EXAMPLES = ("spoofgym study noise FOLDER OTHER --json out.json", "spoofgym study noise FOLDER --of OTHER")
INNOVATIONS = (
    *("log", "noises", "fixes", "NIS per degree", "autocorrelation", "white within", "alarms per hour at 1e-3"),
    *("right", "alarms at 1e-5", "jump seen, m"),
)
COVERAGE = ("log", "noises", "horizontal", "with the slow error", "up", "with the slow error")


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym study noise",
        description="Filters before and after their noises were estimated, on fixes that the estimate has not seen.",
        examples=EXAMPLES,
    )
    result.add_argument("logs", nargs="+", metavar="FOLDER", help="of a log, and options after it")
    result.add_argument("--of", metavar="FOLDER", help="estimate on all of this log (default: each log's first half)")
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    logs = [recorded_log(text) for text in options.logs]
    of = None if options.of is None else recorded_log(options.of)
    report = last_of(blind_reports(logs, of, terminal.progress))
    give(report, "\n".join(tables(report["rows"])), options.json, terminal)
    return 0


def tables(rows: list[dict[str, Any]]) -> list[str]:
    """The rows of a ``"blind-noise"`` report as two tables of a page: innovations, and errors within 1, 2, 3 sigma."""
    known = [row for row in rows if row["coverage"] is not None]
    return [*_table(INNOVATIONS, map(_innovations, rows)), "", *_table(COVERAGE, map(_coverage, known))]


def _table(head: Sequence[str], rows: Iterable[list[str]]) -> list[str]:
    return [f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows)]


def _innovations(row: dict[str, Any]) -> list[str]:
    often, rare = row["false_alarms"]
    low, high = often["per_hour_interval"]
    return [
        row["log"],
        row["noise"],
        str(row["epochs"]),
        f"{row['nis_per_degree']:.3f}",
        f"{min(row['autocorrelation']):.2f} to {max(row['autocorrelation']):.2f}",
        f"±{row['white_band']:.2f}",
        f"{often['per_hour']:.0f} ({low:.0f} to {high:.0f})",
        f"{often['expected_per_hour']:.1f}",
        f"{rare['alarms']}",
        f"{row['jump_seen_m']:.2f}",
    ]


def _coverage(row: dict[str, Any]) -> list[str]:
    coverage = row["coverage"]
    shares = [_percent(coverage[axes][kind]) for axes in ("horizontal", "up") for kind in ("filter", "whole")]
    return [row["log"], row["noise"], *shares]


def _percent(shares: list[float]) -> str:
    return ", ".join(f"{100.0 * share:.0f}" for share in shares) + " %"


if __name__ == "__main__":
    sys.exit(moved("spoofgym study noise"))
