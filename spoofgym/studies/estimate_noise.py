"""Estimates the noises of a recorded log from the innovations of its filter, on a clean stretch.

    spoofgym estimate-noise FOLDER -o FOLDER/noise.toml

prints what was estimated and what ran into a bound, and writes a file that ``recorded:FOLDER,noise=estimated`` reads.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from spoofgym import files
from spoofgym.command_line import STDOUT, Parser, add_json
from spoofgym.console import console
from spoofgym.evaluation.noise.estimate import Estimate, clean_stretch, estimate_on, log_of_fixes
from spoofgym.evaluation.noise.report import estimate_report
from spoofgym.logs.log_noise import write_noise
from spoofgym.program import moved, program
from spoofgym.studies.evaluate.recorded import recorded_log
from spoofgym.studies.giving import Output, give
from spoofgym.studies.import_log import moment

EXAMPLES = (
    "spoofgym estimate-noise FOLDER",
    "spoofgym estimate-noise FOLDER -o FOLDER/noise.toml",
    "spoofgym estimate-noise FOLDER,velocity=false --end 150 --json -",
)
BOUNDS = {"least": "lower bound", "most": "upper bound", "undetermined": "not told"}


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym estimate-noise",
        description="Estimate process and measurement noise of a log on a clean stretch, by its innovations.",
        examples=EXAMPLES,
    )
    result.add_argument("log", metavar="FOLDER", help="of the log, and options after it: FOLDER,grade=tactical")
    begin = "first moment of the stretch, on the clock of the fixes (default: 30 s after the alignment)"
    result.add_argument("--begin", type=moment, metavar="S", help=begin)
    result.add_argument("--end", type=moment, metavar="S", help="last moment of it (default: the end of the log)")
    result.add_argument("-o", "--out", type=Path, metavar="FILE", help="write the noises (default: print them only)")
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    if options.out is not None:
        files.check_file(options.out)
    terminal = console(stderr=options.json == STDOUT)
    log = log_of_fixes(recorded_log(options.log))
    stretch = clean_stretch(log, options.begin, options.end)
    with terminal.progress(f"{log.name}: noises"):
        estimate = estimate_on(log, stretch)
    report = estimate_report(log, estimate)
    content = write_noise(estimate.noise, _found(log.log.folder, estimate))
    outputs: list[Output] = [("noises", options.out, lambda path: files.write_text(path, content))]
    give(report, noise_table(report), options.json, terminal, outputs)
    return 0


def _found(folder: Path, estimate: Estimate) -> dict[str, str | float]:
    at_bound = [each.name for each, bound in zip(estimate.asked, estimate.bound, strict=True) if bound]
    return {
        "log": folder.name,
        "begin_s": estimate.begin,
        "end_s": estimate.end,
        "fixes": estimate.epochs,
        "at_a_bound": ", ".join(at_bound),
    }


def noise_table(report: dict[str, Any]) -> Table:
    """A ``"noise-estimate"`` report for the terminal."""
    end = "" if report["converged"] else "; the search did NOT end by itself"
    title = f"{report['log']}: {report['epochs']} fixes, {report['begin_s']:.10g} to {report['end_s']:.10g} s"
    notes = "lower and upper bound: it ran into one; not told: the stretch does not tell it"
    caption = f"log-likelihood {report['log_likelihood_gain']:.0f} higher than before{end}; {notes}"
    table = Table(title=title, caption=caption, box=None)
    for heading in ("noise", "before", "now", "95 % interval", "unit", ""):
        table.add_column(heading, justify="right" if heading in ("before", "now", "95 % interval") else "left")
    for row in report["noises"]:
        sure = row["interval"] is not None and not row["note"]
        low, high = row["interval"] if sure else (0.0, 0.0)
        interval = f"{low:.3g} to {high:.3g}" if sure else "-"
        note = BOUNDS.get(row["note"], "")
        table.add_row(row["name"], f"{row['before']:.3g}", f"{row['value']:.3g}", interval, row["unit"], note)
    return table


if __name__ == "__main__":
    sys.exit(moved("spoofgym estimate-noise"))
