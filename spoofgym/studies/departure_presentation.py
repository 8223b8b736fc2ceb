"""The table of vehicles that leave their paths, below that of an evaluation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.table import Table

from spoofgym.studies.presentation import number


def departures_tables(key: str, rows: Sequence[dict[str, Any]], until: str) -> list[Table]:
    """A table of the rows with an entry ``deviation``; none where the vehicles keep their paths.

    Args:
        key: of a row's name.
        rows: of a report.
        until: when the figures end, for the legend.
    """
    found = [row for row in rows if "deviation" in row]
    if not found:
        return []
    table = Table(
        title=f"the vehicle, steered by its estimate in a corridor of {found[0]['deviation']['corridor_m']:g} m",
        caption=f"largest: mean of each game's largest distance from the path {until}, with 95 % interval; outside: "
        "mean time outside the corridor; left: share of games that leave it, with exact 95 % interval",
        box=None, padding=(0, 2, 0, 0),
    )
    table.add_column(f"{key}\n", overflow="fold")
    for title in ("largest\nm", "outside\ns", "left\n", "\n95 %"):
        table.add_column(title, justify="right", no_wrap=True)
    for row in found:
        of, (low, high) = row["deviation"], row["deviation"]["largest_ci95_m"]
        half = f" ±{0.5 * (high - low):.2f}" if high > low else ""
        least, most = of["left_corridor_ci95"]
        table.add_row(
            row[key],
            f"{of['largest_m']:.2f}{half}",
            number(of["time_outside_s"], ".1f"),
            number(of["left_corridor"], ".3f"),
            f"{least:.3f}-{most:.3f}",
        )
    return [table]
