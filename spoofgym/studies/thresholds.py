"""Thresholds of detectors in a scenario, at several average run lengths between false alarms.

    spoofgym thresholds --scenario liu-flight --arl0 1e3 1e4 1e5
    spoofgym thresholds --detector cusum --detector ewma --json -

A threshold that theory gives has an ARL₀ without an interval. What was found is kept on disk (`calibration_cache`).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from typing import Any

from spoofgym.calibration import calibrated_for_play
from spoofgym.command_line import STDOUT, Parser, above_one, add_import, add_json, share_of_alarms
from spoofgym.console import console
from spoofgym.detectors import DETECTORS, at_arl0, make_detector
from spoofgym.detectors.base import Detector
from spoofgym.evaluation.progress import Progress, silent
from spoofgym.evaluation.recorded_matrix import those_with_thresholds
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.program import last_of, moved, program, say
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.clean_scene import clean_scene
from spoofgym.studies.giving import give

EXAMPLES = (
    "spoofgym thresholds --scenario liu-flight --arl0 1e3 1e4 1e5",
    "spoofgym thresholds --detector cusum --detector ewma --json -",
    "spoofgym thresholds --scenario recorded:FOLDER --p-fa 0.1 0.01",
)

DEFAULT_ARL0S = (1e3, 1e4, 1e5)
DEFAULT_SHARES = (0.1, 0.01)


def threshold_rows(
    scenario: Scenario, detectors: Sequence[str], arl0s: Sequence[float], progress: Progress = silent
) -> Iterator[list[dict[str, Any]]]:
    """A row for each detector and ARL₀, after every ARL₀.

    Args:
        scenario: in which thresholds hold.
        detectors: specifications without a threshold.
        arl0s: wanted, epochs.
        progress: shows what is looked for.

    Raises:
        ValueError: a detector that is unknown or does not fit the scenario, or an ARL₀ that is not greater than 1.
    """
    rows: list[dict[str, Any]] = []
    for arl0 in arl0s:
        with progress(f"thresholds at ARL0 {arl0:g}"):
            asked = [make_detector(at_arl0(text, arl0)) for text in detectors]
            ready = calibrated_for_play(asked, scenario, scenario.fidelities[0])
        for text, detector in zip(detectors, ready, strict=True):
            rows.append(_row(text, arl0, detector))
        yield sorted(rows, key=lambda row: detectors.index(row["detector"]))


def log_rows(
    log: Scenario, detectors: Sequence[str], shares: Sequence[float], progress: Progress = silent
) -> Iterator[list[dict[str, Any]]]:
    """A row for each detector and share of alarms in the clean game of a log, after every share.

    Args:
        log: recorded.
        detectors: specifications.
        shares: wanted, per epoch.
        progress: shows what is looked for.

    Raises:
        ValueError: a detector that is unknown or does not fit the log, or a log too short for a share.
    """
    made = {detector.name: text for text, detector in ((text, make_detector(text)) for text in detectors)}
    rows: list[dict[str, Any]] = []
    clean = clean_scene(log)
    for share in shares:
        with progress(f"thresholds at a share of {share:g}"):
            ready, refused = those_with_thresholds([clean], [make_detector(text) for text in detectors], share)
        for reason in refused.values():
            say(f"left out: {reason}")
        for detector in ready:
            row = _row(made[detector.name], None, detector)
            rows.append({**row, "false_alarm_probability": share, "from": "the clean log"})
        yield sorted(rows, key=lambda row: detectors.index(row["detector"]))


def _row(text: str, arl0: float | None, detector: Detector) -> dict[str, Any]:
    interval = detector.arl0_interval
    return {
        "detector": text,
        "asked_arl0": arl0,
        "threshold": detector.threshold,
        "arl0": detector.arl0,
        "ci95": None if interval is None else list(interval),
        "from": "clean runs" if detector.calibrated else "theory or a preset",
    }


def _line(row: dict[str, Any]) -> str:
    if row["asked_arl0"] is None:
        return f"{row['detector']:<28}{row['false_alarm_probability']:>10g}{row['threshold']:>12.5g}  (the clean log)"
    interval = "" if row["ci95"] is None else f"  95 % [{row['ci95'][0]:.4g}, {row['ci95'][1]:.4g}]"
    reached = "unknown" if row["arl0"] is None else f"{row['arl0']:.4g}"
    given = f"{row['detector']:<28}{row['asked_arl0']:>10g}{row['threshold']:>12.5g}"
    return f"{given}  ARL0 {reached}{interval}  ({row['from']})"


def fitting(scenario: Scenario) -> list[str]:
    """The detectors that ask for nothing but what the scenario offers, by their names."""
    return [name for name in DETECTORS if set(make_detector(name).needs) <= set(scenario.offers)]


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym thresholds", examples=EXAMPLES,
        description="Thresholds of detectors at several average run lengths between false alarms.",
    )
    add = result.add_argument
    add("--scenario", default="liu-flight", help="in which they hold (default: %(default)s)")
    add("--detector", action="append", help="repeatable (default: every family that fits the scenario)")
    add("--arl0", type=above_one, nargs="+", help="epochs (default: 1e3 1e4 1e5)")
    add("--p-fa", type=share_of_alarms, nargs="+", metavar="P",
        help="of a recorded log: share of alarms in its clean epochs (default: 0.1 0.01)")
    add_import(result)
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    scenario = make_scenario(options.scenario)
    names = options.detector or fitting(scenario)
    if not scenario.random and not options.detector:
        names = [name for name in names if not make_detector(name).members]
    if scenario.random:
        if options.p_fa is not None:
            raise ValueError("--p-fa is of recorded logs; thresholds in a simulated scenario have an --arl0")
        series = threshold_rows(scenario, names, options.arl0 or DEFAULT_ARL0S, terminal.progress)
    else:
        if options.arl0 is not None:
            raise ValueError("--arl0 is of simulated scenarios; thresholds on a recorded log have a --p-fa")
        series = log_rows(scenario, names, options.p_fa or DEFAULT_SHARES, terminal.progress)
    head: dict[str, Any] = {"schema_version": SCHEMA_VERSION, "kind": "thresholds", "scenario": scenario.name}
    report = last_of({**head, "rows": rows} for rows in series)
    give(report, "\n".join(map(_line, report["rows"])), options.json, terminal)
    return 0


if __name__ == "__main__":
    sys.exit(moved("spoofgym thresholds"))
