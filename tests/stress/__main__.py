"""Tries to break what docs/reliability.md promises: ``python -m tests.stress``.

Not part of the test suite: it takes as long as it is told to. Every try follows from the seed. It prints counts, and
stops with exit status 1 at the first broken promise.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from tests.stress import arguments, kills, logs, steps


def main(argv: list[str] | None = None) -> int:
    """Run the program; the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.stress", description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="of all tries (default 0)")
    parser.add_argument("--steps", type=int, default=100_000, help="steps of lanes in fuzzed games (default 100,000)")
    parser.add_argument("--arguments", type=int, default=10_000, help="hostile arguments (default 10,000)")
    parser.add_argument("--logs", type=int, default=200, help="mutated logs (default 200)")
    parser.add_argument("--kills", type=int, default=4, help="trainings killed and resumed (default 4)")
    given = parser.parse_args(argv)
    with tempfile.TemporaryDirectory(prefix="spoofgym-stress-") as scratch:
        folder = Path(scratch)
        kinds: tuple[tuple[str, int, int, Callable[[int, int], list[str]]], ...] = (
            ("steps of lanes", given.steps, 2_000, steps.fuzz),
            ("hostile arguments", given.arguments, 500, arguments.fuzz),
            ("mutated logs", given.logs, 10, lambda seed, tries: logs.fuzz(seed, tries, folder)),
            ("kills of a training", given.kills, 1, lambda seed, tries: kills.fuzz(seed, tries, folder)),
        )
        for name, total, chunk, fuzz in kinds:
            if not _try(name, total, chunk, fuzz, given.seed):
                return 1
    return 0


def _try(name: str, total: int, chunk: int, fuzz: Callable[[int, int], list[str]], seed: int) -> bool:
    """Make ``total`` tries of one kind, a chunk at a time, each with a seed of its own; whether the promises held."""
    begun, made = time.monotonic(), 0
    while made < total:
        tries = min(chunk, total - made)
        broken = fuzz(seed + made, tries)
        made += tries
        if broken:
            print(f"{name}: {made:,} tried, a promise is broken", flush=True)
            print(f"  seed {seed + made - tries}: {broken[0]}", flush=True)
            return False
        _tell(f"{name}: {made:,} of {total:,} tried", end="\r" if sys.stdout.isatty() else None)
    print(f"{name}: {made:,} tried, every promise held ({time.monotonic() - begun:.0f} s)", flush=True)
    return True


def _tell(text: str, end: str | None) -> None:
    if end is not None:
        print(text, end=end, flush=True)


if __name__ == "__main__":
    sys.exit(main())
