"""Integrity of positions with protection levels: shares of runs with intervals, and Stanford diagrams."""

from __future__ import annotations

from collections.abc import Sequence

from spoofgym.report.figures import Bar, Bars, Diagram, Figure, Section, Stanford
from spoofgym.report.tables import Report, facts_of, interval_of, table_of

EVENTS = {
    "integrity_failure": "Integrity failures",
    "misleading_information": "Misleading information",
    "hazardously_misleading_information": "Hazardously misleading information",
}


def integrity_sections(report: Report) -> list[Section]:
    """An ``"integrity"`` report: a figure for each kind of event, and the Stanford diagrams."""
    rows = report["rows"]
    figures: list[Figure] = [_events(rows, name, title) for name, title in EVENTS.items()]
    figures.append(stanford_figure(rows))
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


def stanford_figure(rows: Sequence[Report]) -> Stanford:
    """The Stanford diagrams of all rows; those of the first replica are shown first, where there is one."""
    diagrams = [_diagram(str(row["user"]), str(row["signals"]), row["diagram"]) for row in rows]
    played = list(dict.fromkeys(each.choice for each in diagrams))
    chosen = played[min(1, len(played) - 1)]
    told = " ".join(f"{each.name}: {_shares(each)}." for each in diagrams if each.choice == chosen)
    return Stanford(
        title="Stanford diagrams",
        summary=f"Epochs without an alarm, by their error and their protection level. Under {chosen!r}: {told}",
        diagrams=diagrams,
        chosen=chosen,
    )


def _diagram(name: str, choice: str, content: Report) -> Diagram:
    """A diagram as `StanfordDiagram.content` gives it."""
    return Diagram(
        name=name,
        choice=choice,
        alert_limit=content["alert_limit_m"],
        edges=content["edges_m"],
        cells=[(error, level, count) for error, level, count in content["cells"]],
        regions=list(content["regions"].items()),
    )


def _shares(diagram: Diagram) -> str:
    total = max(sum(count for _, count in diagram.regions), 1)
    return ", ".join(f"{name} {100.0 * count / total:.3g} %" for name, count in diagram.regions if count) or "no epochs"
