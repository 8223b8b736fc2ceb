"""Tables on the terminal and the figure of an evaluation of defenders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from rich.console import Group
from rich.table import Table
from rich.text import Text

from train.presentation import number

COLOURS = {
    "learned": "#0072b2",
    "tuned": "#009e73",
    "published": "#9a9a9a",
    "yardstick": "#cfcfcf",
    "given": "#cc79a7",
}
LABELS = {
    "learned": "learned",
    "tuned": "classical, tuned on the training attacks",
    "published": "published, autopilots",
    "yardstick": "yardsticks",
    "given": "given on the command line",
}
COLUMNS = (
    ("mean\nm", "mean_error_m", ".2f"),
    ("RMSE\nm", "rmse_m", ".1f"),
    ("max\nm", "max_error_m", ".1f"),
    ("detect\n", "detection_probability", ".3f"),
    ("after\ns", "median_time_to_detect_s", ".0f"),
    ("error\nm", "error_at_detection_m", ".1f"),
    ("reuse\ns", "median_time_to_reuse_s", ".0f"),
    ("never\n", "never_reused_fraction", ".3f"),
    ("clean\nout", "clean_exclusion_fraction", ".4f"),
    ("false\nalarms", "false_alarms_per_epoch", ".1e"),
)


def defenders_tables(report: dict[str, Any]) -> Group:
    """A ``"defenders"`` report for the terminal: pooled rows, the learned ones by attack, and the comparisons."""
    tables = []
    for held_out, words in ((False, "attacks of the training population"), (True, "held-out attacks")):
        chosen = [row for row in report["rows"] if row["held_out"] == held_out and row["attack"].startswith("all-")]
        if chosen:
            tables.append(_table(f"{report['scenario']}, {report['fidelity']}, {words}", "defender", chosen, report))
    learned = [name for name, kind in report["kinds"].items() if kind == "learned"]
    if learned:
        by_attack = [
            row for row in report["rows"] if row["defender"] == learned[0] and not row["attack"].startswith("all-")
        ]
        tables.append(_table(f"{learned[0]} by attack", "attack", by_attack, report))
        tables.append(_comparisons(report))
    return Group(*tables)


def _table(title: str, key: str, rows: list[dict[str, Any]], report: dict[str, Any]) -> Table:
    table = Table(
        title=title,
        caption="mean: of the real-time error over all games, half of them clean, with 95 % interval; RMSE and max: "
        "from the onset on; detect, after, error: a fix excluded during the attack; reuse, never: GNSS used without "
        "interruption after it; clean out: share of clean fixes excluded",
        box=None,
        padding=(0, 1, 0, 0),
    )
    table.add_column(key, overflow="fold", max_width=26)
    for heading, _, _ in COLUMNS:
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        cells = [number(row[field], form) for _, field, form in COLUMNS]
        cells[0] += f" ±{0.5 * (row['ci95_m'][1] - row['ci95_m'][0]):.2f}"
        bold = key == "defender" and report["kinds"][row["defender"]] == "learned"
        table.add_row(row[key], *cells, style="bold" if bold else "")
    return table


def _comparisons(report: dict[str, Any]) -> Table:
    table = Table(
        title="learned minus baseline, mean error on the same games, m",
        caption="with 95 % interval of the paired difference; bold where it excludes zero in the learned one's favour",
        box=None,
        padding=(0, 2, 0, 0),
    )
    table.add_column("baseline", overflow="fold", max_width=30)
    for title in ("learned", "training", "held-out"):
        table.add_column(title, justify="left" if title == "learned" else "right", no_wrap=True)
    cells: dict[tuple[str, str], dict[bool, Text]] = {}
    for item in report["comparisons"]:
        low, high = item["ci95_m"]
        text = f"{item['difference_m']:+.2f} [{low:+.2f}, {high:+.2f}]"
        cell = Text(text, style="bold" if high < 0 else "")
        cells.setdefault((item["baseline"], item["defender"]), {})[item["held_out"]] = cell
    for (baseline, learned), by_set in cells.items():
        table.add_row(baseline, learned, by_set.get(False, "–"), by_set.get(True, "–"))
    return table


def defenders_figure(report: dict[str, Any], path: Path) -> None:
    """Bars of the mean error of each defender on held-out attacks (else on those of training), with intervals."""
    pooled = [row for row in report["rows"] if row["attack"].startswith("all-")]
    held_out = any(row["held_out"] for row in pooled)
    rows = sorted((row for row in pooled if row["held_out"] == held_out), key=lambda row: row["mean_error_m"])
    figure = Figure(figsize=(8.6, 0.34 * len(rows) + 1.7), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    seen: set[str] = set()
    for place, row in enumerate(reversed(rows)):
        kind = report["kinds"][row["defender"]]
        mean, (low, high) = row["mean_error_m"], row["ci95_m"]
        axes.barh(
            place, mean, color=COLOURS[kind], height=0.72, label=None if kind in seen else LABELS[kind], zorder=2
        )
        seen.add(kind)
        axes.errorbar(mean, place, xerr=[[mean - low], [high - mean]], color="black", capsize=2, linewidth=1, zorder=3)
        axes.text(high * 1.06, place, f"{mean:.2f} m, clean out {row['clean_exclusion_fraction']:.1%}", va="center",
                  fontsize=8)
    axes.set_xscale("log")
    axes.set_xlim(0.8 * rows[0]["mean_error_m"], 3.2 * rows[-1]["mean_error_m"])
    axes.set_yticks(range(len(rows)), [row["defender"] for row in reversed(rows)], fontsize=8)
    axes.set_xlabel("mean horizontal error of the real-time output, m (95 % interval)")
    words = "attacks that no defender was trained on" if held_out else "attacks of the training population"
    axes.set_title(f"{report['scenario']}, {report['fidelity']}: {words}")
    axes.legend(loc="upper right", fontsize=8, frameon=True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    figure.savefig(path)
