"""Scores of a benchmark: by task, and over groups of tasks."""

from __future__ import annotations

from typing import Any

from spoofgym.report.figures import Bar, Bars, Figure, Mark, Section
from spoofgym.report.tables import Report, counted, facts_of, interval_of, table_of


def benchmark_sections(report: Report) -> list[Section]:
    """A ``"benchmark"`` report."""
    summary, tasks = report["summary"], report["tasks"]
    over: dict[str, Any] = {"all tasks, interquartile mean": summary["interquartile_mean"]}
    if summary["mean"] is not None:
        over["all tasks, mean"] = summary["mean"]
    over |= {f"{group}, interquartile mean": found for group, found in summary["groups"].items()}
    figures: list[Figure] = [
        Bars(
            title="Normalised score over tasks",
            summary=_headline(summary["interquartile_mean"]),
            unit="normalised score: 0 and 1 are the references of each task (95 % interval)",
            bars=[
                Bar(name, found.get("value"), *interval_of(found), note=_counted(found)) for name, found in over.items()
            ],
            marks=[Mark("reference", 1.0)],
        ),
        Bars(
            title="Normalised score by task",
            summary=f"{counted(len(tasks), 'task')}; {len(report['refused'])} that do not fit are left out.",
            unit="normalised score (95 % interval)",
            bars=[_task(task) for task in tasks],
            marks=[Mark("reference", 1.0)],
        ),
        table_of("All tasks", "Scores, references and matches of every task.", [_flat(task) for task in tasks]),
    ]
    played = "; ".join(str(policy["policy"]) for policy in report["policies"])
    facts = [*facts_of(report), ("Policies", played)]
    return [Section(f"{report['benchmark']}: {played}", facts, figures)]


def _headline(found: Report) -> str:
    if found.get("value") is None:
        return "There are too few tasks for an interquartile mean."
    return f"The interquartile mean over {found['tasks']} of {found['all_tasks']} tasks is {found['value']:.3f}."


def _counted(found: Report) -> str:
    return f"{found['tasks']} of {found['all_tasks']} tasks" if "tasks" in found else ""


def _task(task: Report) -> Bar:
    note = f"{task['score']['value']:.3g} {task['unit']}"
    return Bar(task["task"], task["normalised"]["value"], *interval_of(task["normalised"]), str(task["kind"]), note)


def _flat(task: Report) -> dict[str, Any]:
    return {
        "task": task["task"],
        "unit": task["unit"],
        "score": task["score"]["value"],
        "score ci95": task["score"]["ci95"],
        "normalised": task["normalised"]["value"],
        "normalised ci95": task["normalised"]["ci95"],
        "zero": task["references"]["zero"],
        "one": task["references"]["one"],
        "worst against": task["worst"],
    }
