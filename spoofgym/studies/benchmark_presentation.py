"""Tables of the benchmark: of one player, of the references, and those of the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from spoofgym.evaluation.benchmark import ATTACK, DEFEND, Benchmark, groups_of
from spoofgym.evaluation.benchmark_report import References, interval_of
from spoofgym.studies.pages import around, put_table

MARKS = {
    track: (
        f"<!-- the table `{track}` of `spoofgym benchmark table --write` -->",
        f"<!-- end of the table `{track}` -->",
    )
    for track in (ATTACK, DEFEND)
}
DIFFERS = 1e-6
"""Relative difference from which a reference that is played again is another one."""


def report_tables(report: dict[str, Any]) -> list[Table]:
    """The tasks and the summary of a ``"benchmark"`` report."""
    name = " + ".join(policy["policy"] for policy in report["policies"])
    played = _table(
        f"{report['benchmark']} ({report['digest']}), track '{report['track']}': {name}",
        ("task", "score", "of the references", "worst case by", "0 is", "1 is", "reached by"),
    )
    for row in report["tasks"]:
        score, line = interval_of(row["score"]), interval_of(row["normalised"])
        unit = " m" if row["unit"] == "m" else ""
        zero, one = (f"{row['references'][name]:.4g}" for name in ("zero", "one"))
        worst = row["worst"] if len(row["matches"]) > 1 else ""
        half = 0.5 * (score.high - score.low)
        shown = f"{score.value:.3g} ±{half:.2g}{unit}"
        played.add_row(row["task"], shown, str(line), worst, zero, one, row["references"]["best"])
    summary = report["summary"]
    whole = summary["interquartile_mean"]
    total = _table("summary: 0 and 1 are the references", ("", "interquartile mean", "tasks"))
    for group, content in {"all": whole, **summary["groups"]}.items():
        total.add_row(group, str(interval_of(content)), _covered(content))
    total.caption = f"plain mean: {interval_of(summary['mean'])}"
    if report["refused"]:
        names = ", ".join(each["task"] for each in report["refused"])
        total.caption += f"; refused: {names}"
    return [played, total]


def _covered(content: dict[str, Any]) -> str:
    """How many tasks of how many."""
    return f"{content['tasks']} of {content['all_tasks']}"


def references_table(found: Sequence[References], benchmark: Benchmark) -> Table:
    """What is worth 0 and 1 in each task, played again, beside what the benchmark pins."""
    pinned = {task.name: task for task in benchmark.tasks}
    table = _table(f"references of {benchmark.name}", ("task", "0 is", "pinned", "1 is", "pinned", "reached by", ""))
    for each in found:
        task = pinned[each.task]
        numbers = (each.zero, task.zero, each.one, task.one)
        differs = "" if agrees(each, benchmark) else "differs"
        table.add_row(each.task, *(f"{number:.6g}" for number in numbers), each.best, differs)
    return table


def agrees(found: References, benchmark: Benchmark) -> bool:
    """Whether a reference is the pinned one."""
    task = next(task for task in benchmark.tasks if task.name == found.task)
    pairs = ((found.zero, task.zero), (found.one, task.one))
    return found.best == task.best and all(abs(a - b) <= DIFFERS * max(abs(a), abs(b)) for a, b in pairs)


def page_columns(benchmark: Benchmark, track: str) -> tuple[str, ...]:
    """The columns of the table of a track."""
    knows = ("knows",) if track == ATTACK else ()
    return ("player", *knows, "all", *groups_of(benchmark.chosen(track)), "tasks")


def page_rows(benchmark: Benchmark, track: str, rows: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """The rows of the table of a track, the best first, then those that do not fit all tasks.

    Args:
        benchmark: that was played.
        track: "attack" or "defend".
        rows: of `spoofgym.studies.benchmark_page`.
    """
    found = []
    for row in sorted(rows, key=_rank):
        whole, groups = row["summary"]["interquartile_mean"], row["summary"]["groups"]
        shown = [_shown(content) for content in (whole, *map(groups.get, groups_of(benchmark.chosen(track))))]
        knows = (str(row["player"]["knowledge"]),) if track == ATTACK else ()
        found.append((f"`{row['player']['policy']}`", *knows, *shown, _covered(whole)))
    return found


def _rank(row: dict[str, Any]) -> tuple[bool, float]:
    whole = row["summary"]["interquartile_mean"]
    return not _complete(whole), -whole["value"]


def check_page(page: Path) -> None:
    """Refuse a page without a place for the tables, before anything is played.

    Raises:
        ValueError: the page lacks the marks.
        OSError: it cannot be read.
    """
    for begin, end in MARKS.values():
        around(page, begin, end)


def write_page(page: Path, benchmark: Benchmark, rows: Mapping[str, Sequence[dict[str, Any]]]) -> None:
    """Put the tables of both tracks into a page, between their marks.

    Raises:
        ValueError: the page lacks the marks.
        OSError: it cannot be read or written.
    """
    for track, (begin, end) in MARKS.items():
        put_table(page, begin, end, page_columns(benchmark, track), page_rows(benchmark, track, rows[track]))


def _complete(content: dict[str, Any] | None) -> bool:
    """Whether all tasks of a group were played: fewer of them are another measure."""
    return content is not None and content["tasks"] == content["all_tasks"]


def _shown(content: dict[str, Any] | None) -> str:
    """A value and half the length of its interval; – where a task is lacking."""
    if content is None or not _complete(content):
        return "–"
    found = interval_of(content)
    return f"{found.value:.3f} ± {0.5 * (found.high - found.low):.3f}"


def _table(title: str, columns: tuple[str, ...]) -> Table:
    table = Table(title=title, box=None)
    for place, name in enumerate(columns):
        table.add_column(name, justify="left" if place == 0 or name.endswith("by") else "right")
    return table
