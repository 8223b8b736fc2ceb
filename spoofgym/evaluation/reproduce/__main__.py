"""Print published figures beside ours.

    python -m spoofgym.evaluation.reproduce liu-2018
    python -m spoofgym.evaluation.reproduce foi-r-5687 --json rows.json
    python -m spoofgym.evaluation.reproduce shadmehri-2025
    python -m spoofgym.evaluation.reproduce song-2021
    python -m spoofgym.evaluation.reproduce kujur-2024

The tables need `spoofgym[train]`.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from spoofgym.evaluation.reproduce import foi_r_5687, kujur_2024, liu_2018, shadmehri_2025, song_2021

try:
    from rich.console import Console

    from spoofgym.evaluation.reproduce.table import WIDTH, print_reproduction
except ModuleNotFoundError as error:
    raise SystemExit("the tables need rich: pip install 'spoofgym[train]'") from error

PAPERS = {module.PAPER: module.reproduce for module in (liu_2018, foi_r_5687, shadmehri_2025, song_2021, kujur_2024)}
RUNS, QUICK_RUNS = 40, 4


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = argparse.ArgumentParser(
        prog="python -m spoofgym.evaluation.reproduce", description="Published figures beside ours, with a verdict."
    )
    add = result.add_argument
    add("paper", choices=sorted(PAPERS), help="whose figures")
    add("--runs", type=_count, help=f"of each game (default: {RUNS}, with --quick {QUICK_RUNS})")
    add("--seed", type=_seed, default=0, help="of run 0 (default: %(default)s)")
    add("--quick", action="store_true", help="few runs: shows that everything works, and stands for nothing")
    add("--json", metavar="FILE", help="write the rows as JSON; - = to stdout, and nothing else there")
    return result


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    runs = options.runs or (QUICK_RUNS if options.quick else RUNS)
    console = Console(stderr=options.json == "-", highlight=False)
    if not console.is_terminal:
        console.width = WIDTH
    report = PAPERS[options.paper](runs, options.seed, options.quick)
    print_reproduction(report, console)
    if options.json == "-":
        print(json.dumps(report.as_json(), allow_nan=False))
    elif options.json is not None:
        path = Path(options.json)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(report.as_json(), indent=2, allow_nan=False) + "\n")
        console.print(f"rows in {path}", markup=False)
    return 0


def _count(text: str) -> int:
    return _whole(text, 1)


def _seed(text: str) -> int:
    return _whole(text, 0)


def _whole(text: str, least: int) -> int:
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a whole number, got {text!r}") from None
    if value < least:
        raise argparse.ArgumentTypeError(f"expected {least} or more, got {text!r}")
    return value


if __name__ == "__main__":
    sys.exit(main())
