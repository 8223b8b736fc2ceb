"""Play a league: both sides learn against each other, and the table says who can be exploited by how much.

    spoofgym train league --scenario foi-drive --out runs/league
    spoofgym train league --scenario foi-drive --payoff beyond:50 --rounds 3 --out runs/beyond

The league begins with scripted and optimal spoofers and with every classical defender. Each round fills the payoff
matrix, solves it, and trains a best response of each side to the other's mixture; those that gain are taken in. The
folder holds ``league.json`` (what the league is), ``rounds.json`` (every matrix, mixture and value), the games of all
cells, and the policies. A league that was stopped goes on with the same command.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from spoofgym.attacks.base import KNOWLEDGE
from spoofgym.command_line import (
    STDOUT,
    Parser,
    add_figure,
    add_import,
    add_json,
    count,
    run_folder,
    seed_number,
    share,
    threads,
)
from spoofgym.console import console, show
from spoofgym.envs.duel_config import DuelConfig
from spoofgym.envs.payoffs import PAYOFFS, Beyond, Payoff, make_payoff
from spoofgym.evaluation.defenders import fits
from spoofgym.evaluation.duels import with_detectors_of
from spoofgym.evaluation.engine import ENGINES, Engine, Here, make_engine
from spoofgym.evaluation.payoff import META_STRATEGIES, RESAMPLES
from spoofgym.learning.best_response import BestResponse
from spoofgym.learning.double_oracle import MORE_GAMES, League, LeagueSettings
from spoofgym.learning.scripted_start import OPTIMAL, SCRIPTED
from spoofgym.policies.classical import PUBLISHED, SEPARATOR, WITHOUT_ALARM, WORLD_DETECTORS, keeps_within, tuned_for
from spoofgym.program import do_all, give_json, goes_on, moved, program
from spoofgym.responses import make_response
from spoofgym.scenario import Scenario
from spoofgym.scenarios import make_scenario
from spoofgym.studies.league_presentation import league_figure, league_tables

SPOOFERS = (*SCRIPTED, "training", *OPTIMAL)

EXAMPLES = (
    "spoofgym train league --scenario foi-drive --out runs/league",
    "spoofgym train league --payoff beyond:50 --rounds 3 --out runs/beyond",
)
YARDSTICKS = ("always-use", "always-exclude")


def parser() -> argparse.ArgumentParser:
    """The command line."""
    description = "Let both sides learn against each other, and compare all."
    result = Parser(prog="spoofgym train league", examples=EXAMPLES, description=description)
    add = result.add_argument
    add("--scenario", default="foi-drive", help="what is driven or flown (default: %(default)s)")
    add("--payoff", default="error", metavar="SPEC", help=f"{PAYOFFS} (default: %(default)s)")
    add("--knowledge", choices=KNOWLEDGE, default="shadow", help="of learned spoofers (default: %(default)s)")
    add("--clean", type=share, default=0.5, help="share of games without an attack (default: %(default)s)")
    add("--rounds", type=seed_number, default=5,
        help="of best responses; 0 = compare who is there at the beginning (default: %(default)s)")
    add("--games", type=count, default=500, help="that each cell begins with (default: %(default)s)")
    add("--most-games", type=count, metavar="N",
        help=f"of a cell whose interval decides who is mixed in (default: {MORE_GAMES} times --games)")
    add("--meta", choices=tuple(META_STRATEGIES), default="nash", help="how a side is mixed (default: %(default)s)")
    add("--spoofer-steps", type=count, default=1_600_000, help="of each spoofer's training (default: %(default)s)")
    add("--defender-steps", type=count, default=800_000, help="of each defender's training (default: %(default)s)")
    add("--spoofer", action="append", metavar="SPEC",
        help="who spoofs at the beginning; repeatable (default: ramps, a jump, the training attacks, optimal ones)")
    add("--defender", action="append", metavar="SPEC",
        help="who defends at the beginning; repeatable (default: every published and tuned one, and two yardsticks)")
    add("--detector", action="append", metavar="SPEC",
        help="whose statistics both sides may see; repeatable (default: those of the evaluations of defenders)")
    add("--seed", type=seed_number, default=0, help="of all random numbers (default: %(default)s)")
    add("--resamples", type=count, default=RESAMPLES,
        help="of the games, for the interval of the value (default: %(default)s)")
    add_engine(result)
    add("--threads", type=threads, default=1, help="of learners and simulations (default: %(default)s)")
    add("--out", type=run_folder, default=Path("runs/league"), help="folder of the league (default: %(default)s)")
    add_import(result)
    add_json(result)
    add_figure(result)
    return result


def add_engine(parser: argparse.ArgumentParser) -> None:
    """The options that say where games are played and policies trained."""
    add = parser.add_argument
    add("--engine", choices=ENGINES, default=ENGINES[0],
        help="where it is computed: processes of this machine, or a Ray cluster (default: %(default)s)")
    add("--workers", type=count, help="processes (default: one for each core)")
    add("--address", metavar="URL", help="of a Ray cluster, ray://HOST:PORT (default: a Ray of this machine)")


def engine_of(options: argparse.Namespace) -> Engine:
    """The engine that the options ask for.

    Raises:
        ValueError: options that do not fit each other, or an address that does not answer.
        ImportError: Ray is missing.
    """
    return make_engine(options.engine, options.workers, options.address)


def classical_defenders(scenario: Scenario, payoff: Payoff) -> tuple[str, ...]:
    """Every classical defender that fits a scenario and a payoff, and the yardsticks, as they are spelled."""
    listed = [*PUBLISHED, *tuned_for(scenario.unguided.name)]
    spelled = [f"{each.detector}{SEPARATOR}{each.response}" for each in listed if fits(each.detector, scenario)]
    weighing = [*WITHOUT_ALARM, *([keeps_within(payoff.limit)] if isinstance(payoff, Beyond) else [])]
    alone = [name for name in weighing if set(make_response(name).needs) <= set(scenario.offers)]
    return (*dict.fromkeys(spelled), *alone, *YARDSTICKS)


def duel_of(options: argparse.Namespace) -> tuple[DuelConfig, tuple[str, ...]]:
    """The duel that the options ask for, with the detectors of all defenders, and these defenders.

    Raises:
        ValueError: a part that is unknown or does not fit.
    """
    scenario = make_scenario(options.scenario)
    defenders = tuple(options.defender or classical_defenders(scenario, make_payoff(options.payoff, scenario)))
    duel = DuelConfig(
        scenario=options.scenario,
        detectors=tuple(options.detector or (name for name in WORLD_DETECTORS if fits(name, scenario))),
        knowledge=options.knowledge,
        payoff=options.payoff,
        clean=options.clean,
        threads=options.threads,
    )
    return with_detectors_of(duel, defenders), defenders


def settings_of(options: argparse.Namespace) -> LeagueSettings:
    """The league that the options ask for.

    Raises:
        ValueError: a part that is unknown or does not fit.
    """
    duel, defenders = duel_of(options)
    return LeagueSettings(
        duel=duel,
        spoofers=tuple(options.spoofer or SPOOFERS),
        defenders=defenders,
        rounds=options.rounds,
        games=options.games,
        most_games=options.most_games,
        meta=options.meta,
        seed=options.seed,
        resamples=options.resamples,
    )


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=True)
    settings = settings_of(options)
    engine = engine_of(options)
    train = BestResponse(settings.duel, isinstance(engine, Here), options.spoofer_steps, options.defender_steps)
    with goes_on(options.out):
        rounds = League(settings, options.out, train, engine).play(partial(terminal.print, soft_wrap=True))
    report = {"kind": "league", **settings.content(), "results": [each.content() for each in rounds]}
    tables = league_tables(report)
    output = console(stderr=options.json == STDOUT)
    do_all(
        *(partial(show, output, table) for table in tables),
        lambda: give_json(report, options.json),
        lambda: league_figure(report, options.figure) if options.figure is not None else None,
    )
    return 0


if __name__ == "__main__":
    sys.exit(moved("spoofgym train league"))
