"""Epochs of the tightly coupled filter per second and core, and what the bank of separation windows costs beside it.

    python -m benchmarks.tight                # a table
    python -m benchmarks.tight --json -       # JSON to stdout

Measure on an idle machine. Code and carrier of the satellites in view of the Kujur flight, one thread. An epoch of the
filter is time update, innovation and measurement update. The bank is timed in turn with the filter that it watches, in
one process, and the ratio of the medians counts.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from spoofgym.command_line import STDOUT, Parser, add_json
from spoofgym.detectors import make_detector
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.navigation.interface import Demands
from spoofgym.program import give_json, program
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation

RUNS = {"linear": 64, "strapdown": 8}
EPOCHS = 120
SCENARIO = "kujur-flight:horizon=480"
WINDOWS = (60, 360)


def filter_row(fidelity: str, demands: Demands, gains: str) -> dict[str, Any]:
    """Epochs per second of one core: the median over the epochs after a warm-up."""
    runs = RUNS[fidelity]
    simulation = Simulation(make_scenario(SCENARIO), None, (), None, runs, 0, fidelity=fidelity, demands=demands)
    simulation.reset()
    navigator, nothing = simulation.navigator, np.zeros((runs, simulation.scenario.dimension))
    spent = []
    for _ in range(EPOCHS):
        begin = time.perf_counter()
        navigator.resolve(simulation.decision)
        navigator.propagate()
        navigator.innovate(nothing)
        spent.append(time.perf_counter() - begin)
    scenario = simulation.scenario
    return {
        "what": "filter",
        "fidelity": fidelity,
        "gains": gains,
        "satellites": scenario.slots,
        "states": scenario.tight_model().dynamics.num_states,
        "epochs_per_second": runs / float(np.median(spent[EPOCHS // 4 :])),
    }


def bank_row(n: int, demands: Demands, gains: str) -> dict[str, Any]:
    """Cost of a bank whose windows are all open, in epochs of the filter."""
    runs = RUNS["linear"]
    detector = make_detector(f"separation-bank:n={n}")
    simulation = Simulation(make_scenario(SCENARIO), None, (), None, runs, 0, demands=demands | detector.demands)
    watching = Simulation(make_scenario(SCENARIO), None, [detector], None, runs, 0, demands=demands)
    watching.reset()
    simulation.reset()
    navigator, nothing = simulation.navigator, np.zeros((runs, simulation.scenario.dimension))
    bank = watching.detectors[detector.name]
    filter_seconds, bank_seconds = [], []
    for k in range(n + EPOCHS - 20):
        watching.resolve()
        epoch = _observe_without(watching)
        begin = time.perf_counter()
        bank.update(epoch)
        middle = time.perf_counter()
        navigator.resolve(simulation.decision)
        navigator.propagate()
        navigator.innovate(nothing)
        if k >= n:
            bank_seconds.append(middle - begin)
            filter_seconds.append(time.perf_counter() - middle)
    step, spent = float(np.median(filter_seconds)), float(np.median(bank_seconds))
    return {"what": "bank", "windows": n, "gains": gains, "microseconds": 1e6 * spent / runs, "filters": spent / step}


def _observe_without(simulation: Simulation) -> Any:
    """The next epoch, before the detector has seen it."""
    detectors, simulation.detectors = simulation.detectors, {}
    epoch = simulation.observe()
    simulation.detectors = detectors
    return epoch


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Print the rows."""
    parser = Parser(prog="python -m benchmarks.tight", description=main.__doc__)
    add_json(parser)
    options = parser.parse_args(arguments)
    out = sys.stderr if options.json == STDOUT else sys.stdout
    rows = []
    shared, own = (Demands(), "shared"), (Demands(excludes=True), "own")
    for fidelity, (demands, gains) in (("linear", shared), ("linear", own), ("strapdown", own)):
        row = filter_row(fidelity, demands, gains)
        rows.append(row)
        print(
            f"filter  {fidelity:<10}{gains:<7}{row['satellites']} satellites  {row['states']} states"
            f"{row['epochs_per_second']:>12,.0f} epochs/s",
            file=out,
            flush=True,
        )
    for n in WINDOWS:
        for demands, gains in (shared, own):
            row = bank_row(n, demands, gains)
            rows.append(row)
            print(
                f"bank    {n:>3} windows  {gains:<7}{row['microseconds']:>8.1f} us per epoch and run = "
                f"{row['filters']:.2f} epochs of the filter",
                file=out,
                flush=True,
            )
    report = {"schema_version": SCHEMA_VERSION, "rows": rows}
    give_json(report, options.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
