"""Whether thresholds that were calibrated in the linear fidelity keep their ARL₀ in the strapdown fidelity.

    spoofgym study fidelity-of-thresholds --scenario liu-flight --arl0 1e3 1e4

Each threshold is found in the linear fidelity, as games find it. Its ARL₀ is then measured in both fidelities, on clean
runs with noise of their own.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from typing import Any

from spoofgym.calibration import calibrated_all
from spoofgym.calibration.clean_statistics import joint_statistics
from spoofgym.calibration.thresholds import Calibration, measure_together
from spoofgym.command_line import STDOUT, Parser, above_one, add_import, add_json, add_seed, add_threads, count
from spoofgym.console import console
from spoofgym.detectors import at_arl0, make_detector
from spoofgym.detectors.base import Detector, require_threshold
from spoofgym.evaluation.progress import Progress, silent
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.navigation.family import FIDELITIES
from spoofgym.program import last_of, moved, program
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.studies.giving import give

EXAMPLES = (
    "spoofgym study fidelity-of-thresholds --scenario liu-flight --arl0 1e3 1e4",
)

KIND = "fidelity of thresholds"
NEEDING_SIMULATION = ("acceleration", "bias-range", "growing-window", "relative-motion")
"""They look at the run, and not only at its innovations: no white noise calibrates them."""


def rows(
    scenario: Scenario,
    detectors: Sequence[str],
    arl0s: Sequence[float],
    epochs: float,
    seed: int,
    num_threads: int,
    progress: Progress = silent,
) -> Iterator[list[dict[str, Any]]]:
    """A row for each detector and ARL₀: the linear threshold, and its ARL₀ in each fidelity.

    Detectors that look back equally far share clean runs. The rows come after each of these groups; the last time all
    are there.

    Args:
        scenario: with both fidelities.
        detectors: specifications without a threshold.
        arl0s: wanted, epochs.
        epochs: clean ones per detector and fidelity, at least.
        seed: of the clean runs.
        num_threads: that simulate.
        progress: shows what is measured.

    Raises:
        ValueError: a detector that is unknown or does not fit the scenario, or a scenario without both fidelities.
    """
    specifications = [(text, arl0) for text in detectors for arl0 in arl0s]
    ready = calibrated_all([make_detector(at_arl0(text, arl0)) for text, arl0 in specifications], scenario)
    groups: dict[int, list[int]] = {}
    for place, detector in enumerate(ready):
        groups.setdefault(detector.memory, []).append(place)
    found: dict[int, dict[str, Any]] = {}
    for places in groups.values():
        group = [ready[place] for place in places]
        with progress(", ".join(dict.fromkeys(specifications[place][0] for place in places))):
            measured = {
                fidelity: _measured(scenario, fidelity, group, epochs, seed, num_threads) for fidelity in FIDELITIES
            }
        for number, place in enumerate(places):
            text, arl0 = specifications[place]
            found[place] = {"detector": text, "asked_arl0": arl0, "threshold": ready[place].threshold}
            for fidelity, (results, seconds) in measured.items():
                found[place][fidelity] = _cells(results[number], seconds)
        yield [found[place] for place in sorted(found)]


def _measured(
    scenario: Scenario, fidelity: str, detectors: Sequence[Detector], epochs: float, seed: int, num_threads: int
) -> tuple[list[Calibration], float]:
    """ARL₀ of each detector at its threshold, and the processor time that this took, s."""
    begun = time.process_time()
    clean = joint_statistics(scenario, fidelity, num_threads)
    thresholds = [require_threshold(detector) for detector in detectors]
    results = measure_together(detectors, clean, thresholds, min_epochs=epochs, seed=seed)
    return results, time.process_time() - begun


def _cells(result: Calibration, seconds: float) -> dict[str, Any]:
    return {
        "arl0": result.arl0,
        "ci95": list(result.interval),
        "first_alarms": result.first_alarms,
        "epochs_at_risk": result.epochs_at_risk,
        "seconds": seconds,
    }


def _line(row: dict[str, Any]) -> str:
    cells = [f"{row['detector']:<28}{row['asked_arl0']:>8g}{row['threshold']:>11.5g}"]
    for fidelity in FIDELITIES:
        cell = row[fidelity]
        low, high = cell["ci95"]
        cells.append(f"  {fidelity} {cell['arl0']:.4g} [{low:.4g}, {high:.4g}] in {cell['seconds']:.0f} s")
    return "".join(cells)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym study fidelity-of-thresholds", examples=EXAMPLES,
        description="ARL0 in both fidelities of thresholds that were calibrated in the linear one.",
    )
    add = result.add_argument
    add("--scenario", default="liu-flight", help="in which they hold (default: %(default)s)")
    add("--detector", action="append", help=f"repeatable (default: {', '.join(NEEDING_SIMULATION)})")
    add("--arl0", type=above_one, nargs="+", default=[1e3], help="epochs (default: 1e3)")
    add("--epochs", type=count, default=1_000_000, help="clean ones of each fidelity (default: %(default)s)")
    add_seed(result, "the clean runs", 7)
    add_threads(result)
    add_import(result)
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    scenario = make_scenario(options.scenario)
    detectors = options.detector or NEEDING_SIMULATION
    terminal = console(stderr=options.json == STDOUT)
    games = (options.epochs, options.seed, options.threads)
    series = rows(scenario, detectors, options.arl0, *games, terminal.progress)
    head: dict[str, Any] = {"schema_version": SCHEMA_VERSION, "kind": KIND, "scenario": scenario.name}
    report = last_of({**head, "rows": found} for found in series)
    give(report, "\n".join(map(_line, report["rows"])), options.json, terminal)
    return 0


if __name__ == "__main__":
    sys.exit(moved("spoofgym study fidelity-of-thresholds"))
