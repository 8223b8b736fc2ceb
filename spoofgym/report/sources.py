"""What a page is made of: games, reports of programs, run folders; each is read, checked and turned into sections."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from spoofgym.evaluation.game_trace import KIND as GAME
from spoofgym.evaluation.game_trace import GameTrace
from spoofgym.program import is_complete
from spoofgym.report.attackers import attackers_sections, recorded_sections
from spoofgym.report.benchmarks import benchmark_sections
from spoofgym.report.bounds import bayesian_sections, duel_sections
from spoofgym.report.defenders import defenders_sections
from spoofgym.report.detection import matrix_sections
from spoofgym.report.figures import Section
from spoofgym.report.games import game_section
from spoofgym.report.integrities import integrity_sections
from spoofgym.report.leagues import exploit_sections, league_sections
from spoofgym.report.real_attacks import real_attacks_sections
from spoofgym.report.tables import Report, plain_section
from spoofgym.report.trainings import TrainingRun, is_run, training_sections
from spoofgym.validation import shown

Source = str | Path | Mapping[str, Any]
Part = GameTrace | TrainingRun | Report
SCHEMA_VERSION = 1
LEAGUE_FILE, ROUNDS_FILE = "league.json", "rounds.json"
VIEWS: dict[str, Callable[[Report], list[Section]]] = {
    "attackers": attackers_sections,
    "recorded": recorded_sections,
    "defenders": defenders_sections,
    "matrix": matrix_sections,
    "league": league_sections,
    "exploit": exploit_sections,
    "bayesian-bound": bayesian_sections,
    "duel-bound": duel_sections,
    "benchmark": benchmark_sections,
    "integrity": integrity_sections,
    "real-attacks": real_attacks_sections,
    **dict.fromkeys(
        (
            *("tuning", "thresholds", "fidelity of thresholds", "acna-study", "wrong-shadow", "reproduction"),
            *("recorded-ranges", "references", "self-tuning-study", "patient-spoofer", "agents"),
            *("delay", "fusion-ripper"),
        ),
        plain_section,
    ),
}
"""Makes sections of a report, by its kind."""


def sections_of(sources: Sequence[Source | GameTrace]) -> list[Section]:
    """The sections of all sources, in order; training runs of one setting share one, at the place of the first.

    Raises:
        ValueError: there is no source, or one cannot be shown; the message names it.
        OSError: a file cannot be read.
    """
    if not sources:
        raise ValueError("a page needs at least one game, report or run folder")
    parts = [part for source in sources for part in _parts(source)]
    reports = [part for part in parts if isinstance(part, Mapping)]
    runs = [part for part in parts if isinstance(part, TrainingRun)]
    sections: list[Section] = []
    for part in parts:
        if isinstance(part, GameTrace):
            sections.append(game_section(part))
        elif isinstance(part, TrainingRun):
            if part is runs[0]:
                sections += training_sections(runs)
        else:
            sections += report_sections(part, reports)
    return sections


def _parts(source: Source | GameTrace) -> list[Part]:
    """What a source holds, read and checked.

    Raises:
        ValueError: naming the source where it is a path.
    """
    if isinstance(source, GameTrace):
        return [source]
    if isinstance(source, Mapping):
        return [checked(source)]
    path = Path(source)
    if path.is_dir():
        return _folder(path)
    content = read_json(path)
    try:
        return [checked(content)]
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _folder(folder: Path) -> list[Part]:
    """A training, a league, or reports that a program has written into a folder.

    Raises:
        ValueError: it holds none of them, or a file is damaged.
    """
    parts: list[Part] = []
    if is_run(folder):
        parts.append(TrainingRun.read(folder))
    is_league = (folder / LEAGUE_FILE).is_file() and (folder / ROUNDS_FILE).is_file()
    if is_league:
        settings, rounds = read_json(folder / LEAGUE_FILE), read_json(folder / ROUNDS_FILE)
        if not isinstance(settings, dict):
            raise ValueError(f"{folder / LEAGUE_FILE} does not say what a league is")
        parts.append(checked({"kind": "league", **settings, "results": rounds}))
    for path in sorted(folder.glob("*.json")):
        if is_league and path.name == LEAGUE_FILE:
            continue
        content = read_json(path)
        if isinstance(content, dict) and content.get("kind") in (GAME, *VIEWS):
            parts.append(checked(content))
    if not parts:
        raise ValueError(f"{folder} holds no training, no league and no report of spoofgym")
    return parts


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


def checked(content: object) -> Part:
    """A report whose kind and version a page can show, or the game that it holds.

    Raises:
        ValueError: it is no report of spoofgym, or of another version.
    """
    if not isinstance(content, Mapping) or not isinstance(content.get("kind"), str):
        raise ValueError("no report of spoofgym: it has no 'kind'")
    kind = content["kind"]
    if kind == GAME:
        return GameTrace.from_json(content)
    if kind not in VIEWS:
        raise ValueError(f"no report that a page can show: its kind is {shown(kind)}; {', '.join([GAME, *VIEWS])} are")
    version = content.get("schema_version")
    if version != SCHEMA_VERSION:
        raise ValueError(f"this version reads reports of schema_version {SCHEMA_VERSION}, got {shown(version)}")
    return content


def report_sections(report: Report, beside: Sequence[Report] = ()) -> list[Section]:
    """The sections of one report.

    Args:
        report: that `checked` lets pass.
        beside: all reports of the page: a bound of one is a line in the figure of another.

    Raises:
        ValueError: it is damaged.
    """
    kind = report["kind"]
    try:
        sections = defenders_sections(report, beside) if kind == "defenders" else VIEWS[kind](report)
        return sections if is_complete(report) else [_marked(section) for section in sections]
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"a damaged report of kind {shown(kind)}: {type(error).__name__}: {reason}") from error


def _marked(section: Section) -> Section:
    """The section of a report whose program was stopped: it says so first."""
    return replace(section, facts=[("incomplete", "its program was stopped before its end"), *section.facts])
