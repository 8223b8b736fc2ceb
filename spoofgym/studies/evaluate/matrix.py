"""Play every attack against every detector, all of them at an equal false-alarm rate.

spoofgym matrix --scenario liu-flight --arl0 10000 --json out.json --figure out.png --roc roc.png
"""

from __future__ import annotations

import argparse
import copy
from collections.abc import Sequence
from functools import partial
from typing import Any

from spoofgym.attacks.base import Attack
from spoofgym.command_line import (
    STDOUT,
    Parser,
    above_one,
    add_figure,
    add_import,
    add_json,
    add_seed,
    add_threads,
    count,
    picture,
    share_of_alarms,
)
from spoofgym.console import PlainConsole, console
from spoofgym.detectors import make_detector
from spoofgym.envs.opponents import make_spoofer
from spoofgym.evaluation.matrix_games import ATTACKS, DETECTORS, Matrix
from spoofgym.evaluation.recorded_matrix import GAMES, recorded_matrices
from spoofgym.navigation.family import FIDELITIES
from spoofgym.policies.published import POLICY
from spoofgym.program import last_of, program
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.simulation import Simulation
from spoofgym.studies.evaluate.attackers import spoofers
from spoofgym.studies.giving import give
from spoofgym.studies.matrix_presentation import curves_figure, matrix_figure, matrix_tables
from spoofgym.studies.notes import tell_what_is_new

EXAMPLES = (
    "spoofgym matrix --scenario liu-flight --figure matrix.png",
    "spoofgym matrix --scenario recorded:FOLDER --p-fa 0.01",
    "spoofgym matrix --detector snapshot --detector cusum --attack ramp:0.2 \\",
    "  --attack jump:20 --episodes 500 --roc roc.png",
)
EPISODES = {"linear": 4_000, "strapdown": 500}
ARL0 = 1e4
P_FA = 0.01
ROC_ATTACK = "ramp:0.1"


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym matrix",
        description="Play every attack against every detector, all detectors at an equal false-alarm rate.",
        examples=EXAMPLES,
    )
    add = result.add_argument
    add("--scenario", default="liu-flight", help="what is driven or flown (default: %(default)s)")
    add("--detector", action="append", help="of the matrix; repeatable (default: every family)")
    add("--attack", action="append", default=[], metavar="SPEC",
        help=f"of the matrix; repeatable (default: {len(ATTACKS)} scripted ones and the optimal ones that fit)")
    add("--attacker", action="append", default=[], metavar="POLICY",
        help="run folder or name of a trained spoofer; repeatable")
    add("--shadow", metavar="SPEC",
        help="scenario whose filter every attacker takes for the victim's, in place of the one it was trained with")
    add("--arl0", type=above_one, help=f"epochs between false alarms (default: {ARL0:g})")
    add("--p-fa", type=share_of_alarms, metavar="P",
        help=f"of a recorded log: share of alarms in its clean epochs (default: {P_FA:g})")
    add("--roc", type=picture, metavar="FILE", help="draw ROC and DET curves of one attack")
    add("--roc-attack", metavar="SPEC",
        help=f"which attack of the matrix that is (default: {ROC_ATTACK}, or the first where it is not in the matrix)")
    add("--fidelity", choices=FIDELITIES, help="of the simulation (default: linear)")
    add("--episodes", type=count,
        help=f"games of each attack (default: 4000 linear, 500 strapdown, {GAMES} along a recorded log)")
    add_seed(result, "game 0")
    add_threads(result)
    add_import(result)
    add_json(result)
    add_figure(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    report = _report(options, terminal)
    figures = [
        ("figure", options.figure, partial(matrix_figure, report)),
        ("curves", options.roc, partial(_curves, report, options.roc_attack)),
    ]
    give(report, matrix_tables(report), options.json, terminal, figures)
    return 0


def _curves(report: dict[str, Any], asked: str | None, path: Any) -> None:
    attacks = list(dict.fromkeys(curve["attack"] for curve in report["curves"]))
    curves_figure(report, _roc_attack(asked, attacks), path)


def _roc_attack(asked: str | None, attacks: list[str]) -> str:
    """The attack whose curves are drawn: the one asked for, else the usual one or the first of the matrix."""
    if asked is None:
        return ROC_ATTACK if ROC_ATTACK in attacks else attacks[0]
    if asked not in attacks:
        raise ValueError(f"--roc-attack {asked!r} is not in the matrix; there are: {', '.join(attacks)}")
    return asked


def _report(options: argparse.Namespace, terminal: PlainConsole) -> dict[str, Any]:
    scenario = make_scenario(options.scenario)
    if not scenario.random:
        return _of_log(options, scenario, terminal)
    if options.p_fa is not None:
        raise ValueError("--p-fa is of recorded logs; detectors in a simulated scenario have a common --arl0")
    fidelity = options.fidelity or scenario.fidelities[0]
    scenario.check_fidelity(fidelity)
    policies = spoofers(options.attacker, options.shadow)
    episodes = options.episodes or EPISODES[fidelity]
    matrix = Matrix(scenario, fidelity, options.arl0 or ARL0, episodes, options.seed, options.threads)
    if options.roc is not None:
        _roc_attack(options.roc_attack, matrix.names(options.attack, policies))
    matrix.check_knowledge(policies)
    tell_what_is_new(policies, scenario, fidelity)
    return last_of(matrix.reports(options.detector or (), options.attack, policies, terminal.progress))


def _of_log(options: argparse.Namespace, log: Scenario, terminal: PlainConsole) -> dict[str, Any]:
    """The matrix of a recorded log, with the detectors and attacks that fit where none are named.

    Raises:
        ValueError: an option that a log has not, or a part that does not fit.
    """
    for name, words in (("arl0", "false alarms of a log are set by --p-fa"), ("roc", "a log has too few games for it"),
                        ("shadow", "a log has no linear model")):
        if getattr(options, name) is not None:
            raise ValueError(f"--{name} does not go with a recorded log: {words}")
    detectors = [make_detector(text) for text in options.detector or DETECTORS]
    if not options.detector:
        detectors = [each for each in detectors if set(each.needs) <= set(log.offers) and not each.members]
    asked = [make_spoofer(text) for text in (*options.attack, *map(policy_text, options.attacker))]
    for attack in asked:
        _check_fits(attack, log)
    attacks = asked if options.attack else [*filter(partial(_fits, log), map(make_spoofer, ATTACKS)), *asked]
    games = (options.p_fa or P_FA, options.episodes or GAMES, options.seed)
    return last_of(recorded_matrices(log, detectors, attacks, *games, terminal.progress))


def _check_fits(attack: Attack, log: Scenario) -> None:
    """Refuse an attack that cannot be played on a log.

    Raises:
        ValueError: saying why.
    """
    Simulation(log, copy.deepcopy(attack), fidelity=log.fidelities[0])


def _fits(log: Scenario, attack: Attack) -> bool:
    try:
        _check_fits(attack, log)
    except ValueError:
        return False
    return True


def policy_text(given: str) -> str:
    """A policy as the specification of an attack."""
    return given if given.startswith(POLICY) else f"{POLICY}{given}"
