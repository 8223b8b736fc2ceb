"""The rows of the benchmark's page: of every baseline and every published agent, each played once and then kept.

A row is kept in a JSON file beside the page, under the digest of the benchmark and that of the agent's weights: a newly
published agent costs its own games alone.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from spoofgym import files
from spoofgym.evaluation.benchmark import TRACKS, Benchmark
from spoofgym.evaluation.benchmark_play import Matches, described
from spoofgym.evaluation.benchmark_report import measure
from spoofgym.evaluation.engine import Engine, Notify
from spoofgym.policies.learned import LearnedSpoofer, load_policy
from spoofgym.policies.published import POLICY, published_folder, published_names

Rows = dict[str, list[dict[str, Any]]]
LATER = {"attack": (), "defend": ("multiple-hypothesis",)}
"""Players of the tables that came after the benchmark was pinned. They change no reference: the version stays."""


def players_of(benchmark: Benchmark) -> dict[str, list[str]]:
    """The players of the tables by the track: the pinned baselines, later ones, every published agent of the role."""
    found = {track: [*benchmark.baselines(track), *LATER[track]] for track in TRACKS}
    for name in published_names():
        spoofs = isinstance(load_policy(published_folder(name)), LearnedSpoofer)
        found[TRACKS[0] if spoofs else TRACKS[1]].append(f"{POLICY}{name}")
    return {track: list(dict.fromkeys(names)) for track, names in found.items()}


def page_results(matches: Matches, kept: Path | None, engine: Engine, notify: Notify) -> Rows:
    """The rows of both tables, by the track.

    Args:
        matches: of the benchmark.
        kept: JSON file of rows; those of players that are as they were are taken from it; None = play everybody.
        engine: plays.
        notify: told each match that is played, and each task that is refused.

    Raises:
        ValueError: the file is damaged.
        RuntimeError: a failure of the engine.
    """
    benchmark = matches.benchmark
    known = read_rows(kept, benchmark) if kept is not None and kept.exists() else {track: [] for track in TRACKS}
    rows: Rows = {}
    for track, players in players_of(benchmark).items():
        there = {row["player"]["policy"]: row for row in known[track]}
        rows[track] = []
        for player in players:
            row = there.get(player)
            if row is None or row["player"] != described(track, player):
                row = row_of(measure(matches, track, [player], (), engine, notify))
            rows[track].append(row)
    return rows


def row_of(report: dict[str, Any]) -> dict[str, Any]:
    """What is kept of the report of a player."""
    told = ("score", "normalised", "worst")
    return {
        "player": report["policies"][0],
        "summary": report["summary"],
        "tasks": {row["task"]: {name: row[name] for name in told} for row in report["tasks"]},
        "refused": [each["task"] for each in report["refused"]],
    }


def write_rows(path: Path, benchmark: Benchmark, rows: Rows) -> None:
    """Keep the rows of both tables.

    Raises:
        OSError: the file cannot be written.
    """
    files.write_json(path, {"benchmark": benchmark.name, "digest": benchmark.digest, "rows": rows})


def read_rows(path: Path, benchmark: Benchmark) -> Rows:
    """The rows of a file; none where they are of another benchmark.

    Raises:
        ValueError: the file is damaged.
    """
    with files.reading(path):
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["digest"] != benchmark.digest:
            return {track: [] for track in TRACKS}
        rows: Rows = {track: list(content["rows"][track]) for track in TRACKS}
        _check(rows[track] for track in TRACKS)
        return rows


def _check(tables: Any) -> None:
    entries: Sequence[str] = ("player", "summary", "tasks", "refused")
    for row in (row for table in tables for row in table):
        if not isinstance(row, dict) or set(row) != set(entries) or not isinstance(row["player"], dict):
            raise ValueError(f"a row has the entries {', '.join(entries)}, got {row!r}")
