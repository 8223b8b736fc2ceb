"""Evaluate detectors and attacks on a recorded log: the clean filter, and what each attack does to it.

spoofgym evaluate recorded FOLDER --attack ramp:0.5 --detector snapshot --json -
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from rich.console import Group

from spoofgym.attacks.base import Attack
from spoofgym.calibration import calibrated_for_play
from spoofgym.command_line import STDOUT, Parser, add_figure, add_import, add_json, add_seed, share_of_alarms
from spoofgym.console import console
from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.envs.opponents import make_spoofer
from spoofgym.evaluation.progress import Progress
from spoofgym.evaluation.recorded import recorded_rows
from spoofgym.evaluation.recorded_matrix import at_false_alarm_probability
from spoofgym.evaluation.report import recorded_report
from spoofgym.program import last_of, program
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.clean_scene import clean_scene
from spoofgym.scenarios.recorded_family import recorded_family
from spoofgym.specification import Specification
from spoofgym.studies.departure_presentation import departures_tables
from spoofgym.studies.giving import Output, give
from spoofgym.studies.presentation import recorded_figure, recorded_table

EXAMPLES = (
    "spoofgym evaluate recorded FOLDER --attack ramp:0.5 --detector snapshot",
    "spoofgym evaluate recorded FOLDER --detector mewma --p-fa 0.01 --figure a.png",
    "spoofgym evaluate recorded FOLDER,noise_factor=3 --attack jump:20 --json -",
)
RECORDED = "recorded"


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym evaluate recorded",
        description="Evaluate detectors and attacks on a recorded log, with the strapdown filter.",
        examples=EXAMPLES,
    )
    add = result.add_argument
    add("log", metavar="FOLDER", help="of the log, and options after it: FOLDER,noise_factor=3")
    add("--detector", action="append", help="the monitor; repeat it for several at once (default: snapshot)")
    add("--attack", action="append", metavar="SPEC",
        help="an attack, e.g. ramp:0.5 or policy:FOLDER; repeatable (default: ramp:0.5, or the log's own)")
    add("--p-fa", type=share_of_alarms, metavar="P",
        help="set every threshold to this share of alarms in the clean log, per epoch (default: as the detector says)")
    add_seed(result, "what an attack draws; nothing else on a log is drawn")
    add_import(result)
    add_json(result)
    add_figure(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    report = _report(options, terminal.progress)
    outputs: list[Output] = [("figure", options.figure, partial(recorded_figure, report))]
    tables = Group(recorded_table(report), *departures_tables("attack", report["rows"], "to the end of the log"))
    give(report, tables, options.json, terminal, outputs)
    return 0


def recorded_log(text: str) -> Scenario:
    """The log that a text names: its folder and options, or a specification ``recorded:...``.

    Raises:
        ValueError: there is none, or it cannot be used.
    """
    return make_scenario(text if text.startswith(f"{RECORDED}:") else f"{RECORDED}:{text}")


def _attacked(scenario: Scenario, attacks: Sequence[str]) -> Scenario:
    """The scenario with ``attack=recorded`` where its own ranges are spoofed and that attack is asked for."""
    family = recorded_family(scenario)
    if RECORDED not in attacks or family.attacked or not family.spoofed_within:
        return scenario
    given = Specification.parse(scenario.name)
    return make_scenario(str(replace(given, options={**given.options, "attack": RECORDED})))


def _report(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    scenario = _attacked(recorded_log(options.log), options.attack or [])
    usual = RECORDED if recorded_family(scenario).attacked else "ramp:0.5"
    detectors = [make_detector(name) for name in options.detector or ["snapshot"]]
    if options.p_fa is not None:
        ready = at_false_alarm_probability([clean_scene(scenario)], detectors, options.p_fa)
    else:
        ready = calibrated_for_play(detectors, scenario, scenario.fidelities[0])
    attacks = [make_spoofer(text) for text in options.attack or [usual]]
    return last_of(_reports(scenario, attacks, ready, options.seed, progress))


def _reports(
    scenario: Scenario, attacks: Sequence[Attack], detectors: list[Detector], seed: int, progress: Progress
) -> Iterator[dict[str, Any]]:
    """The report after every attack."""
    rows: list[dict[str, Any]] = []
    played = recorded_rows(scenario, attacks, detectors, seed)
    for attack in attacks:
        with progress(attack.name):
            rows.append(next(played))
        yield recorded_report(scenario, detectors, list(rows))
