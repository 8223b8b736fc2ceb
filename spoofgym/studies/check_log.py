"""Checks a recorded log: what contradicts itself in its files, and whether a filter on it keeps its own covariance."""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from spoofgym.command_line import STDOUT, Parser, add_json
from spoofgym.logs.checks.check import all_findings
from spoofgym.logs.checks.finding import Finding
from spoofgym.logs.checks.resting import is_resting
from spoofgym.logs.log_warning import LogWarning
from spoofgym.program import USAGE, do_all, give_json, moved, program
from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.recorded_family import SETTLING, recorded_family
from spoofgym.scenarios.recorded_resting import SIMULATED

EXAMPLES = ("spoofgym check-log runs/flight", "spoofgym check-log runs/flight --json runs/faults.json")
GRADE = "tactical"
"""Of the IMU that is simulated where an antenna rests and the log has none."""
CAUTIOUS = 0.3
"""NIS per degree of freedom below which a chi-square test at its nominal threshold hardly sees anything."""
FILTER = "clean run"
"""What the findings of the filter are about."""


def check_log(folder: str) -> dict[str, Any]:
    """What is wrong with a log, as a report.

    Args:
        folder: of the log; no comma in it.

    Returns:
        ``log``; ``findings``, a list of severity, file, line, text and advice; ``clean``, figures of the filter on the
        log as it is, or None where it cannot run: aligned_at_s, epochs, mean_nis, nis_per_degree.
    """
    findings = all_findings(folder)
    clean = None
    if not any(finding.severity == "error" for finding in findings):
        clean, more = _clean_run(folder)
        known = {finding.text for finding in findings}
        findings += [finding for finding in more if finding.text not in known]
    return {"log": folder, "findings": [_row(finding) for finding in findings], "clean": clean}


def _row(finding: Finding) -> dict[str, Any]:
    return {**vars(finding), "told": str(finding)}


def _imu(folder: str) -> str:
    """The option of a log that has no IMU."""
    return f",imu={SIMULATED}:{GRADE}" if is_resting(Path(folder)) else ""


def _clean_run(folder: str) -> tuple[dict[str, Any] | None, list[Finding]]:
    """Figures of the filter on a log without an attack, and what it warns of or why it cannot run."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            family = recorded_family(make_scenario(f"recorded:{folder}{_imu(folder)}"))
            run, first = family.clean, int(np.searchsorted(family.epoch_time, family.align_time + SETTLING))
            first = first if first < len(family.epoch_time) else 0
            clean = {
                "alignment": family.alignment.told(family.log),
                "aligned_at_s": family.align_time,
                "epochs": len(family.epoch_time),
                "mean_nis": float(np.mean(run.nis[first:])),
                "nis_per_degree": float(run.nis_per_degree(first)),
            }
            failure = []
        except ValueError as error:
            clean, failure = None, [Finding("error", FILTER, str(error))]
    seen = [str(each.message) for each in told if each.category is LogWarning]
    return clean, failure + [Finding("warning", FILTER, text) for text in seen if "innovations" in text]


def lines(report: dict[str, Any]) -> list[str]:
    """The report for people."""
    result = [f"{row['severity']}: {row['told']}" for row in report["findings"]]
    clean = report["clean"]
    if clean is not None:
        nis = f"mean NIS {clean['mean_nis']:.3g}, {clean['nis_per_degree']:.3g} per degree of freedom"
        if clean["nis_per_degree"] < CAUTIOUS:
            nis += f", where 1 is right: chi-square tests are nearly deaf; see spoofgym estimate-noise {report['log']}"
        result += [clean["alignment"], f"{FILTER}: {clean['epochs']} epochs, {nis}"]
    errors, warned = (sum(row["severity"] == kind for row in report["findings"]) for kind in ("error", "warning"))
    told = f"{_count(errors, 'error')}, {_count(warned, 'warning')}" if errors or warned else "nothing contradicts it"
    return [*result, f"{report['log']}: {told}"]


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym check-log",
        description="Check a recorded log: units, axes, signs, clocks and holes, and run the filter on it.",
        examples=EXAMPLES,
    )
    result.add_argument("folder", metavar="FOLDER", help="of the log")
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status: 2 where the log has an error."""
    options = parser().parse_args(arguments)
    report = check_log(options.folder)
    out = sys.stderr if options.json == STDOUT else sys.stdout
    do_all(lambda: print("\n".join(lines(report)), file=out), lambda: give_json(report, options.json))
    return USAGE if any(row["severity"] == "error" for row in report["findings"]) else 0


if __name__ == "__main__":
    sys.exit(moved("spoofgym check-log"))
