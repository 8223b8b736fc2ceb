"""The study of real attacks: every detector on every attack and log, and the false alarms of the thresholds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from spoofgym.report.figures import Layer, Matrix, Section
from spoofgym.report.tables import Report, facts_of, interval_of, percent, table_of

Row = Mapping[str, Any]
LAYERS: dict[str, Callable[[Row], float | None]] = {
    "median time to the alarm, s": lambda row: row["delay_s"],
    "error at the alarm, m": lambda row: row["error_at_alarm_m"],
    "largest error unnoticed, m": lambda row: row["undetected_m"],
}
BY_GAME = ("onsets_s", "delays_s", "errors_at_alarm_m", "undetected_by_game_m")
"""What a table of rows leaves to the JSON."""


def real_attacks_sections(report: Report) -> list[Section]:
    """A ``"real-attacks"`` report."""
    rows = [{name: value for name, value in row.items() if name not in BY_GAME} for row in report["rows"]]
    figures = [
        *([_matrix(report)] if rows else []),
        table_of("Clean records", "What each supports.", report["logs"]),
        table_of("False alarms", "By the threshold of the other half of the record.", report["false_alarms"]),
        table_of("Rows", "Medians over the games of an attack, with intervals.", rows),
        table_of("Left out", "And why.", report["left_out"]),
    ]
    return [Section("Real attacks and injected ones", facts_of(report), figures)]


def _matrix(report: Report) -> Matrix:
    cells = {(row["detector"], row["log"], row["attack"]): row for row in report["rows"]}
    detectors = list(dict.fromkeys(row["detector"] for row in report["rows"]))
    columns = list(dict.fromkeys((row["log"], row["attack"]) for row in report["rows"]))

    def table(value: Callable[[Row], float | None]) -> list[list[float | None]]:
        found = [[cells.get((name, *column)) for column in columns] for name in detectors]
        return [[None if row is None else value(row) for row in line] for line in found]

    shares = Layer(
        "games with an alarm, %",
        table(lambda row: percent(row["found"] / row["games"])),
        table(lambda row: percent(interval_of(row, "found_ci95")[0])),
        table(lambda row: percent(interval_of(row, "found_ci95")[1])),
        most=100.0,
    )
    others = [Layer(name, table(value), logarithmic=name.endswith("m")) for name, value in LAYERS.items()]
    return Matrix(
        title="Every detector on every attack",
        summary=f"{len(detectors)} detectors at {100.0 * report['false_alarm_probability']:g} % false alarms an epoch; "
        f"a real attack is one game, an injected one {report['games']} along its log. A click on a name sorts by it.",
        corner="detector",
        rows=detectors,
        columns=[f"{log}: {attack}" for log, attack in columns],
        layers=[shares, *others],
    )
