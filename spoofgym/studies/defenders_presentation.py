"""Tables on the terminal and the figure of an evaluation of defenders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from spoofgym import files
from spoofgym.evaluation.defender_rows import LEARNED_MEAN
from spoofgym.figures import new_figure
from spoofgym.studies.departure_presentation import departures_tables
from spoofgym.studies.presentation import aggregates_tables, number, plain

COLOURS = {
    "learned": "#0072b2",
    "tuned": "#009e73",
    "published": "#6e6e6e",
    "yardstick": "#e69f00",
    "given": "#cc79a7",
}
LABELS = {
    "learned": "learned",
    "tuned": "classical, tuned on the training attacks",
    "published": "published, autopilots",
    "yardstick": "yardsticks",
    "given": "given on the command line",
}
POPULATIONS = {False: "training", True: "held-out"}
COLUMNS = (
    ("mean\nm", "mean_error_m", ".2f"),
    ("RMSE\nm", "rmse_m", ".1f"),
    ("max\nm", "max_error_m", ".1f"),
    ("found\n", "detection_probability", ".3f"),
    ("after\ns", "median_time_to_detect_s", ".0f"),
    ("error\nm", "error_at_detection_m", ".1f"),
    ("re-use\ns", "median_time_to_reuse_s", ".0f"),
    ("never\n", "never_reused_fraction", ".3f"),
    ("clean\nout", "clean_exclusion_fraction", ".4f"),
    ("false\nalarms", "false_alarms_per_epoch", ".1e"),
)
LEGEND = (
    "mean: real-time horizontal error over all decisions of all games, with 95 % interval. RMSE, max: from the onset "
    "on. found, after, error: the first fix excluded during the attack, and the error then. re-use, never: from the "
    "attack's end until GNSS is used without interruption. clean out: share of clean fixes excluded, those after an "
    "attack included. false alarms: exclusions that begin before an attack or without one, per epoch."
)


def defenders_tables(report: dict[str, Any]) -> Group:
    """A ``"defenders"`` report for the terminal: pooled rows, the first learned one by attack, and the comparisons."""
    parts: list[RenderableType] = []
    learned = [name for name, kind in report["kinds"].items() if kind == "learned"]
    for held_out, population in POPULATIONS.items():
        of_set = [row for row in report["rows"] if row["held_out"] == held_out]
        pooled = sorted((row for row in of_set if _is_pooled(row)), key=lambda row: float(row["mean_error_m"]))
        if pooled:
            attacks = report.get("attack") or f"{population} attacks"
            title = f"{report['scenario']}, {report['fidelity']}: {attacks}, half of the games clean"
            parts += [_table(title, "defender", pooled, learned), ""]
            parts += [part for table in departures_tables("defender", pooled, "in whole games") for part in (table, "")]
        if pooled and learned:
            by_attack = [row for row in of_set if row["defender"] == learned[0] and not _is_pooled(row)]
            parts += [_table(f"{learned[0]} by attack: {attacks}", "attack", by_attack, []), ""] if by_attack else []
    parts += [Text(LEGEND, style="dim italic"), ""]
    if report["comparisons"]:
        parts += [_comparisons(report, learned), ""]
    if report["gaps"]:
        parts += [_gaps(report)]
    for table in aggregates_tables(report):
        parts += ["", table]
    return Group(*parts)


def _is_pooled(row: dict[str, Any]) -> bool:
    return str(row["attack"]).startswith("all-")


def _blank(title: str, gap: int = 2) -> Table:
    return Table(title=title, title_justify="left", box=None, padding=(0, gap, 0, 0))


def _table(title: str, key: str, rows: list[dict[str, Any]], bold: list[str]) -> Table:
    table = _blank(title, 1)
    table.add_column(key, overflow="fold")
    for heading, _, _ in COLUMNS:
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        cells = ["0" if row[field] == 0 else number(row[field], form) for _, field, form in COLUMNS]
        cells[0] += f" ±{0.5 * (row['ci95_m'][1] - row['ci95_m'][0]):.2f}"
        table.add_row(row[key], *cells, style="bold" if row["defender"] in bold else "")
    return table


def _comparisons(report: dict[str, Any], learned: list[str]) -> Table:
    """Differences of the learned defender or of the mean of several, and how many of these are better by themselves."""
    subject = learned[0] if len(learned) == 1 else LEARNED_MEAN
    table = _blank(f"{subject} minus baseline: mean error on the same games, m")
    table.caption = "with 95 % interval; bold where it excludes zero in favour of the learned"
    if len(learned) > 1:
        table.caption += f"; better: so many of the {len(learned)}, each by itself"
    table.caption_justify = "left"
    compared = {item["held_out"] for item in report["comparisons"]}
    present = [held_out for held_out in POPULATIONS if held_out in compared]
    table.add_column("baseline", overflow="fold")
    for held_out in present:
        table.add_column(POPULATIONS[held_out], justify="right", no_wrap=True)
        if len(learned) > 1:
            table.add_column("better", justify="right", no_wrap=True)
    for baseline in dict.fromkeys(item["baseline"] for item in report["comparisons"]):
        cells = []
        for held_out in present:
            pairs = {
                item["defender"]: item
                for item in report["comparisons"]
                if item["baseline"] == baseline and item["held_out"] == held_out
            }
            cells.append(_difference(pairs[subject]))
            if len(learned) > 1:
                cells.append(Text(str(sum(pairs[name]["ci95_m"][1] < 0 for name in learned))))
        table.add_row(baseline, *cells)
    return table


def _difference(item: dict[str, Any]) -> Text:
    low, high = item["ci95_m"]
    return Text(f"{item['difference_m']:+.2f} [{low:+.2f}, {high:+.2f}]", style="bold" if high < 0 else "")


def _gaps(report: dict[str, Any]) -> Table:
    first = report["gaps"][0]
    table = _blank(f"gap from {first['from']} to {first['to']}, closed")
    closed = {(item["defender"], item["held_out"]): item["closed"] for item in report["gaps"]}
    present = sorted({item["held_out"] for item in report["gaps"]})
    table.add_column("defender", overflow="fold")
    for held_out in present:
        table.add_column(POPULATIONS[held_out], justify="right", no_wrap=True)
    for name in dict.fromkeys(item["defender"] for item in report["gaps"]):
        style = "bold" if report["kinds"][name] == "learned" else ""
        table.add_row(name, *(number(closed[name, held_out], ".0%") for held_out in present), style=style)
    return table


def defenders_figure(report: dict[str, Any], path: Path) -> None:
    """Mean error of each defender on held-out attacks (else on those of training) with its interval, best on top."""
    pooled = [row for row in report["rows"] if _is_pooled(row)]
    held_out = any(row["held_out"] for row in pooled)
    rows = sorted((row for row in pooled if row["held_out"] == held_out), key=lambda row: -row["mean_error_m"])
    figure = new_figure(8.6, 0.3 * len(rows) + 1.8, dpi=120, layout="constrained")
    axes = figure.add_subplot()
    places = {kind: [i for i, row in enumerate(rows) if report["kinds"][row["defender"]] == kind] for kind in LABELS}
    for kind, of_kind in places.items():
        if of_kind:
            means = [rows[i]["mean_error_m"] for i in of_kind]
            around = [[abs(rows[i]["ci95_m"][end] - rows[i]["mean_error_m"]) for i in of_kind] for end in (0, 1)]
            axes.errorbar(
                means, of_kind, xerr=around, fmt="o", color=COLOURS[kind], capsize=3, label=LABELS[kind], zorder=3
            )
    for place, row in enumerate(rows):
        label = f"{row['mean_error_m']:.2f} m, clean out {row['clean_exclusion_fraction']:.1%}"
        axes.annotate(
            label, (row["ci95_m"][1], place), (7, 0), textcoords="offset points", va="center", fontsize=8
        )
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    axes.set_xscale("log")
    # few games can have an interval that reaches below zero, which a logarithmic axis lacks
    lowest = min(max(row["ci95_m"][0], 0.3 * row["mean_error_m"]) for row in rows)
    axes.set_xlim(0.75 * lowest, 2.6 * max(row["ci95_m"][1] for row in rows))
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.grid(axis="x", color="#e4e4e4", zorder=0)
    axes.set_yticks(range(len(rows)), [plain(row["defender"]) for row in rows], fontsize=8)
    for tick, row in zip(axes.get_yticklabels(), rows, strict=True):
        tick.set_fontweight("bold" if report["kinds"][row["defender"]] == "learned" else "normal")
    axes.set_xlabel("mean horizontal error of the real-time output, m (95 % interval)")
    words = "attacks that no defender was trained on" if held_out else "attacks of the training population"
    words = report.get("attack") or words
    axes.set_title(f"{plain(report['scenario'])}, {report['fidelity']}: {words}")
    axes.legend(loc="upper right", fontsize=8, frameon=True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    files.write_figure(path, figure)
