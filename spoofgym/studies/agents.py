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
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from spoofgym.command_line import STDOUT, Parser, add_import, add_json, count, output
from spoofgym.console import console
from spoofgym.evaluation.agent_scores import agent_scores
from spoofgym.evaluation.progress import Progress
from spoofgym.evaluation.report import SCHEMA_VERSION
from spoofgym.policies.card import Card, Score, read_card
from spoofgym.policies.learned import SPOOFER, load_policy
from spoofgym.policies.published import policy_folder, published_names
from spoofgym.program import FAILURE, last_of, moved, program
from spoofgym.studies.giving import give
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
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    names = options.agents or published_names()
    if not names:
        raise ValueError("this version publishes no agents: name the folder of one")
    terminal = console(stderr=options.json == STDOUT)
    cards = {name: read_card(policy_folder(name)) for name in names}
    if options.write is not None:
        write_table(options.write, list(cards.values()))
    report = last_of(_reports(cards, options.check, options.games, terminal.progress))
    give(report, _table(report, options.check), options.json, terminal)
    return FAILURE if any(row["holds"] is False for row in report["rows"]) else 0


def _reports(
    cards: dict[str, Card], again: bool, games: int | None, progress: Progress
) -> Iterator[dict[str, Any]]:
    """The ``"agents"`` report after each agent: a row for each score of its card."""
    rows: list[dict[str, Any]] = []
    for name, card in cards.items():
        played: Sequence[Score | None] = [None] * len(card.scores)
        if again:
            with progress(f"{name} plays"):
                played = played_again(name, card, games)
        for told, found in zip(card.scores, played, strict=True):
            rows.append(_content(card, told, found))
        yield {"schema_version": SCHEMA_VERSION, "kind": "agents", "rows": list(rows)}


def _content(card: Card, told: Score, found: Score | None) -> dict[str, Any]:
    """A row of the report: what the card tells, and what came of playing again."""
    return {
        **dict(zip(COLUMNS, _row(card, told), strict=True)),
        "metric": told.metric,
        "unit": told.unit,
        "value": told.value,
        "ci95": list(told.interval),
        "games": told.games,
        "seed": told.seed,
        "again": None if found is None else found.value,
        "again_ci95": None if found is None else list(found.interval),
        "again_games": None if found is None else found.games,
        "holds": None if found is None else overlap(told, found),
    }


def _table(report: dict[str, Any], again: bool) -> Table:
    table = Table(box=None)
    for column in (*COLUMNS, *(("played again",) if again else ())):
        table.add_column(column)
    for row in report["rows"]:
        cells = [row[column] for column in COLUMNS]
        if row["again"] is not None:
            told = _written(row["again"], row["again_ci95"], row["unit"])
            cells.append(f"{told}{'' if row['holds'] else ', does not hold'}")
        table.add_row(*cells)
    return table


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
    return _written(score.value, score.interval, score.unit)


def _written(value: float, interval: Sequence[float], unit: str) -> str:
    low, high = interval
    return f"{value:.3g} ±{0.5 * (high - low):.2g} {unit}"


def _row(card: Card, score: Score) -> tuple[str, ...]:
    scenario = str(card.arguments.get("scenario", ""))
    # in a duel the knowledge is that of the spoofer
    knows = str(card.arguments.get("knowledge", "")) if card.role == SPOOFER else "statistics"
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
