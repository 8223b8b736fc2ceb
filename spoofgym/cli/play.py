"""Play one game and tell its story in the terminal; as a page, a table or JSON where they are asked for.

spoofgym play
spoofgym play --scenario liu-flight --policy liu-flight-snapshot-spoofer --page game.html
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from shutil import get_terminal_size
from typing import Any

from spoofgym import files
from spoofgym.cli.story import BARS, story
from spoofgym.command_line import STDOUT, Parser, add_import, add_json, add_seed, output
from spoofgym.console import console
from spoofgym.evaluation.game_recording import play_game
from spoofgym.evaluation.game_trace import GameTrace
from spoofgym.navigation.family import FIDELITIES
from spoofgym.policies.learned import SPOOFER, load_policy
from spoofgym.policies.published import POLICY, policy_folder
from spoofgym.program import do_all, give_json, program

EXAMPLES = (
    "spoofgym play",
    "spoofgym play --scenario foi-drive --attack ramp:0.5 --detector cusum \\",
    "  --response onset-depth --page game.html",
    "spoofgym play --scenario liu-flight --policy liu-flight-snapshot-spoofer",
    "spoofgym play --attack training --response multiple-hypothesis --seed 3",
)
SCENARIO, ATTACK, DETECTOR, RESPONSE = "foi-drive", "ramp:0.5", "windowed:n=5", "exclude-and-backtrack:20"
"""What plays where nothing is named: a defender of the literature against a slow ramp."""
NOBODY = "none"


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym play",
        description="Play one game and tell its story: when the spoofer begins, when an alarm comes, what the defender "
        "does, and what errors are left.",
        examples=EXAMPLES,
    )
    add = result.add_argument
    add("--scenario", help=f"what is driven or flown (default: {SCENARIO}, or that of the policy)")
    add("--attack", metavar="SPEC", help=f"who spoofs; none = nobody (default: {ATTACK})")
    add("--policy", metavar="POLICY", action="append", default=[],
        help="run folder or name of a trained spoofer or defender, which takes its seat; repeatable")
    add("--detector", metavar="SPEC", action="append",
        help=f"who watches; repeatable (default: {DETECTOR}, or what the players see)")
    add("--response", metavar="SPEC",
        help=f"what follows an alarm, or detector/response; none = every fix is used (default: {RESPONSE})")
    add("--fidelity", choices=FIDELITIES, help="of the simulation (default: linear; a log has strapdown only)")
    add_seed(result, "the game")
    add_import(result)
    add("--page", type=output, metavar="FILE", help="write a page to look at: one HTML file, without network")
    add("--csv", type=output, metavar="FILE", help="write a table with a row for each epoch")
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    seated = seats(options)
    game = play_game(**seated, seed=options.seed, fidelity=options.fidelity)
    terminal = console(stderr=options.json == STDOUT)
    lines = story(game, get_terminal_size().columns, _prints_blocks())
    steps: list[Callable[[], object]] = [
        lambda: terminal.print("\n".join(lines), soft_wrap=True),
        partial(give_json, game.to_json(), options.json),
    ]
    if options.csv is not None:
        steps.append(partial(files.write_text, options.csv, game.to_csv()))
    if options.page is not None:
        steps.append(partial(_page, options.page, game))
    do_all(*steps)
    for what, path in (("page", options.page), ("table", options.csv), ("game", options.json)):
        if path is not None and path != STDOUT:
            terminal.print(f"{what} in {path}", soft_wrap=True)
    return 0


def seats(options: argparse.Namespace) -> dict[str, Any]:
    """Who plays, as `play_game` takes them.

    Raises:
        ValueError: a policy that is unknown, two for one seat, or a seat that is given twice.
        FileNotFoundError: a folder that holds no policy.
    """
    given = {"scenario": options.scenario, "attack": options.attack, "response": options.response}
    named = {key: value for key, value in given.items() if value is not None}
    for text in options.policy:
        policy = load_policy(policy_folder(text))
        seat, option = ("attack", "--attack") if policy.kind == SPOOFER else ("response", "--response")
        if seat in named:
            raise ValueError(f"policy {text!r} is a {policy.kind}, whose seat {option} {named[seat]!r} has taken")
        named[seat] = f"{POLICY}{text.removeprefix(POLICY)}"
        named.setdefault("scenario", str(policy.configuration.get("scenario", SCENARIO)))
    named = {"scenario": SCENARIO, "attack": ATTACK, "response": RESPONSE} | named
    watching = options.detector or ([DETECTOR] if named["response"] == RESPONSE and not options.policy else [])
    players = {seat: None if named[seat] == NOBODY else named[seat] for seat in ("attack", "response")}
    return {"scenario": named["scenario"], "detectors": tuple(watching), **players}


def _page(path: Path, game: GameTrace) -> None:
    from spoofgym.report.page import write_page

    write_page(path, [game])


def _prints_blocks() -> bool:
    """Whether the terminal's encoding has the letters of a sparkline."""
    try:
        BARS.encode(sys.stdout.encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return False
    return True
