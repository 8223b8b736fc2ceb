"""Write one HTML page of games and results: figures that are read offline, on a phone, too.

    spoofgym report evaluation.json matrix.json -o report.html
    spoofgym report runs/league runs/seed0 runs/seed1 --title "The league of May" -o report.html

What it reads is JSON of the other programs and run folders; `spoofgym.report.sources` says which.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from spoofgym.command_line import Parser, output
from spoofgym.program import program
from spoofgym.report.page import write_page

EXAMPLES = (
    "spoofgym report evaluation.json matrix.json -o report.html",
    "spoofgym report runs/seed0 runs/seed1 -o curves.html",
)
DEFAULT_PAGE = "report.html"
EXAMPLES = (
    "spoofgym report evaluation.json matrix.json -o report.html",
    "spoofgym report runs/league runs/seed0 runs/seed1 -o league.html",
)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym report",
        description="Write one HTML page of games and results. It is complete in itself and needs no network.",
        examples=EXAMPLES,
    )
    add = result.add_argument
    add("sources", nargs="+", metavar="FILE|RUN",
        help="JSON that a program of spoofgym has written, or the folder of a training or of a league; runs that "
        "differ in their seed only share a figure")
    add("-o", "--out", type=output, default=Path(DEFAULT_PAGE), metavar="FILE",
        help="the page (default: %(default)s)")
    add("--title", help="of the page (default: that of the first source)")
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    write_page(options.out, [Path(source) for source in options.sources], options.title)
    print(f"page in {options.out}", file=sys.stderr)
    return 0
