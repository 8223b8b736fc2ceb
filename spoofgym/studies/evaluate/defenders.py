"""Evaluate defenders on populations of attacks, beside every classical defender and two yardsticks.

    spoofgym evaluate defenders --scenario foi-drive --defender runs/d --json out.json --figure out.png

All defenders play the same games, half of which are clean.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from typing import Any

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
from spoofgym.evaluation.defenders import (
    NOBODY,
    POPULATIONS,
    check_names,
    defenders_reports,
    everybody,
    left_out,
)
from spoofgym.evaluation.game_log import GameLog
from spoofgym.navigation.family import FIDELITIES
from spoofgym.policies.classical import own_defenders, parse, watcher_and_response
from spoofgym.policies.learned import LearnedDefender
from spoofgym.policies.published import policy_folder
from spoofgym.program import last_of, program
from spoofgym.scenarios import make_scenario
from spoofgym.studies.defenders_presentation import defenders_figure, defenders_tables
from spoofgym.studies.giving import Output, give
from spoofgym.studies.notes import tell_what_is_new

EXAMPLES = (
    "spoofgym evaluate defenders --scenario foi-drive --defender runs/d",
    "spoofgym evaluate defenders --defender snapshot/exclude --episodes 500",
    "spoofgym evaluate defenders --defender snapshot/exclude --only --attack ramp:1",
)
EPISODES = 4_000


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym evaluate defenders",
        description="Evaluate defenders on populations of attacks, beside every classical defender.",
        examples=EXAMPLES,
    )
    add = result.add_argument
    add("--scenario", default="foi-drive", help="what is driven or flown (default: %(default)s)")
    add("--defender", action="append", default=[], metavar="POLICY|SPEC",
        help="run folder or name of a trained defender, or detector/response; repeatable")
    add("--only", action="store_true", help="nobody plays beside the defenders that are named")
    against = result.add_mutually_exclusive_group()
    against.add_argument("--attack", metavar="SPEC", help="one attack, in place of the populations")
    against.add_argument(
        "--population", action="append", choices=tuple(POPULATIONS), help="of attacks; repeatable (default: all)"
    )
    add("--fidelity", choices=FIDELITIES, help="of the simulation (default: linear)")
    add("--episodes", type=count, default=EPISODES, help="games of each defender (default: %(default)s)")
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
    log = GameLog(options.seed)
    report = _report(options, terminal, log)
    outputs: list[Output] = [
        ("figure", options.figure, partial(defenders_figure, report)),
        ("games", options.games, log.write),
    ]
    give(report, defenders_tables(report), options.json, terminal, outputs)
    return 0


def _report(options: argparse.Namespace, terminal: PlainConsole, log: GameLog) -> dict[str, Any]:
    scenario = make_scenario(options.scenario)
    fidelity = options.fidelity or scenario.fidelities[0]
    scenario.check_fidelity(fidelity)
    policies, given = [], []
    for text in options.defender:
        if watcher_and_response(text) is not None:
            given.append(parse(text))
            continue
        try:
            folder = policy_folder(text)
        except ValueError as error:
            message = f"--defender {text!r} is neither a run folder nor detector/response: {error}"
            raise ValueError(message) from error
        policies.append(LearnedDefender.load(folder))
    populations = [options.attack] if options.attack else options.population or tuple(POPULATIONS)
    if options.only and not options.defender:
        raise ValueError("--only leaves everybody out but the defenders that --defender names: name one")
    check_names(policies)
    tell_what_is_new(policies, scenario, fidelity)
    if not options.only:
        given += [each for each in own_defenders() if each not in given]
        for line in left_out(scenario):
            terminal.print(line, markup=False, soft_wrap=True)
    company = NOBODY if options.only else everybody(scenario)
    games = (options.episodes, options.seed, options.threads)
    return last_of(
        defenders_reports(scenario, fidelity, policies, given, populations, company, *games, terminal.progress, log)
    )
