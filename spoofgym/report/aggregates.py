"""Several runs of one setting taken together, where a report has them."""

from __future__ import annotations

from spoofgym.report.figures import Bar, Bars
from spoofgym.report.tables import Report, interval_of


def aggregate_figures(report: Report) -> list[Bars]:
    """Mean and interquartile mean of the runs of each setting; nothing where there are none."""
    rows = report.get("aggregates") or []
    if not rows:
        return []
    bars = []
    for row in rows:
        where = f"{row['population']}: " if "population" in row else ""
        name = f"{where}{len(row['runs'])} runs"
        note = ", ".join(row["runs"])
        bars.append(Bar(f"{name}, mean", row["mean_m"], *interval_of(row, "ci95_m"), "mean", note))
        bars.append(Bar(f"{name}, IQM", row["iqm_m"], *interval_of(row, "iqm_ci95_m"), "interquartile mean", note))
    return [
        Bars(
            title="Runs of one setting together",
            summary="Mean over runs and games, and the mean of the runs without their lowest and highest quarter; the "
            "intervals cover other seeds of the training and other games.",
            unit="mean error, m (95 % interval of a bootstrap)",
            bars=bars,
        )
    ]
