"""Evaluations of defenders: errors with intervals beside the Bayesian bound, by attack, and paired differences."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from spoofgym.report.aggregates import aggregate_figures
from spoofgym.report.figures import Bar, Bars, Figure, Layer, Mark, Matrix, Section
from spoofgym.report.tables import Report, facts_of, interval_of, percent, table_of

POPULATIONS = {False: "training", True: "held-out"}
POOLED = "all-"


def defenders_sections(report: Report, beside: Sequence[Report] = ()) -> list[Section]:
    """A ``"defenders"`` report.

    Args:
        report: of the evaluation.
        beside: other reports of the page, among them bounds of the same scenario.
    """
    figures: list[Figure] = []
    for held_out, population in POPULATIONS.items():
        rows = [row for row in report["rows"] if row["held_out"] == held_out]
        pooled = sorted((row for row in rows if _pooled(row)), key=lambda row: float(row["mean_error_m"]))
        if pooled:
            attacks = report.get("attack") or f"{population} attacks"
            figures.append(_bars(report, pooled, attacks, bounds_of(report["scenario"], population, beside)))
            figures.append(_by_attack(rows, pooled, attacks))
    figures += aggregate_figures(report)
    if report["comparisons"]:
        figures += _differences(report)
    if report["gaps"]:
        summary = "Share of the gap from the best tuned defender of a fixed depth to the best depth in hindsight."
        figures.append(table_of("Gap that is closed", summary, report["gaps"]))
    figures.append(table_of("All numbers", "A row for each defender and attack.", report["rows"]))
    return [Section(f"Defenders on {report['scenario']}", facts_of(report), figures)]


def bounds_of(scenario: str, population: str, beside: Sequence[Report]) -> list[Mark]:
    """Bayesian bounds of a population among other reports."""
    return [
        Mark("Bayesian bound", row["bayesian"]["harm"])
        for report in beside
        if report.get("kind") == "bayesian-bound" and report.get("scenario") == scenario
        for row in report["rows"]
        if row["population"] == population
    ]


def _pooled(row: Report) -> bool:
    return str(row["attack"]).startswith(POOLED)


def _least(rows: list[Report]) -> str:
    """Whose mean error is the least, in a sentence."""
    best = rows[0]
    if len(rows) == 1:
        return f"The mean error of {best['defender']} is {best['mean_error_m']:.2f} m."
    return f"{best['defender']} has the least mean error, {best['mean_error_m']:.2f} m, of {len(rows)} defenders."


def _bars(report: Report, rows: list[Report], attacks: str, marks: list[Mark]) -> Bars:
    bars = []
    for row in rows:
        low, high = interval_of(row, "ci95_m")
        note = f"clean out {row['clean_exclusion_fraction']:.1%}"
        bars.append(Bar(row["defender"], row["mean_error_m"], low, high, report["kinds"][row["defender"]], note))
    bound = "".join(f" The Bayesian bound is {mark.value:.2f} m." for mark in marks)
    return Bars(
        title=f"Mean error, {attacks}",
        summary=f"{_least(rows)}{bound} The axis is logarithmic; “clean out” is the share of clean fixes that are "
        "excluded.",
        unit="mean horizontal error of the real-time output, m (95 % interval)",
        bars=bars,
        marks=marks,
        logarithmic=True,
    )


def _by_attack(rows: list[Report], pooled: list[Report], population: str) -> Matrix:
    defenders = [row["defender"] for row in pooled]
    attacks = list(dict.fromkeys(row["attack"] for row in rows))
    cells = {(row["defender"], row["attack"]): row for row in rows}

    def table(value: Any) -> list[list[float | None]]:
        return [
            [None if (found := cells.get((one, other))) is None else value(found) for other in attacks]
            for one in defenders
        ]

    error = Layer(
        "mean error, m",
        table(lambda row: row["mean_error_m"]),
        table(lambda row: interval_of(row, "ci95_m")[0]),
        table(lambda row: interval_of(row, "ci95_m")[1]),
        logarithmic=True,
    )
    detected = Layer("attacks found, %", table(lambda row: percent(row["detection_probability"])), most=100.0)
    return Matrix(
        title=f"Defenders by attack, {population}",
        summary=f"{len(defenders)} defenders and {len(attacks)} kinds of games; “none” are games without an attack.",
        corner="defender",
        rows=defenders,
        columns=attacks,
        layers=[error, detected],
    )


def _differences(report: Report) -> list[Bars]:
    """A figure for each learned defender or their mean: the paired difference from every baseline."""
    figures = []
    for name in dict.fromkeys(item["defender"] for item in report["comparisons"]):
        pairs = [item for item in report["comparisons"] if item["defender"] == name]
        better = sum(item["ci95_m"][1] < 0 for item in pairs)
        figures.append(
            Bars(
                title=f"{name} minus every other defender",
                summary=f"{name} is better than {better} of {len(pairs)} others, by intervals of paired differences on "
                "the same games that lie below zero.",
                unit="difference of mean errors, m (95 % interval); below zero is better",
                bars=[_difference(item) for item in pairs],
            )
        )
    return figures


def _difference(item: Report) -> Bar:
    low, high = interval_of(item, "ci95_m")
    return Bar(item["baseline"], item["difference_m"], low, high, POPULATIONS[item["held_out"]])
