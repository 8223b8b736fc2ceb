"""The published agents: a table of what they are worth, and whether that still holds.

    spoofgym agents                       # the table of the cards
    spoofgym agents --check               # every agent plays again
    spoofgym agents NAME --check --games 1000
    spoofgym agents --write agents/README.md

With ``--check`` each agent plays the games of its card again. A score holds where the intervals of both overlap; with
as many games as the card and on the same kind of machine the numbers are equal. The exit status is 1 where one does not
hold.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from spoofgym.command_line import Parser, add_import, count, output
from spoofgym.console import console, show
from spoofgym.evaluation.agent_scores import agent_scores
from spoofgym.policies.card import Card, Score, read_card
from spoofgym.policies.learned import load_policy
from spoofgym.policies.published import policy_folder, published_names
from spoofgym.program import FAILURE, moved, program
from spoofgym.studies.pages import put_table

EXAMPLES = (
    "spoofgym agents",
    "spoofgym agents --check --games 1000",
)

BEGIN, END = "<!-- the table of `spoofgym agents --write` -->", "<!-- end of the table -->"
COLUMNS = ("agent", "role", "scenario", "knows", "opponent", "score")


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(prog="spoofgym agents", examples=EXAMPLES, description="What the published agents are worth.")
    add = result.add_argument
    add("agents", metavar="NAME", nargs="*", help="published agents or folders of agents (default: all published)")
    add("--check", action="store_true", help="let each play again, and compare with its card")
    add("--games", type=count, help="with --check: against each opponent (default: as many as the card tells)")
    add("--write", metavar="FILE", type=output, help="page whose table is replaced, between its two marks")
    add_import(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    names = options.agents or published_names()
    if not names:
        raise ValueError("this version publishes no agents: name the folder of one")
    terminal = console()
    cards = {name: read_card(policy_folder(name)) for name in names}
    if options.write is not None:
        write_table(options.write, list(cards.values()))
    failed = []
    table = Table(box=None)
    for column in (*COLUMNS, *(("played again",) if options.check else ())):
        table.add_column(column)
    for name, card in cards.items():
        again: Sequence[Score | None] = [None] * len(card.scores)
        if options.check:
            with terminal.status(f"{name} plays"):
                again = played_again(name, card, options.games)
        for told, found in zip(card.scores, again, strict=True):
            row = list(_row(card, told))
            if found is not None:
                holds = overlap(told, found)
                row.append(f"{shown(found)}{'' if holds else ', does not hold'}")
                failed += [] if holds else [name]
            table.add_row(*row)
    show(terminal, table)
    return FAILURE if failed else 0


def played_again(name: str, card: Card, games: int | None = None) -> tuple[Score, ...]:
    """The scores of an agent, played again.

    Args:
        name: published agent, or its folder.
        card: of the agent.
        games: against each opponent; None = as many as the card tells.

    Raises:
        ValueError: the card tells other opponents than its policy has.
    """
    policy = load_policy(policy_folder(name))
    first = card.scores[0]
    found = agent_scores(policy, games or first.games, first.seed)
    if [score.opponent for score in found] != [score.opponent for score in card.scores]:
        raise ValueError(f"the card of {name!r} tells other opponents than its policy has")
    return found


def overlap(one: Score, other: Score) -> bool:
    """Whether the intervals of two scores overlap."""
    return one.interval[0] <= other.interval[1] and other.interval[0] <= one.interval[1]


def shown(score: Score) -> str:
    """A score with its interval."""
    low, high = score.interval
    return f"{score.value:.3g} ±{0.5 * (high - low):.2g} {score.unit}"


def _row(card: Card, score: Score) -> tuple[str, ...]:
    scenario, knows = str(card.arguments.get("scenario", "")), str(card.arguments.get("knowledge", "statistics"))
    return card.name, card.role, scenario, knows, score.opponent, f"{score.metric} {shown(score)}"


def write_table(page: Path, cards: Sequence[Card]) -> None:
    """Put the table of some agents into a page, between its two marks.

    Raises:
        ValueError: the page lacks the marks.
        OSError: it cannot be written.
    """
    rows = [_row(card, score) for card in sorted(cards, key=lambda card: card.name) for score in card.scores]
    put_table(page, BEGIN, END, COLUMNS, rows)


if __name__ == "__main__":
    sys.exit(moved("spoofgym agents"))
