"""Evaluate spoofers against a detector, beside baselines and the exact optimum.

    spoofgym evaluate spoofers --scenario liu-flight --detector snapshot --attacker runs/x --json out.json

The baselines are always evaluated: none, random, the best constant ramp, the closed form, the optimum, and the upper
bound as a figure. Every attacker meets the same noise.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from rich.console import Group

from spoofgym.attacks import ATTACKS
from spoofgym.attacks.base import Attack
from spoofgym.calibration import calibrated_for_play
from spoofgym.command_line import (
    STDOUT,
    Parser,
    add_figure,
    add_games,
    add_import,
    add_json,
    add_seed,
    add_threads,
    count,
)
from spoofgym.console import PlainConsole, console
from spoofgym.detectors import make_detector
from spoofgym.envs.opponents import make_spoofer
from spoofgym.evaluation.attackers import Evaluation
from spoofgym.evaluation.game_log import GameLog
from spoofgym.evaluation.progress import Progress
from spoofgym.evaluation.report import attackers_report
from spoofgym.navigation.family import FIDELITIES
from spoofgym.policies.baselines import exact_threshold
from spoofgym.policies.learned import LearnedSpoofer
from spoofgym.program import last_of, program
from spoofgym.scenarios import make_scenario
from spoofgym.specification import registered_by_others
from spoofgym.studies.departure_presentation import departures_tables
from spoofgym.studies.evaluate.attackers import spoofers
from spoofgym.studies.giving import Output, give
from spoofgym.studies.notes import tell_what_is_new
from spoofgym.studies.presentation import aggregates_tables, attackers_figure, attackers_table

EXAMPLES = (
    "spoofgym evaluate spoofers --attack ramp:0.2 --episodes 2000",
    "spoofgym evaluate spoofers --scenario liu-flight --detector snapshot \\",
    "  --attacker policy:liu-flight-snapshot-spoofer --figure spoofers.png",
    "spoofgym evaluate spoofers --attacker runs/x --json -",
)
EPISODES = {"linear": 20_000, "strapdown": 1_000}


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym evaluate spoofers",
        description="Evaluate spoofers against a detector, beside baselines and the exact optimum.",
        examples=EXAMPLES,
    )
    add = result.add_argument
    add("--scenario", default="liu-flight", help="liu-flight, kujur-flight, ... (default: %(default)s)")
    add("--detector", action="append", help="the monitor; repeat it for several at once (default: snapshot)")
    add("--attacker", action="append", default=[], metavar="POLICY",
        help="run folder or name of a trained spoofer; repeatable")
    add("--shadow", metavar="SPEC",
        help="scenario whose filter every attacker takes for the victim's, in place of the one it was trained with")
    add("--attack", action="append", default=[], metavar="SPEC",
        help="an attack, e.g. ramp:0.5 or policy:FOLDER; repeatable (default: your own, where --import registers any)")
    add("--fidelity", choices=FIDELITIES, help="of the simulation (default: linear)")
    add("--episodes", type=count, help="games of each player (default: 20000 linear, 1000 strapdown)")
    add_seed(result, "game 0")
    add_threads(result)
    add_import(result)
    add_json(result)
    add_figure(result)
    add_games(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    report, log = _report(options, terminal)
    outputs: list[Output] = [
        ("figure", options.figure, partial(attackers_figure, report)),
        ("games", options.games, log.write),
    ]
    vehicles = departures_tables("attacker", report["rows"], "until the first alarm")
    tables = Group(attackers_table(report), *vehicles, *aggregates_tables(report))
    give(report, tables, options.json, terminal, outputs)
    return 0


def _report(options: argparse.Namespace, terminal: PlainConsole) -> tuple[dict[str, Any], GameLog]:
    scenario = make_scenario(options.scenario)
    if not scenario.random:
        raise ValueError(f"{scenario.name} is a recorded log: spoofgym evaluate recorded FOLDER")
    fidelity = options.fidelity or scenario.fidelities[0]
    scenario.check_fidelity(fidelity)
    policies = spoofers(options.attacker, options.shadow)
    given = options.detector or ["snapshot"]
    detectors = calibrated_for_play([make_detector(name) for name in given], scenario, fidelity)
    evaluation = Evaluation(
        scenario,
        tuple(given),
        detectors,
        fidelity,
        options.episodes or EPISODES[fidelity],
        options.seed,
        options.threads,
        exact_threshold(scenario, detectors),
        GameLog(options.seed),
    )
    attacks = [make_spoofer(text) for text in options.attack or registered_by_others(ATTACKS)]
    evaluation.check_layouts(policies)
    evaluation.check_attacks(attacks)
    tell_what_is_new(policies, scenario, fidelity, detectors)
    return last_of(_reports(evaluation, policies, attacks, terminal.progress)), evaluation.log


def _reports(
    evaluation: Evaluation, policies: list[LearnedSpoofer], attacks: list[Attack], progress: Progress
) -> Iterator[dict[str, Any]]:
    """The report after every attacker that has played; the last one has all of them."""
    rows: list[dict[str, Any]] = []
    common = (evaluation.scenario, evaluation.fidelity, evaluation.detectors)
    for row in evaluation.rows(policies, attacks, progress):
        rows.append(row)
        yield {**attackers_report(*common, list(rows)), "aggregates": []}
    yield {**attackers_report(*common, rows), "aggregates": evaluation.aggregates(policies)}
