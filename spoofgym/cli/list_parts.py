"""List what there is to play with: scenarios, detectors, attacks, responses, aids, policies.

    spoofgym list
    spoofgym list detectors
    spoofgym list detectors cusum

One name tells its options with defaults and units, its source, and a command that plays it.
"""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import partial
from shutil import get_terminal_size
from typing import Any

from spoofgym.cli.parts import REGISTRIES, Option, Part, part, parts
from spoofgym.command_line import STDOUT, Parser, add_import, add_json
from spoofgym.console import console
from spoofgym.policies.card import Card, read_card
from spoofgym.policies.published import POLICY, policy_folder, published_folder, published_names
from spoofgym.program import do_all, give_json, program

EXAMPLES = (
    "spoofgym list",
    "spoofgym list attacks",
    "spoofgym list detectors cusum",
    "spoofgym list policies --json -",
)
POLICIES = "policies"
KINDS = (*REGISTRIES, POLICIES)
WIDEST = 88
"""Columns of running text."""
LEAST_TOLD = 40
"""Columns of what is told beside a name; where fewer are left, it stands below the name."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = Parser(
        prog="spoofgym list",
        description="List scenarios, detectors, attacks, responses, aids and policies, a line each; of one name its "
        "options with defaults and units, its source, and an example.",
        examples=EXAMPLES,
    )
    add = result.add_argument
    add("kind", nargs="?", type=_kind, choices=KINDS, metavar="KIND", help=f"one of {', '.join(KINDS)} (default: all)")
    add("name", nargs="?", metavar="NAME", help="of one of them")
    add_import(result)
    add_json(result)
    return result


@program
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit status."""
    options = parser().parse_args(arguments)
    terminal = console(stderr=options.json == STDOUT)
    if options.kind is None:
        names = {kind: list(REGISTRIES[kind]) if kind in REGISTRIES else published_names() for kind in KINDS}
        content: Any = names
        lines = _names(names)
    elif options.name is None:
        found = _all(options.kind)
        content = [row for row, _ in found]
        lines = table([told for _, told in found], terminal.is_terminal)
    else:
        content, lines = _one(options.kind, options.name)
    do_all(
        lambda: terminal.print("\n".join(lines), soft_wrap=True),
        partial(give_json, content, options.json),
    )
    return 0


def _names(names: dict[str, list[str]]) -> Iterator[str]:
    for kind, listed in names.items():
        yield f"{kind}:"
        yield from _folded(", ".join(listed), 2)
        yield ""
    yield from _folded("spoofgym list KIND tells each in a line, spoofgym list KIND NAME all of one.", 0)


def _kind(given: str) -> str:
    """What is given as a kind, if it is not the name of a part, which has its kind before it."""
    name = given.partition(":")[0]
    for kind in KINDS:
        if name in (REGISTRIES[kind] if kind in REGISTRIES else published_names()):
            raise argparse.ArgumentTypeError(f"{given!r} is a name, not a kind: spoofgym list {kind} {name}")
    return given


def _all(kind: str) -> list[tuple[dict[str, Any], tuple[str, str]]]:
    """Every part of a kind, or every published policy: its JSON row, its name and what is told of it."""
    if kind == POLICIES:
        cards = {name: read_card(published_folder(name)) for name in published_names()}
        return [(asdict(card), (name, _about(card))) for name, card in cards.items()]
    return [(_row(each), (each.name, each.told)) for each in parts(kind)]


def _one(kind: str, name: str) -> tuple[dict[str, Any], Iterator[str]]:
    if kind == POLICIES:
        card = read_card(policy_folder(name))
        return asdict(card), _card(card, name.removeprefix(POLICY))
    found = part(kind, name)
    return _row(found), _part(found)


def _row(found: Part) -> dict[str, Any]:
    return {**asdict(found), "command": found.command}


def _about(card: Card) -> str:
    score = card.scores[0]
    scenario = card.arguments.get("scenario", "")
    return f"a {card.role} on {scenario}: {score.metric} {score.value:.3g} {score.unit} against {score.opponent}"


def table(rows: Sequence[tuple[str, str]], terminal: bool) -> Iterator[str]:
    """A line for each, cut after a word where a terminal is narrower; whole where the output is no terminal.

    A terminal that leaves too little beside the names shows what is told below them, whole.
    """
    width = max(len(name) for name, _ in rows) if rows else 0
    left = get_terminal_size().columns - width - 2
    for name, told in rows:
        if not terminal:
            yield f"{name:<{width}}  {told}"
        elif left >= LEAST_TOLD:
            yield f"{name:<{width}}  {textwrap.shorten(told, left, placeholder=' ...')}"
        else:
            yield name
            yield from _folded(told, 4)


def _part(found: Part) -> Iterator[str]:
    """All of one part, paragraphs folded to the terminal."""
    yield f"{found.name} ({found.kind[:-1]})"
    for paragraph in (f"{found.told}.", *found.text):
        yield ""
        yield from _folded(paragraph, 0)
    yield ""
    yield "options:" if found.options else "It has no options."
    for option in found.options:
        yield from _folded(_spelled(option), 2)
        if option.told:
            yield from _folded(option.told, 6)
    yield ""
    for what in (f"source: {found.source or 'none is cited'}", f"code: {found.module}", f"spelling: {found.example}"):
        yield from _folded(what, 0)
    yield "example:"
    yield f"  {found.command}"


def _spelled(option: Option) -> str:
    unit = f" {option.unit}" if option.unit and option.default != "none" else ""
    if not option.default:
        return f"{option.name} (must be given{f', in {option.unit}' if option.unit else ''})"
    return f"{option.name} (default: {option.default}{unit}{_in(option)})"


def _in(option: Option) -> str:
    return f"; in {option.unit}" if option.unit and option.default == "none" else ""


def _card(card: Card, name: str) -> Iterator[str]:
    """All of one policy."""
    yield f"{card.name} ({card.role})"
    yield ""
    yield from _folded(f"Trained on {card.environment} with:", 0)
    for key, value in card.arguments.items():
        yield from _folded(f"{key} = {value}", 2)
    yield ""
    yield "worth (95 % interval):"
    for score in card.scores:
        low, high = score.interval
        worth = f"{score.metric} {score.value:.3g} {score.unit} [{low:.3g}, {high:.3g}]"
        yield from _folded(f"{worth} against {score.opponent}, {score.games:,} games from seed {score.seed}", 2)
    yield ""
    yield from _folded(f"spelling: {POLICY}{name}", 0)
    yield "example:"
    yield f"  spoofgym play --policy {name}"


def _folded(text: str, indent: int) -> list[str]:
    blanks = " " * indent
    width = min(get_terminal_size().columns, WIDEST)
    return textwrap.wrap(text, width, initial_indent=blanks, subsequent_indent=blanks, break_on_hyphens=False)
