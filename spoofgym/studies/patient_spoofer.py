"""What a reset is worth to a patient spoofer: it jumps beyond the gate, waits until the filter gives in, and drags off.

``spoofgym study patient-spoofer`` prints a table of responses, and draws the figure of the page on
responses with ``--figure FILE``.
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
from spoofgym.arrays import Floats
from spoofgym.attacks.base import Attack
from spoofgym.attacks.profiles import EAST, heading
from spoofgym.command_line import STDOUT, Parser, add_figure, add_json, add_seed, add_threads, count
from spoofgym.console import console
from spoofgym.detectors import make_detector
from spoofgym.evaluation.metrics import mean_interval
from spoofgym.evaluation.progress import Progress
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.figures import new_figure
from spoofgym.geodesy import horizontal
from spoofgym.navigation.interface import Clock
from spoofgym.program import last_of, moved, program
from spoofgym.responses import make_response
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.specification import spell
from spoofgym.studies.giving import Output, give

SCENARIO = "liu-flight:horizon=150,imu=tactical"
DETECTOR = "snapshot"
ONSET = 820.0
JUMP, PATIENCE, RATE = 100.0, 10.0, 3.0
RESPONSES = (
    "px4-auto",
    "ardupilot-glitch",
    "ardupilot-clip",
    "px4-dead-reckoning",
    "exclude-and-backtrack:20",
    "onset-depth",
)

EXAMPLES = (
    "spoofgym study patient-spoofer --runs 100 --figure patient.png",
)
DRAWN = ("px4-auto", "ardupilot-clip", "px4-dead-reckoning", "exclude-and-backtrack:20")
COLOURS = ("#c1272d", "#e08e0b", "#2a6fbb", "#2e8540")


class PatientSpoofer(Attack):
    """A jump, a wait, then a ramp along the same direction.

    Args:
        jump: m.
        patience: between the jump and the ramp, s.
        rate: of the ramp, m/s.
        direction: azimuth, degrees clockwise from north.
        onset: scenario time after which the offset jumps, s; None = the start of the game.

    Raises:
        ValueError: a value is negative or not finite.
    """

    kind = "patient-spoofer"

    def __init__(
        self,
        jump: float = JUMP,
        patience: float = PATIENCE,
        rate: float = RATE,
        direction: float = EAST,
        onset: float | None = None,
    ) -> None:
        self.jump = validation.non_negative(self.kind, "jump", jump)
        self.patience = validation.non_negative(self.kind, "patience", patience)
        self.rate = validation.non_negative(self.kind, "rate", rate)
        self.direction = validation.finite(self.kind, "direction", direction)
        self.onset = None if onset is None else validation.time(self.kind, "onset", onset)

    @property
    def name(self) -> str:
        """What it is, spelled as a specification."""
        direction = None if self.direction == EAST else self.direction
        return spell(
            self.kind, self.jump, patience=self.patience, rate=self.rate, direction=direction, onset=self.onset
        )

    def offset(self, clock: Clock) -> Floats:
        """Jump plus rate times the time since the end of the wait, (N, 3), m ENU."""
        distance = self.jump * self.started(clock) + self.rate * np.maximum(self.elapsed(clock) - self.patience, 0.0)
        return distance[:, None] * heading(self.direction)


@dataclass(frozen=True)
class Course:
    """What the runs of one response went through.

    Attributes:
        time: of the epochs after the onset, (K,), s from the onset.
        error: horizontal error of the real-time output, (n, K), m.
        used: whether the fix was used, (n, K).
        reset: whether the filter was reset to it, (n, K).
    """

    time: Floats
    error: Floats
    used: Floats
    reset: Floats


def play(response: str, runs: int, seed: int, num_threads: int = 1) -> Course:
    """Runs of the spoofer against a response; run i is seeded ``seed + i``, whatever the response."""
    scenario = make_scenario(SCENARIO)
    simulation = Simulation(
        scenario,
        PatientSpoofer(onset=ONSET),
        [make_detector(DETECTOR)],
        make_response(response),
        runs,
        seed,
        threads=num_threads,
    )
    simulation.reset()
    error, used, reset = [], [], []
    for k in range(scenario.timeline.num_epochs + 1):
        decision = simulation.decision
        simulation.resolve()
        error.append(horizontal(simulation.error))
        used.append(simulation.used.copy())
        reset.append(np.zeros(runs, dtype=bool) if decision.reset is None else decision.reset > 0.0)
        if k < scenario.timeline.num_epochs:
            simulation.observe()
    time = scenario.timeline.times - ONSET
    after = time > 0.0
    return Course(time[after], *(np.array(rows).T[:, after] for rows in (error, used, reset)))


def row(response: str, course: Course) -> dict[str, Any]:
    """What came of a response, in figures."""
    final, taken = course.error[:, -1], course.reset.any(axis=1)
    return {
        "response": response,
        "final_error_m": float(final.mean()),
        "ci95_m": list(mean_interval(final)),
        "largest_error_m": float(course.error.max(axis=1).mean()),
        "reset_share": float(taken.mean()),
        "median_reset_s": float(np.median(course.time[course.reset[taken].argmax(axis=1)])) if taken.any() else None,
        "used_share": float(course.used.mean()),
    }


def _line(row: dict[str, Any]) -> str:
    (low, high), when = row["ci95_m"], row["median_reset_s"]
    return (
        f"| `{row['response']}` | {row['final_error_m']:.1f} [{low:.1f}, {high:.1f}] | {row['largest_error_m']:.1f} "
        f"| {100.0 * row['reset_share']:.0f} % | {'-' if when is None else f'{when:.0f} s'} "
        f"| {100.0 * row['used_share']:.0f} % |"
    )


def draw(courses: dict[str, Course], path: Path) -> None:
    """The median error and the middle 90 % of the runs over time, of the responses in `DRAWN`; a logarithmic axis.

    Raises:
        ImportError: matplotlib is missing.
    """
    figure = new_figure(8.0, 4.4, dpi=150, layout="constrained")
    axes = figure.add_subplot()
    time = next(iter(courses.values())).time
    offset = JUMP + RATE * np.maximum(time - PATIENCE, 0.0)
    axes.plot(time, offset, color="black", linestyle=":", linewidth=1.4, label="offset of the spoofer")
    for name, colour in zip(DRAWN, COLOURS, strict=True):
        low, middle, high = np.quantile(courses[name].error, (0.05, 0.5, 0.95), axis=0)
        axes.fill_between(time, low, high, color=colour, alpha=0.18, linewidth=0.0)
        axes.plot(time, middle, color=colour, linewidth=1.8, label=name)
    axes.axvline(PATIENCE, color="grey", linewidth=0.8)
    axes.text(PATIENCE + 1.0, 0.35, "drag-off begins", color="grey", fontsize=8)
    axes.set(xlabel="time since the jump, s", ylabel="horizontal error, m", yscale="log")
    axes.set(xlim=(0.0, time[-1]), ylim=(0.25, 1000.0))
    axes.grid(alpha=0.25)
    axes.legend(loc="lower right", fontsize=8, framealpha=0.95)
    files.write_figure(path, figure)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym study patient-spoofer",
        description="Play a patient spoofer against responses.",
        examples=EXAMPLES,
    )
    result.add_argument("--runs", type=count, default=400, help="per response (default: %(default)s)")
    add_seed(result, "run 0")
    add_threads(result)
    add_json(result)
    add_figure(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    courses: dict[str, Course] = {}
    report = last_of(_reports(options, courses, terminal.progress))
    lines = [
        f"{report['attack']} on {report['scenario']}, {report['runs']} runs from seed {report['seed']}\n",
        "| response | final error, m | greatest error, m | reset | first reset | spoofed fixes used |",
        "|---|---|---|---|---|---|",
        *map(_line, report["rows"]),
    ]
    outputs: list[Output] = [("figure", options.figure, partial(draw, courses))]
    give(report, "\n".join(lines), options.json, terminal, outputs)
    return 0


def _reports(options: argparse.Namespace, courses: dict[str, Course], progress: Progress) -> Iterator[dict[str, Any]]:
    """The ``"patient-spoofer"`` report after each response, whose runs are put into ``courses``."""
    head = {
        "schema_version": SCHEMA_VERSION,
        "kind": "patient-spoofer",
        "scenario": SCENARIO,
        "attack": PatientSpoofer(onset=ONSET).name,
        "runs": options.runs,
        "seed": options.seed,
    }
    for response in RESPONSES:
        with progress(response):
            courses[response] = play(response, options.runs, options.seed, options.threads)
        yield {**head, "rows": [row(name, course) for name, course in courses.items()]}


if __name__ == "__main__":
    sys.exit(moved("spoofgym study patient-spoofer"))
