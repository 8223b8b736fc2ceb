"""Tries to break what docs/inside/reliability.md promises: ``python -m tests.stress``.

Not part of the test suite: it takes as long as it is told to. Every try follows from the seed. It prints counts, and
stops with exit status 1 at the first broken promise.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from spoofgym.command_line import Parser, count, seed_number
from spoofgym.program import program
from tests.stress import arguments, kills, logs, steps
from tests.stress.progress import Progress

Fuzz = Callable[[int, int], list[str]]
"""Makes tries from a seed; the broken promises."""


def count_or_none(text: str) -> int:
    """A whole number of 0 or more."""
    return 0 if text == "0" else count(text)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="python -m tests.stress",
        description="Try to break the promises of docs/inside/reliability.md. Exit status: 0 where all held, 1 at "
        "the first that is broken, 2 for a wrong option, 130 after Ctrl-C.",
    )
    add = result.add_argument
    add("--seed", type=seed_number, default=0, metavar="S", help="from which every try follows (default: %(default)s)")
    add("--steps", type=count_or_none, default=100_000, metavar="N",
        help="steps of lanes in fuzzed games (default: %(default)s)")
    add("--arguments", type=count_or_none, default=10_000, metavar="N",
        help="hostile arguments (default: %(default)s)")
    add("--logs", type=count_or_none, default=200, metavar="N", help="mutated logs (default: %(default)s)")
    add("--kills", type=count_or_none, default=4, metavar="N",
        help="trainings killed and resumed (default: %(default)s)")
    return result


@program
def main(command_line: Sequence[str] | None = None) -> int:
    """Run the program; the exit status."""
    given = parser().parse_args(command_line)
    with tempfile.TemporaryDirectory(prefix="spoofgym-stress-") as scratch:
        folder = Path(scratch)
        kinds: tuple[tuple[str, int, int, Fuzz], ...] = (
            ("steps of lanes", given.steps, 2_000, steps.fuzz),
            ("hostile arguments", given.arguments, 500, arguments.fuzz),
            ("mutated logs", given.logs, 10, lambda seed, tries: logs.fuzz(seed, tries, folder)),
            ("kills of a training", given.kills, 1, lambda seed, tries: kills.fuzz(seed, tries, folder)),
        )
        for name, total, chunk, fuzz in kinds:
            if not _try(name, total, chunk, fuzz, given.seed):
                return 1
    return 0


def _try(name: str, total: int, chunk: int, fuzz: Fuzz, seed: int) -> bool:
    """Make ``total`` tries of one kind, a chunk at a time, each with a seed of its own; whether the promises held."""
    progress, made = Progress(name, total, sys.stdout), 0
    while made < total:
        tries = min(chunk, total - made)
        broken = fuzz(seed + made, tries)
        made += tries
        if broken:
            progress.end(f"{made:,} tried, a promise is broken")
            print(f"  seed {seed + made - tries}: {broken[0]}", flush=True)
            return False
        progress.tell(made)
    progress.end(f"{made:,} tried, every promise held")
    return True


if __name__ == "__main__":
    sys.exit(main())
