"""Rows of a report as a table, whatever is in them; kinds of reports that have no figure of their own."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from spoofgym.report.figures import Section, TableFigure

Report = Mapping[str, Any]
INTERVAL = "ci95"
NAMES = {"arl0": "ARL₀, epochs", "episodes": "Games of each", "games": "Games of each"}
UNTOLD = ("schema_version", "kind", "rows", "complete")


def table_of(title: str, summary: str, rows: Sequence[Mapping[str, Any]]) -> TableFigure:
    """A table of rows with the same keys; intervals become two columns, an object one for each of its values.

    Lists are written as JSON.
    """
    flat = [_flat(row) for row in rows]
    columns = list(dict.fromkeys(name for row in flat for name in row))
    return TableFigure(
        title=title, summary=summary, columns=columns, rows=[[row.get(name) for name in columns] for row in flat]
    )


def plain_section(report: Report) -> list[Section]:
    """A report as a table of each list of rows in it; what it has beside them is told above.

    Raises:
        ValueError: there are no rows.
    """
    lists = {name: rows for name, rows in report.items() if _are_rows(rows)}
    if not lists:
        raise ValueError("it has no rows")
    about = next((str(report[name]) for name in ("paper", "scenario", "log", "benchmark") if name in report), "")
    title = capital(str(report["kind"])) + (f": {about}" if about else "")
    sort = "A click on the name of a column sorts them."
    tables = [table_of(capital(name), f"{counted(len(rows), 'row')}. {sort}", rows) for name, rows in lists.items()]
    return [Section(title, facts_of(report), tables)]


def _are_rows(value: object) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(row, Mapping) for row in value)


def capital(name: str) -> str:
    """The name of a value as words."""
    words = name.replace("-", " ").replace("_", " ")
    return words[:1].upper() + words[1:]


def facts_of(report: Report) -> list[tuple[str, str]]:
    """What a report says beside its rows, as text: its plain values by their names."""
    facts = []
    for name, value in report.items():
        if name in UNTOLD or not isinstance(value, str | int | float | bool):
            continue
        text = ("yes" if value else "no") if isinstance(value, bool) else _written(value)
        facts.append((NAMES.get(name, capital(name)), text))
    detector = report.get("detector")
    if isinstance(detector, Mapping):
        threshold = "" if detector["threshold"] is None else f" above {detector['threshold']:.4g}"
        facts.append(("Detector", f"{detector['name']}{threshold}"))
    return facts


def _written(value: str | int | float) -> str:
    return f"{value:.10g}" if isinstance(value, int | float) else value


def interval_of(row: Mapping[str, Any], name: str = "ci95") -> tuple[float | None, float | None]:
    """The ends of an interval; None where there is none."""
    low, high = row.get(name) or (None, None)
    return low, high


def counted(number: int, what: str) -> str:
    """So many of something: 1 row, 2 rows."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def percent(share: float | None) -> float | None:
    """A share as percent."""
    return None if share is None else 100.0 * share


def _flat(row: Mapping[str, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in row.items():
        pair = value is None or (isinstance(value, list) and len(value) == 2)
        if pair and (INTERVAL in name or name == "interval"):
            low, high = value or (None, None)
            flat |= {f"{name} from": low, f"{name} to": high}
        elif value is None or isinstance(value, str | int | float | bool):
            flat[name] = value
        elif isinstance(value, Mapping):
            flat |= {f"{name} {part}": each for part, each in _flat(value).items()}
        else:
            flat[name] = json.dumps(value, ensure_ascii=False)
    return flat
