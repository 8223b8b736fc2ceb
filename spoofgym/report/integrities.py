"""Integrity of positions with protection levels: shares of runs with intervals, and Stanford diagrams."""

from __future__ import annotations

from spoofgym.report.figures import Bar, Bars, Figure, Section, Stanford
from spoofgym.report.tables import Report, facts_of, interval_of, table_of

EVENTS = {
    "integrity_failure": "Integrity failures",
    "misleading_information": "Misleading information",
    "hazardously_misleading_information": "Hazardously misleading information",
}


def integrity_sections(report: Report) -> list[Section]:
    """An ``"integrity"`` report: a figure for each kind of event, a Stanford diagram for each row."""
    rows = report["rows"]
    figures: list[Figure] = [_events(rows, name, title) for name, title in EVENTS.items()]
    figures += [stanford_figure(f"{row['user']}: {row['signals']}", row["diagram"]) for row in rows]
    numbers = [{name: value for name, value in row.items() if name != "diagram"} for row in rows]
    figures.append(table_of("All numbers", "A row for each signal and user.", numbers))
    return [Section(f"Integrity on {report['scenario']}", facts_of(report), figures)]


def _events(rows: list[Report], name: str, title: str) -> Bars:
    bars = [
        Bar(f"{row['signals']}: {row['user']}", row[name]["share"], *interval_of(row[name]), str(row["user"]))
        for row in rows
    ]
    most = max(bars, key=lambda bar: bar.value or 0.0)
    return Bars(
        title=title,
        summary=f"The largest share of runs is {most.value:.3g} ({most.label}).",
        unit="share of runs (95 % interval)",
        bars=bars,
    )


def stanford_figure(title: str, diagram: Report) -> Stanford:
    """A Stanford diagram as `StanfordDiagram.content` gives it."""
    regions = diagram["regions"]
    total = max(sum(regions.values()), 1)
    told = ", ".join(f"{name} {100.0 * count / total:.3g} %" for name, count in regions.items())
    return Stanford(
        title=f"Stanford diagram, {title}",
        summary=f"Of {total} epochs without an alarm: {told}. The alert limit is {diagram['alert_limit_m']:g} m.",
        alert_limit=diagram["alert_limit_m"],
        edges=diagram["edges_m"],
        cells=[(error, level, count) for error, level, count in diagram["cells"]],
        regions=list(regions.items()),
    )
