"""What both training programs do alike: begin or resume a run, and say how its training ended."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any, Protocol

import torch

from spoofgym.console import PlainConsole, console
from spoofgym.learning.run_folder import Run, RunFolder, given_options
from spoofgym.program import INTERRUPTED


class Training(Protocol):
    """The training of a run, built where the run stands."""

    @property
    def played(self) -> int:
        """Steps played, those before a resumption included."""
        ...

    def train(self) -> bool:
        """Train to the end; whether Ctrl-C came before it. What is left is a usable policy and a checkpoint."""
        ...

    def summary(self) -> str:
        """What the last line says of the training between its duration and its folder; empty = nothing."""
        ...


def train(
    options: argparse.Namespace,
    folder: RunFolder,
    asked_run: Callable[[dict[str, Any]], Run],
    make: Callable[[Run, RunFolder, PlainConsole], Training],
) -> int:
    """Begin the run that the options ask for, or go on with the one in the folder; returns the exit status.

    Args:
        options: of the command line.
        folder: of the run.
        asked_run: the run that given options ask for.
        make: builds the training of a run, where its checkpoint says that it stands.

    Raises:
        ValueError: the folder holds a run already, or none to resume, or the run cannot be built.
    """
    given = given_options(options)
    if options.resume:
        run = folder.resumed(given)
    else:
        folder.refuse_overwriting()
        run = asked_run(given)
    torch.set_num_threads(run.environment.threads)
    terminal = console(stderr=True)
    training = make(run, folder, terminal)
    if not options.resume:
        folder.begin(run)
    started, before = time.perf_counter(), training.played
    interrupted = training.train()
    played, seconds = max(0, training.played - before), time.perf_counter() - started
    summary = training.summary()
    terminal.print(
        f"{'interrupted after' if interrupted else 'trained'} {played:,} steps in {seconds:.0f} s"
        f"{', validation included' if summary else ''} ({played / max(seconds, 1e-9):,.0f} steps/s); "
        + (f"{summary}; " if summary else "")
        + f"policy in {folder.path}"
        + (f"; go on with: {folder.command}" if interrupted else ""),
        soft_wrap=True,
    )
    return INTERRUPTED if interrupted else 0
