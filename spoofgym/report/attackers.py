"""Evaluations of spoofers: undetected errors beside the optimum and the upper bound; attacks on a recorded log."""

from __future__ import annotations

from spoofgym.report.aggregates import aggregate_figures
from spoofgym.report.figures import Bar, Bars, Mark, Section, TableFigure
from spoofgym.report.tables import Report, facts_of, interval_of, table_of
from spoofgym.studies.presentation import BASELINES

BASELINE, PLAYER = "baseline", "player"


def attackers_sections(report: Report) -> list[Section]:
    """An ``"attackers"`` report: bars of the undetected error with intervals, and all numbers."""
    played = [row for row in report["rows"] if row["mean_undetected_error_m"] is not None]
    exact = {row["attacker"]: row["exact_undetected_error_m"] for row in report["rows"]}
    marks = [
        Mark(name.replace("-", " "), exact[name]) for name in ("optimum", "upper-bound") if exact.get(name) is not None
    ]
    title = f"Spoofers on {report['scenario']} against {report['detector']['name']}"
    bars = Bars(
        title="Mean undetected error",
        summary=_summary(played, marks),
        unit="mean undetected horizontal error, m (95 % interval)",
        bars=[_bar(row) for row in played],
        marks=marks,
    )
    return [Section(title, facts_of(report), [bars, *aggregate_figures(report), _numbers(report)])]


def _bar(row: Report) -> Bar:
    low, high = interval_of(row, "ci95_m")
    fraction = row["fraction_of_optimum"]
    notes = [f"detected {row['detection_probability']:.1%}"]
    if fraction is not None:
        notes.insert(0, f"{fraction:.3f} of the optimum")
    group = BASELINE if row["attacker"] in BASELINES else PLAYER
    label = f"{row['attacker']} ({row['knowledge']})"
    return Bar(label, row["mean_undetected_error_m"], low, high, group, ", ".join(notes))


def _summary(played: list[Report], marks: list[Mark]) -> str:
    if not played:
        return "No spoofer was played."
    best = max(played, key=lambda row: float(row["mean_undetected_error_m"]))
    fraction = best["fraction_of_optimum"]
    share = "" if fraction is None else f", {fraction:.3f} of the optimum"
    bounds = "".join(f" The {mark.label} is {mark.value:.1f} m." for mark in marks)
    return (
        f"{best['attacker']} reaches the largest mean undetected error, "
        f"{best['mean_undetected_error_m']:.1f} m{share}, and is detected in {best['detection_probability']:.1%} of "
        f"its games.{bounds}"
    )


def _numbers(report: Report) -> TableFigure:
    return table_of("All numbers", "A row for each spoofer and bound.", report["rows"])


def recorded_sections(report: Report) -> list[Section]:
    """A ``"recorded"`` report: the largest error of each attack, and all numbers."""
    rows = report["rows"]
    found = sum(bool(row["detected"]) for row in rows)
    bars = Bars(
        title="Largest error of each attack",
        summary=f"{found} of {len(rows)} attacks are found.",
        unit="largest horizontal error after the onset, every fix used, m",
        bars=[
            Bar(row["attack"], row["max_error_m"], group="found" if row["detected"] else "not found", note=_found(row))
            for row in rows
        ],
    )
    return [Section(f"Attacks on {report['scenario']}", facts_of(report), [bars, _numbers(report)])]


def _found(row: Report) -> str:
    if not row["detected"]:
        return "not found"
    return f"found after {row['time_to_detect_s']:.4g} s"
