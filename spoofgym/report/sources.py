"""What a page is made of: games, reports of programs, run folders; each is read, checked and turned into sections."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from spoofgym.evaluation.game_trace import KIND as GAME
from spoofgym.evaluation.game_trace import GameTrace
from spoofgym.report.figures import Section
from spoofgym.report.games import game_section
from spoofgym.validation import shown

Source = str | Path | Mapping[str, Any]
SCHEMA_VERSION = 1
VIEWS: dict[str, Callable[[Mapping[str, Any]], list[Section]]] = {}
"""Makes sections of a report, by its kind."""


def sections_of(sources: Sequence[Source | GameTrace]) -> list[Section]:
    """The sections of all sources, in order.

    Raises:
        ValueError: there is none, or one cannot be shown; the message names it.
        OSError: a file cannot be read.
    """
    if not sources:
        raise ValueError("a page needs at least one game, report or run folder")
    sections = []
    for source in sources:
        sections += _sections(source)
    return sections


def _sections(source: Source | GameTrace) -> list[Section]:
    if isinstance(source, GameTrace):
        return [game_section(source)]
    if isinstance(source, Mapping):
        return report_sections(source)
    path = Path(source)
    content = read_json(path)
    try:
        return report_sections(content)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def read_json(path: Path) -> Any:
    """The content of a JSON file.

    Raises:
        ValueError: it is no JSON; the message names the file.
        OSError: it cannot be read.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is no JSON file: {' '.join(str(error).split())}") from error


def report_sections(content: object) -> list[Section]:
    """The sections of one report.

    Raises:
        ValueError: it is no report of spoofgym, of another version, or damaged.
    """
    if not isinstance(content, Mapping) or not isinstance(content.get("kind"), str):
        raise ValueError("no report of spoofgym: it has no 'kind'")
    kind = content["kind"]
    if kind == GAME:
        return [game_section(GameTrace.from_json(content))]
    if kind not in VIEWS:
        raise ValueError(f"no report that a page can show: its kind is {shown(kind)}; {', '.join([GAME, *VIEWS])} are")
    version = content.get("schema_version")
    if version != SCHEMA_VERSION:
        raise ValueError(f"this version reads reports of schema_version {SCHEMA_VERSION}, got {shown(version)}")
    try:
        return VIEWS[kind](content)
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"a damaged report of kind {shown(kind)}: {type(error).__name__}: {reason}") from error
