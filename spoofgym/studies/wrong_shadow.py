"""What it costs a spoofer to take the victim for another one: `spoofgym.evaluation.wrong_shadow`, as a program.

spoofgym study wrong-shadow --attacker runs/x --json out.json
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from typing import Any

from rich.table import Table

from spoofgym.calibration import calibrated_for_play
from spoofgym.command_line import STDOUT, Parser, add_import, add_json, add_seed, add_threads, count
from spoofgym.console import console
from spoofgym.detectors import make_detector
from spoofgym.evaluation.attackers import Evaluation
from spoofgym.evaluation.progress import Progress
from spoofgym.evaluation.wrong_shadow import check_policies, wrong_shadow_reports, wrong_shadows
from spoofgym.policies.baselines import exact_threshold
from spoofgym.policies.learned import LearnedSpoofer
from spoofgym.policies.published import policy_folder
from spoofgym.program import last_of, moved, program
from spoofgym.scenarios import make_scenario
from spoofgym.studies.giving import give
from spoofgym.studies.notes import tell_what_is_new
from spoofgym.studies.presentation import number

EXAMPLES = (
    "spoofgym study wrong-shadow --attacker runs/x",
    "spoofgym study wrong-shadow --episodes 500 --json out.json",
)


def wrong_shadow_table(report: dict[str, Any]) -> Table:
    """A ``"wrong-shadow"`` report for the terminal."""
    detector = report["detector"]
    table = Table(
        title=f"{report['scenario']}, {report['fidelity']}, {detector['name']}, threshold {detector['threshold']:.4g}",
        caption="error: mean undetected horizontal error with 95 % interval; exact: without simulation; of right: "
        "share of the error with the right shadow filter, on the same noise, with 95 % interval",
        box=None,
        padding=(0, 2, 0, 0),
    )
    table.add_column("attacker\n", overflow="fold")
    table.add_column("shadow\n", no_wrap=True)
    for title in ("error\nm", "exact\nm", "detected\n", "of\nright"):
        table.add_column(title, justify="right", no_wrap=True)
    for row in report["rows"]:
        fraction = "–"
        if row["fraction_of_right"] is not None:
            fraction = f"{row['fraction_of_right']:.3f} ±{_half(row['fraction_ci95']):.3f}"
        table.add_row(
            row["attacker"],
            row["shadow"],
            f"{row['mean_undetected_error_m']:.2f} ±{_half(row['ci95_m']):.2f}",
            number(row["exact_undetected_error_m"], ".2f"),
            number(row["detection_probability"], ".3f"),
            fraction,
            style="bold" if row["shadow_scenario"] is None else "",
        )
    return table


def _half(interval: list[float]) -> float:
    return 0.5 * (interval[1] - interval[0])


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym study wrong-shadow", examples=EXAMPLES,
        description="What a spoofer's score loses when its shadow filter is not the victim's.",
    )
    add = result.add_argument
    add("--scenario", default="liu-flight", help="that of the victim (default: %(default)s)")
    add("--detector", default="snapshot", help="a snapshot test (default: %(default)s)")
    add("--attacker", action="append", default=[], metavar="POLICY",
        help="run folder or name of a trained spoofer; repeatable")
    add("--episodes", type=count, default=4000, help="games of each row (default: %(default)s)")
    add_seed(result, "game 0")
    add_threads(result)
    add_import(result)
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    report = last_of(_reports(options, terminal.progress))
    give(report, wrong_shadow_table(report), options.json, terminal)
    return 0


def _reports(options: argparse.Namespace, progress: Progress) -> Iterator[dict[str, Any]]:
    scenario = make_scenario(options.scenario)
    wrong_shadows(scenario)  # refuses a scenario without them before a threshold is looked for
    detectors = calibrated_for_play([make_detector(options.detector)], scenario, "linear")
    threshold = exact_threshold(scenario, detectors)
    if threshold is None:
        raise ValueError(
            f"the optimum is known for a snapshot test on a matched filter only, not for {options.detector!r} on "
            f"{options.scenario!r}"
        )
    evaluation = Evaluation(
        scenario,
        (options.detector,),
        detectors,
        "linear",
        options.episodes,
        options.seed,
        options.threads,
        threshold,
    )
    policies = [LearnedSpoofer.load(policy_folder(text)) for text in options.attacker]
    check_policies(evaluation, policies)
    tell_what_is_new(policies, scenario, "linear", detectors)
    return wrong_shadow_reports(evaluation, threshold, policies, progress)


if __name__ == "__main__":
    sys.exit(moved("spoofgym study wrong-shadow"))
