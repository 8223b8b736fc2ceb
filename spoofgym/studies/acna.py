"""The parameter study of ACNA (Song 2021, section 4.3): windows and thresholds of both tests, in closed loop.

``spoofgym study acna`` plays the robot under the paper's jump and slow-change attacks with every
pair of window and threshold, each test alone, and prints what the best and the published pairs give. An alarm leaves
the fix out, so that the auxiliary position runs on, as the paper's steps 1 to 8 say. ``--figure FILE`` draws the
rates over the thresholds; ``--json -`` prints JSON alone.

Rates are in the usual orientation: a false alarm is an alarm on a clean fix, a missed detection a spoofed fix without
one. The paper calls normal positive, so that its P_FA (eq 13) is what is missed here and its P_MD (eq 14) the false
alarms; their sum and the accuracy P_D (eq 12) are the same.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym import files, validation
from spoofgym.arrays import Floats, Runs
from spoofgym.attacks import make_attack
from spoofgym.command_line import STDOUT, Parser, add_figure, add_import, add_json, add_seed, add_threads, count
from spoofgym.console import console
from spoofgym.detectors.acna import (
    SONG_JUMP_EPOCHS,
    SONG_JUMP_THRESHOLD,
    SONG_SLOW_EPOCHS,
    SONG_SLOW_THRESHOLD,
    gnss_drift,
)
from spoofgym.detectors.base import Detector
from spoofgym.evaluation.progress import Progress
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.figures import new_figure
from spoofgym.navigation.facts import ODOMETER
from spoofgym.navigation.interface import Demands, Epoch
from spoofgym.program import last_of, moved, program
from spoofgym.responses.exclude import Exclude
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.streams import RunStreams
from spoofgym.studies.giving import give

EXAMPLES = (
    "spoofgym study acna --runs 10",
    "spoofgym study acna --figure acna.png --json rows.json",
)

TESTS = ("jump", "slow")
ATTACKS = {"jump": "jump:onset=150", "slow": "slow-change:onset=150"}
"""Data sets Ψ̃2 and Ψ̃3; both last to the end."""
EPOCHS = np.arange(1, 21)
"""Lengths of window that are studied, n_j and n_s (section 4.3)."""
WINDOWS = (1, 2, 3, 5, 10, 20)
"""Those that the table shows."""
THRESHOLDS = {"jump": np.round(0.1 * np.arange(61), 10), "slow": np.round(0.1 * np.arange(101), 10)}
"""Th_j of eq 30 and Th_s of eq 33, m, the latter in steps of 0.1 m instead of 0.01 m."""
PUBLISHED = {
    "jump": (SONG_JUMP_EPOCHS, SONG_JUMP_THRESHOLD),
    "slow": (SONG_SLOW_EPOCHS, SONG_SLOW_THRESHOLD),
}
SYMBOLS = {"jump": ("n_j", "Th_j"), "slow": ("n_s", "Th_s")}
COLOURS = ("#1f77b4", "#ff7f0e", "#2ca02c", "#9467bd")


@dataclass(frozen=True)
class Rates:
    """Of P pairs of window and threshold, over all epochs of all runs.

    Attributes:
        accuracy: right decisions, P_D (eq 12), (P,).
        false_alarm: alarms on clean fixes, (P,).
        missed: spoofed fixes without an alarm, (P,).
    """

    accuracy: Floats
    false_alarm: Floats
    missed: Floats

    @property
    def total(self) -> Floats:
        """False alarms plus missed detections, (P,): what f_c minimises (eq 32)."""
        return self.false_alarm + self.missed


class OneTest(Detector):
    """One of ACNA's tests, with a window and a threshold of its own in each run.

    Args:
        test: ``jump`` (eq 26) or ``slow`` (eq 27).
        epochs: n of each run, (N,).
        thresholds: Th of each run, (N,), m.
    """

    threshold = 0.5
    demands = Demands(auxiliary=True)
    needs = (ODOMETER,)
    needs_view = True

    def __init__(self, test: str, epochs: Runs, thresholds: Floats) -> None:
        self._test, self._epochs, self._thresholds = test, epochs, thresholds

    @property
    def name(self) -> str:
        """Of the test; no specification builds it."""
        return f"acna-{self._test}"

    def bind(self, num_runs: int, dimension: int) -> None:
        """Allocate the drifts of the longest window, the newest first, and the marks of the jump test."""
        self._drifts = np.zeros((num_runs, int(self._epochs.max())))
        self._marks = np.zeros(num_runs, dtype=np.int64)
        self._within = np.arange(self._drifts.shape[1]) < self._epochs[:, None]

    def update(self, epoch: Epoch) -> Floats:
        """1 where the test alarms, else 0, (N,)."""
        drift = gnss_drift(epoch, "auxiliary")
        if self._test == "jump":
            self._marks = np.where(drift > self._thresholds, self._marks + 1, 0)
            return (self._marks >= self._epochs).astype(np.float64)
        self._drifts[:, 1:] = self._drifts[:, :-1]
        self._drifts[:, 0] = drift
        mean = np.add.reduce(np.where(self._within, self._drifts, 0.0), axis=1) / self._epochs
        return (mean >= self._thresholds).astype(np.float64)


def play(
    scenario: str, test: str, epochs: Runs, thresholds: Floats, runs: int, seed: int, num_threads: int = 1
) -> Rates:
    """Rates of pairs of window and threshold on the attack that a test is for; all pairs meet the same noise.

    Args:
        scenario: with an odometer.
        test: ``jump`` or ``slow``.
        epochs: n of each pair, (P,).
        thresholds: Th of each pair, (P,), m.
        runs: per pair.
        seed: of run 0.
        num_threads: that simulate.

    Raises:
        ValueError: the scenario has no odometer, or there is no run.
    """
    validation.runs("acna_study", "runs", runs)
    pairs = len(epochs)
    right, false, missed = np.zeros(pairs), np.zeros(pairs), np.zeros(pairs)
    clean = spoofed = 0
    for run in range(runs):
        parent = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed + run)))
        simulation = Simulation(
            make_scenario(scenario),
            make_attack(ATTACKS[test]),
            [OneTest(test, epochs, thresholds)],
            Exclude(),
            pairs,
            streams=RunStreams([parent] * pairs),
            threads=num_threads,
        )
        simulation.reset()
        for _ in range(simulation.scenario.timeline.num_epochs):
            simulation.resolve()
            simulation.observe()
            alarm = simulation.alarm
            if simulation.attacked[0]:
                spoofed += 1
                missed += ~alarm
                right += alarm
            else:
                clean += 1
                false += alarm
                right += ~alarm
    return Rates(right / (clean + spoofed), false / clean, missed / spoofed)


def study(scenario: str, test: str, runs: int, seed: int, num_threads: int = 1) -> Rates:
    """Rates on the whole grid, (windows, thresholds); arguments and errors as `play`."""
    windows, levels = np.meshgrid(EPOCHS, THRESHOLDS[test], indexing="ij")
    rates = play(scenario, test, windows.ravel(), levels.ravel(), runs, seed, num_threads)
    return Rates(*(part.reshape(windows.shape) for part in (rates.accuracy, rates.false_alarm, rates.missed)))


def rows(test: str, grid: Rates, published: Rates) -> list[dict[str, Any]]:
    """A row for the best threshold of some windows each, then one for the published pair."""
    result = []
    for window in WINDOWS:
        best = int(grid.accuracy[window - 1].argmax())
        result.append(_row(test, "best", window, THRESHOLDS[test][best], grid, (window - 1, best)))
    result.append(_row(test, "published", *PUBLISHED[test], published, (0,)))
    return result


def _row(test: str, choice: str, window: int, level: float, rates: Rates, place: tuple[int, ...]) -> dict[str, Any]:
    return {
        "test": test,
        "choice": choice,
        "window": window,
        "threshold_m": float(level),
        "accuracy": float(rates.accuracy[place]),
        "false_alarm": float(rates.false_alarm[place]),
        "missed": float(rates.missed[place]),
    }


def _line(row: dict[str, Any]) -> str:
    choice = "best Th" if row["choice"] == "best" else row["choice"]
    return (
        f"| {row['test']} | {choice}, {SYMBOLS[row['test']][0]} = {row['window']} | {row['threshold_m']:.2f} "
        f"| {row['accuracy']:.3f} | {row['false_alarm']:.3f} | {row['missed']:.3f} |"
    )


def draw(grids: dict[str, Rates], path: Path) -> None:
    """Accuracy, and false alarms plus missed detections, over the threshold, for some windows (figures 9 to 12).

    Raises:
        ImportError: matplotlib is missing.
    """
    figure = new_figure(9.0, 5.6, dpi=150, layout="constrained")
    axes = figure.subplots(2, 2, sharex="col", sharey="row")
    for column, (test, grid) in enumerate(grids.items()):
        symbol, level = SYMBOLS[test]
        for window, colour in zip((1, 2, 5, 20), COLOURS, strict=True):
            for row, values in enumerate((grid.accuracy, grid.total)):
                axes[row, column].plot(
                    THRESHOLDS[test], values[window - 1], color=colour, linewidth=1.5, label=f"${symbol}$ = {window}"
                )
        for row in range(2):
            axes[row, column].axvline(PUBLISHED[test][1], color="grey", linestyle=":", linewidth=1.2)
            axes[row, column].grid(alpha=0.25)
        axes[0, column].set(title=f"{test} test alone; dotted: the paper's {PUBLISHED[test][1]:g} m")
        axes[1, column].set(xlabel=f"${level}$, m")
        # below the panels: within them it would lie on the curves, which meet at either end
        axes[1, column].legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.2), frameon=False, ncols=4)
    axes[0, 0].set(ylabel="accuracy")
    axes[1, 0].set(ylabel="false alarms + missed")
    files.write_figure(path, figure)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(prog="spoofgym study acna", examples=EXAMPLES, description="Study windows and thresholds of ACNA.")
    add = result.add_argument
    add("--scenario", default="song-robot", help="with an odometer (default: %(default)s)")
    add("--runs", type=count, default=10, help="per pair (default: %(default)s)")
    add_seed(result, "run 0")
    add_threads(result)
    add_import(result)
    add_json(result)
    add_figure(result)
    return result


def _reports(
    scenario: str, runs: int, seed: int, num_threads: int, grids: dict[str, Rates], progress: Progress
) -> Iterator[dict[str, Any]]:
    """The ``"acna-study"`` report after each test, whose rates are put into ``grids``."""
    head = {"schema_version": SCHEMA_VERSION, "kind": "acna-study", "scenario": scenario, "runs": runs, "seed": seed}
    found: list[dict[str, Any]] = []
    for test in TESTS:
        window, level = PUBLISHED[test]
        with progress(f"{test} test"):
            grids[test] = study(scenario, test, runs, seed, num_threads)
            published = play(scenario, test, np.array([window]), np.array([level]), runs, seed, num_threads)
        found += rows(test, grids[test], published)
        yield {**head, "rows": list(found)}


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    grids: dict[str, Rates] = {}
    games = (options.runs, options.seed, options.threads)
    report = last_of(_reports(options.scenario, *games, grids, terminal.progress))
    lines = [
        f"{options.scenario}, {options.runs} runs per pair from seed {options.seed}\n",
        "| test | pair | threshold, m | accuracy | false alarms | missed |",
        "|---|---|---|---|---|---|",
        *map(_line, report["rows"]),
    ]
    give(report, "\n".join(lines), options.json, terminal, [("figure", options.figure, partial(draw, grids))])
    return 0


if __name__ == "__main__":
    sys.exit(moved("spoofgym study acna"))
