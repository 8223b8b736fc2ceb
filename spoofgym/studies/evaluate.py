"""Evaluate spoofers against a detector, defenders against populations, or every detector against every attack.

    python -m spoofgym.studies.evaluate --scenario liu-flight --detector snapshot --attacker runs/x --json out.json
    python -m spoofgym.studies.evaluate --scenario recorded:FOLDER --attack ramp:0.5 --detector snapshot --json -
    python -m spoofgym.studies.evaluate --scenario foi-drive --defender runs/d --json out.json --figure out.png
    python -m spoofgym.studies.evaluate --matrix --scenario liu-flight --arl0 10000 --json out.json --figure out.png

The baselines are always evaluated: none, random, the best constant ramp, the closed form, the optimum, and the upper
bound as a figure. Every attacker meets the same noise. A table goes to the terminal, a figure and JSON where asked;
``--json -`` prints JSON alone.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from typing import Any

from rich.console import Console, RenderableType

from spoofgym.calibration import calibrated_for_play
from spoofgym.command_line import STDOUT, Parser, above_one, add_figure, add_json, add_seed, add_threads, count, picture
from spoofgym.console import console, show
from spoofgym.detectors import make_detector
from spoofgym.detectors.base import Detector
from spoofgym.envs.opponents import make_spoofer
from spoofgym.evaluation.attackers import Evaluation
from spoofgym.evaluation.defenders import POPULATIONS, check_names, evaluate_defenders, left_out
from spoofgym.evaluation.matrix_games import ATTACKS, Matrix
from spoofgym.evaluation.recorded import evaluate_recorded
from spoofgym.evaluation.report import attackers_report, recorded_report
from spoofgym.navigation.family import FIDELITIES
from spoofgym.policies.baselines import exact_threshold
from spoofgym.policies.classical import parse
from spoofgym.policies.learned import LearnedDefender, LearnedSpoofer
from spoofgym.policies.published import policy_folder
from spoofgym.program import do_all, give_json, program
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.scenarios.recorded_family import RecordedFamily
from spoofgym.studies.defenders_presentation import defenders_figure, defenders_tables
from spoofgym.studies.matrix_presentation import curves_figure, matrix_figure, matrix_tables
from spoofgym.studies.notes import tell_what_is_new
from spoofgym.studies.presentation import attackers_figure, attackers_table, recorded_table

EPISODES = {"linear": 20_000, "strapdown": 1_000}
DEFENDER_EPISODES = 4_000
MATRIX_EPISODES = {"linear": 4_000, "strapdown": 500}
MATRIX_ARL0 = 1e4
ROC_ATTACK = "ramp:0.1"
TABLES: dict[str, Callable[[dict[str, Any]], RenderableType]] = {
    "attackers": attackers_table,
    "recorded": recorded_table,
    "defenders": defenders_tables,
    "matrix": matrix_tables,
}
FIGURES = {"attackers": attackers_figure, "defenders": defenders_figure, "matrix": matrix_figure}


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="python -m spoofgym.studies.evaluate",
        description="Evaluate spoofers against a detector, beside baselines and the exact optimum; with --defender, "
        "defenders against populations of spoofers; with --matrix, every detector against every attack.",
    )
    add = result.add_argument
    add("--scenario", default="liu-flight", help="liu-flight, kujur-flight, recorded:DIR, ... (default: %(default)s)")
    add("--detector", action="append",
        help="the monitor; repeat it for several at once (default: snapshot; with --matrix every family)")
    add("--attacker", action="append", default=[], metavar="POLICY",
        help="run folder or name of a trained spoofer; repeatable")
    add("--shadow", metavar="SPEC",
        help="scenario whose filter every attacker takes for the victim's, in place of the one it was trained with")
    add("--defender", action="append", default=[], metavar="POLICY|SPEC",
        help="run folder or name of a trained defender, or 'detector > response'; repeatable; evaluates defenders "
        "instead")
    add("--population", action="append", choices=tuple(POPULATIONS),
        help="of attacks on the defenders; repeatable (default: all)")
    add("--matrix", action="store_true",
        help="every --detector against every --attack and --attacker at an equal false-alarm rate (default: all)")
    add("--arl0", type=above_one, help="of the matrix, epochs between false alarms (default: 10000)")
    add("--roc", type=picture, metavar="FILE", help="with --matrix: draw ROC and DET curves of one attack")
    add("--roc-attack", metavar="SPEC",
        help=f"which attack of the matrix that is (default: {ROC_ATTACK}, or the first where it is not in the matrix)")
    add("--attack", action="append", default=[], metavar="SPEC",
        help="an attack, e.g. ramp:0.5 or policy:FOLDER; repeatable (default with --matrix: "
        f"{len(ATTACKS)} scripted ones and the optimal ones that fit; with a recorded log: ramp:0.5)")
    add("--fidelity", choices=FIDELITIES, help="of the simulation (default: linear; a log has strapdown only)")
    add("--episodes", type=count,
        help="games of each player (default: 20000 linear, 1000 strapdown; defenders and matrix 4000)")
    add_seed(result, "game 0")
    add_threads(result)
    add_json(result)
    add_figure(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    _show(_report(options, terminal), options, terminal)
    return 0


def _show(report: dict[str, Any], options: argparse.Namespace, terminal: Console) -> None:
    """The table, then JSON and figures where they are asked for; where one of them fails, the others are given."""
    steps: list[Callable[[], object]] = [
        lambda: show(terminal, TABLES[report["kind"]](report)),
        lambda: give_json(report, options.json),
    ]
    if options.figure is not None:
        steps.append(lambda: FIGURES[report["kind"]](report, options.figure))
    if options.roc is not None:
        attacks = list(dict.fromkeys(curve["attack"] for curve in report["curves"]))
        steps.append(lambda: curves_figure(report, _roc_attack(options.roc_attack, attacks), options.roc))
    do_all(*steps)
    for what, path in (("rows", options.json), ("figure", options.figure), ("curves", options.roc)):
        if path is not None and path != STDOUT:
            terminal.print(f"{what} in {path}", soft_wrap=True)


def _roc_attack(asked: str | None, attacks: list[str]) -> str:
    """The attack whose curves are drawn: the one asked for, else the usual one or the first of the matrix."""
    if asked is None:
        return ROC_ATTACK if ROC_ATTACK in attacks else attacks[0]
    if asked not in attacks:
        raise ValueError(f"--roc-attack {asked!r} is not in the matrix; there are: {', '.join(attacks)}")
    return asked


def _report(options: argparse.Namespace, terminal: Console) -> dict[str, Any]:
    scenario = make_scenario(options.scenario)
    fidelity = options.fidelity or scenario.fidelities[0]
    scenario.check_fidelity(fidelity)
    if options.population and not options.defender:
        raise ValueError("--population is of attacks on defenders: it goes with --defender")
    if options.shadow is not None and not options.attacker:
        raise ValueError("--shadow replaces the shadow filter of learned spoofers: it goes with --attacker")
    if not options.matrix and (options.arl0 is not None or options.roc is not None):
        raise ValueError("--arl0 and --roc are of the matrix: they go with --matrix")
    if options.matrix:
        return _matrix(options, scenario, fidelity, terminal)
    if options.defender:
        return _defenders(options, scenario, fidelity, terminal)
    given = options.detector or ["snapshot"]
    detectors = calibrated_for_play([make_detector(name) for name in given], scenario, fidelity)
    if isinstance(scenario.family, RecordedFamily):
        return _recorded(options, scenario, detectors)
    policies = [LearnedSpoofer.load(policy_folder(text)) for text in options.attacker]
    if options.shadow is not None:
        policies = [policy.with_shadow(options.shadow) for policy in policies]
    evaluation = Evaluation(
        scenario,
        tuple(given),
        detectors,
        fidelity,
        options.episodes or EPISODES[fidelity],
        options.seed,
        options.threads,
        exact_threshold(scenario, detectors),
    )
    attacks = [make_spoofer(text) for text in options.attack]
    evaluation.check_layouts(policies)
    evaluation.check_attacks(attacks)
    tell_what_is_new(policies, scenario, fidelity, detectors)
    rows = evaluation.rows(policies, attacks, terminal.status)
    return attackers_report(scenario, fidelity, detectors, rows)


def _matrix(options: argparse.Namespace, scenario: Scenario, fidelity: str, terminal: Console) -> dict[str, Any]:
    if options.defender or not scenario.random:
        raise ValueError("--matrix is of detectors and attacks in a simulated scenario: no --defender, no recorded log")
    policies = [LearnedSpoofer.load(policy_folder(text)) for text in options.attacker]
    if options.shadow is not None:
        policies = [policy.with_shadow(options.shadow) for policy in policies]
    matrix = Matrix(
        scenario,
        fidelity,
        options.arl0 or MATRIX_ARL0,
        options.episodes or MATRIX_EPISODES[fidelity],
        options.seed,
        options.threads,
    )
    if options.roc is not None:
        _roc_attack(options.roc_attack, matrix.names(options.attack, policies))
    matrix.check_knowledge(policies)
    tell_what_is_new(policies, scenario, fidelity)
    return matrix.report(options.detector or (), options.attack, policies, terminal.status)


def _defenders(options: argparse.Namespace, scenario: Scenario, fidelity: str, terminal: Console) -> dict[str, Any]:
    if options.attacker or options.attack or options.detector:
        raise ValueError("--defender is evaluated on populations: it goes without --attacker, --attack and --detector")
    policies, given = [], []
    for text in options.defender:
        if ">" in text:
            given.append(parse(text))
            continue
        try:
            folder = policy_folder(text)
        except ValueError as error:
            message = f"--defender {text!r} is neither a run folder nor 'detector > response': {error}"
            raise ValueError(message) from error
        policies.append(LearnedDefender.load(folder))
    populations = options.population or tuple(POPULATIONS)
    episodes = options.episodes or DEFENDER_EPISODES
    check_names(policies)
    tell_what_is_new(policies, scenario, fidelity)
    for line in left_out(scenario):
        terminal.print(line, markup=False, soft_wrap=True)
    return evaluate_defenders(
        scenario, fidelity, policies, given, populations, episodes, options.seed, options.threads, terminal.status
    )


def _recorded(options: argparse.Namespace, scenario: Scenario, detectors: list[Detector]) -> dict[str, Any]:
    if options.attacker:
        raise ValueError(
            "a recorded log is evaluated with --attack, e.g. policy:FOLDER; --attacker needs a simulated scenario"
        )
    if options.figure is not None:
        raise ValueError("--figure draws attackers in a simulated scenario; a recorded log gives a table and JSON")
    attacks = [make_spoofer(text) for text in options.attack or ["ramp:0.5"]]
    return recorded_report(scenario, detectors, evaluate_recorded(scenario, attacks, detectors))


if __name__ == "__main__":
    sys.exit(main())
