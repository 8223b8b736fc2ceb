"""What detectors cost, in steps of a filter with a covariance per run (propagate, innovate, update).

    python -m benchmarks.detectors                # a table
    python -m benchmarks.detectors --json -       # JSON to stdout

Measure on an idle machine. Each detector sees the same epochs of 1024 runs of the Liu flight; filter and detectors are
timed in turn, in one process, and the ratio of the medians counts. Two detectors have rows of their own and are left
out of the sum: solution separation and the ramp bank, whose work grows with their window.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from spoofgym.command_line import STDOUT, Parser, add_json
from spoofgym.detectors import DETECTORS, make_detector
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.navigation.interface import Decision, Demands
from spoofgym.program import give_json, program
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

SCENARIO = "liu-flight"
RUNS = 1024
ROUNDS = 5
BY_THEMSELVES = ("solution-separation", "ramp-bank")
UNION = "ensemble"


def measure(names: list[str]) -> list[dict[str, Any]]:
    """Microseconds of each detector's update and of the filter's step, medians over the epochs of several games."""
    scenario = make_scenario(SCENARIO)
    detectors = [make_detector(name) for name in names]
    demands = Demands(excludes=True)
    for detector in detectors:
        demands |= detector.demands
    simulation, timed = (Simulation(scenario, None, (), None, RUNS, 0, demands=demands) for _ in range(2))
    filter_times: list[float] = []
    times: list[list[float]] = [[] for _ in detectors]
    for _ in range(ROUNDS):
        for detector in detectors:
            detector.bind(RUNS, scenario.dimension)
            detector.know(scenario.facts)
        simulation.reset()
        timed.reset()
        for _ in range(scenario.timeline.num_epochs):
            filter_times.append(_seconds(partial(_filter_step, timed)))
            simulation.resolve()
            epoch = simulation.observe()
            for place, detector in enumerate(detectors):
                times[place].append(_seconds(partial(detector.update, epoch)))
    step = float(np.median(filter_times)) * 1e6
    rows = [_row("filter step", step, step)]
    rows += [_row(name, float(np.median(spent)) * 1e6, step) for name, spent in zip(names, times, strict=True)]
    total = sum(row["microseconds"] for row in rows[1:] if row["what"].split(":")[0] not in BY_THEMSELVES)
    return [*rows, _row("all but those two", total, step)]


def _filter_step(simulation: Simulation) -> None:
    """One epoch of the navigator alone, every fix used."""
    navigator = simulation.navigator
    navigator.resolve(Decision(np.ones(RUNS, dtype=bool)))
    navigator.propagate()
    navigator.innovate(np.zeros((RUNS, 3)))


def _seconds(call: Callable[[], object]) -> float:
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def _row(what: str, microseconds: float, step: float) -> dict[str, Any]:
    return {"what": what, "runs": RUNS, "microseconds": microseconds, "filter_steps": microseconds / step}


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Print the rows."""
    parser = Parser(prog="python -m benchmarks.detectors", description=main.__doc__)
    add_json(parser)
    options = parser.parse_args(arguments)
    offers = set(make_scenario(SCENARIO).offers)
    rows = measure([name for name in DETECTORS if name != UNION and set(make_detector(name).needs) <= offers])
    for row in rows:
        print(
            f"{row['what']:<24}{row['microseconds']:>9.0f} µs{row['filter_steps']:>8.3f} filter steps",
            file=sys.stderr if options.json == STDOUT else sys.stdout,
        )
    report = {"schema_version": SCHEMA_VERSION, "rows": rows}
    give_json(report, options.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
