"""Every detector on real attacks, and on attacks injected into clean records, at one false-alarm rate.

    spoofgym study real-attacks
    spoofgym study real-attacks FOLDER

The first takes the logs in ``../shared/data``, the second a log of your own.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from spoofgym.command_line import STDOUT, Parser, add_figure, add_import, add_json, add_seed, count, share_of_alarms
from spoofgym.console import console
from spoofgym.detectors import make_detector
from spoofgym.evaluation.progress import Progress
from spoofgym.evaluation.real_attacks.injected import INJECTED, words_of
from spoofgym.evaluation.real_attacks.records import folders_of, records
from spoofgym.evaluation.real_attacks.study import GAMES, PROBABILITY, Asked, real_attacks
from spoofgym.program import last_of, moved, program
from spoofgym.studies.giving import Output, give
from spoofgym.studies.real_attacks_figure import real_attacks_figure
from spoofgym.studies.real_attacks_presentation import real_attacks_tables

EXAMPLES = (
    "spoofgym study real-attacks FOLDER",
    "spoofgym study real-attacks FOLDER,noise_factor=3 --p-fa 0.02 --figure a.png",
    "spoofgym study real-attacks SPOOFED SCENE --detector snapshot --json -",
)
DATA = Path("../shared/data")
"""Where logs are looked for if none are named."""
MOST_GAMES = 200


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym study real-attacks", examples=EXAMPLES,
        description="Every detector on the real attacks that logs hold, and on attacks injected into clean logs, at "
        "one false-alarm rate.",
    )  # fmt: skip
    add = result.add_argument
    add("logs", nargs="*", metavar="FOLDER",
        help=f"of a log, and options after it: FOLDER,noise_factor=3 (default: all logs in {DATA})")
    add("--p-fa", type=share_of_alarms, default=PROBABILITY, metavar="P",
        help="false alarms per epoch, at which all thresholds are set on the clean record (default: %(default)s)")
    add("--runs", type=count, default=GAMES, metavar="N",
        help="games of each injected attack along each log (default: %(default)s)")
    add("--attack", action="append", metavar="SPEC",
        help=f"injected attack; repeatable (default: {', '.join(INJECTED)})")
    add("--detector", action="append", metavar="SPEC", help="repeatable (default: one of every family)")
    add_seed(result, "simulated IMUs, and of what attacks draw")
    add_import(result)
    add_json(result)
    add_figure(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    report = _report(options, terminal.progress)
    outputs: list[Output] = [("figure", options.figure, partial(real_attacks_figure, report))]
    give(report, real_attacks_tables(report), options.json, terminal, outputs)
    return 0


def _report(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    texts = options.logs or folders_of(DATA)
    if not texts:
        raise ValueError(f"no logs: {DATA} holds none; name a folder, as spoofgym import or spoofgym log writes it")
    if options.runs > MOST_GAMES:
        raise ValueError(f"--runs must be {MOST_GAMES} or less, got {options.runs}")
    asked = Asked(
        words_of(options.attack),
        None if options.detector is None else [make_detector(text) for text in options.detector],
        options.p_fa,
        options.runs,
        options.seed,
    )
    return last_of(real_attacks(records(texts), asked, progress, lenient=not options.logs))


if __name__ == "__main__":
    sys.exit(moved("spoofgym study real-attacks"))
