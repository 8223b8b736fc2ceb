"""FusionRipper's published outcomes on a recorded drive beside ours: `spoofgym.evaluation.fusion_ripper`, as a program.

spoofgym study fusion-ripper FOLDER --json out.json
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from spoofgym.command_line import STDOUT, Parser, add_json
from spoofgym.console import console
from spoofgym.evaluation.fusion_ripper import LIMITS, fusion_ripper_report
from spoofgym.program import moved, program
from spoofgym.studies.giving import give
from spoofgym.studies.presentation import number

EXAMPLES = (
    "spoofgym study fusion-ripper FOLDER",
    "spoofgym study fusion-ripper FOLDER --guidance second-order:1 --json out.json",
)
GUIDANCE = "first-order:1"
FARTHEST = LIMITS[-1]


def parser() -> Parser:
    """The command line."""
    result = Parser(
        prog="spoofgym study fusion-ripper", examples=EXAMPLES,
        description="The published outcomes of FusionRipper on a recorded drive beside ours with the same parameters.",
    )
    add = result.add_argument
    add("folder", metavar="FOLDER", type=Path, help="of a log with fusion_ripper_outcomes.csv")
    add("--guidance", default=GUIDANCE, metavar="SPEC", help="of the vehicle (default: %(default)s)")
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    report = fusion_ripper_report(options.folder, options.guidance, terminal.progress)
    give(report, fusion_ripper_table(report), options.json, terminal)
    return 0


def fusion_ripper_table(report: dict[str, Any]) -> Table:
    """A ``"fusion-ripper"`` report for the terminal."""
    table = Table(
        title=f"{report['scenario']}: medians, m and s",
        caption="publ.: largest lateral deviation of the victim, which has lidar, too. ours: largest lateral pull "
        f"of our filter until the offset has grown for {report['growth_s']} s, with the least and the largest of the "
        "attacks; error: against the truth then; vehicle: how far it leaves its path; over: time from the beginning "
        f"of the growth until the deviation (publ.) and the pull (ours) exceed {FARTHEST:g} m",
        box=None, padding=(0, 2, 0, 0),
    )
    table.add_column("published\nvictim", no_wrap=True)
    for title in ("attacks\n", "publ.\nm", "ours\nm", "error\nm", "vehicle\nm", "over\npubl. s", "over\nours s"):
        table.add_column(title, justify="right")
    for row in report["rows"]:
        ours = row["pulled_m"]
        over = row["first_over"][-1]
        table.add_row(
            row["published_victim"],
            str(row["attacks"]),
            f"{row['published_largest_m']:.1f}",
            f"{ours['median']:.1f} [{ours['least']:.1f}, {ours['most']:.1f}]",
            f"{row['error_m']['median']:.1f}",
            f"{row['departed_m']['median']:.1f}",
            number(over["published_s"], ".0f"),
            number(over["ours_s"], ".0f"),
        )
    return table


if __name__ == "__main__":
    sys.exit(moved("spoofgym study fusion-ripper"))
