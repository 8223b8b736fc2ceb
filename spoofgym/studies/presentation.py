"""Tables on the terminal and the figure of an evaluation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.table import Table

from spoofgym import files
from spoofgym.figures import new_figure

BASELINE, LEARNED, BOUND = "#9a9a9a", "#0072b2", "#d55e00"
BASELINES = ("none", "random", "best-ramp", "closed-form", "optimum", "upper-bound")


def number(value: float | None, form: str = ".1f") -> str:
    """A figure of a table; a dash where there is none."""
    return "–" if value is None else format(value, form)


def plain(name: str) -> str:
    """A name as a label of a figure, where dollar signs would be mathematics."""
    return name.replace("$", r"\$")


def attackers_table(report: dict[str, Any]) -> Table:
    """An ``"attackers"`` report for the terminal."""
    detector = report["detector"]
    arl0 = f", ARL₀ {detector['arl0']:.3g} epochs" if detector["arl0"] else ""
    threshold = f", threshold {detector['threshold']:.4g}" if detector["threshold"] else ""
    table = Table(
        title=f"{report['scenario']}, {report['fidelity']}, {detector['name']}{threshold}{arl0}",
        caption="error: mean undetected horizontal error with 95 % interval; median: time by which half of the games "
        f"had an alarm; at alarm: mean error then; exact: without simulation{_no_optimum(report)}",
        box=None, padding=(0, 2, 0, 0),
    )
    table.add_column("attacker", overflow="fold")
    table.add_column("knows", no_wrap=True)
    for title in ("error\nm", "exact\nm", "detected\n", "median\ns", "at alarm\nm", "of\noptimum"):
        table.add_column(title, justify="right", no_wrap=True)
    for row in report["rows"]:
        error = "–"
        if row["ci95_m"] is not None:
            half = 0.5 * (row["ci95_m"][1] - row["ci95_m"][0])
            error = f"{row['mean_undetected_error_m']:.2f} ±{half:.2f}"
        table.add_row(
            row["attacker"],
            row["knowledge"],
            error,
            number(row["exact_undetected_error_m"], ".2f"),
            number(row["detection_probability"], ".3f"),
            number(row["median_time_to_detect_s"], ".0f"),
            number(row["error_at_detection_m"]),
            number(row["fraction_of_optimum"], ".3f"),
            style="bold" if row["attacker"] not in BASELINES else "",
        )
    return table


def _no_optimum(report: dict[str, Any]) -> str:
    """Why a report has no optimum, where it has none."""
    exact = [row["exact_undetected_error_m"] for row in report["rows"] if row["attacker"] == "optimum"]
    if not exact or any(value is not None for value in exact):
        return ""
    return "; optimum: known for the snapshot test of positions, where the filter knows its sensors"


def aggregates_tables(report: dict[str, Any]) -> list[Table]:
    """The several runs of one setting in a report, taken together; none where there are none."""
    if not report["aggregates"]:
        return []
    table = Table(
        title="runs of one setting together: mean error, m",
        caption="IQM: of the means of the runs, without the lowest and the highest quarter; 95 % intervals by a "
        "bootstrap over runs and games",
        box=None,
        padding=(0, 2, 0, 0),
    )
    table.add_column("runs", overflow="fold")
    for title in ("mean", "95 %", "IQM", "95 %"):
        table.add_column(title, justify="right", no_wrap=True)
    for row in report["aggregates"]:
        where = f"{row['population']}: " if "population" in row else ""
        table.add_row(
            f"{where}{len(row['runs'])}: {', '.join(row['runs'])}",
            f"{row['mean_m']:.3f}",
            _range(row["ci95_m"]),
            f"{row['iqm_m']:.3f}",
            _range(row["iqm_ci95_m"]),
        )
    return [table]


def _range(interval: list[float]) -> str:
    return f"[{interval[0]:.3f}, {interval[1]:.3f}]"


def recorded_table(report: dict[str, Any]) -> Table:
    """A ``"recorded"`` report for the terminal."""
    table = Table(
        title=f"{report['scenario']}, {report['detector']['name']}",
        caption=f"{report['alignment']}\n"
        "clean: horizontal error, normalised innovation squared, alarms and epochs without an attack; then the "
        "time to detect the attack, the error at the alarm, and the largest one if every fix is used"
        + ("; alarms later, back: after the last spoofed fix" if _ends(report) else "")
        + ("; after pull: from its beginning to an alarm" if _pulls(report) else ""),
        box=None,
        padding=(0, 2, 0, 0),
    )
    table.add_column("attack\n", no_wrap=True)
    for title in (
        "clean\nmedian",
        "\n95 %",
        "mean\nNIS",
        "false\nalarms",
        "of\nepochs",
        "found\n",
        "after\ns",
        "error\nm",
        "worst\nm",
    ):
        table.add_column(title, justify="right", no_wrap=True)
    ends = _ends(report)
    further = ("alarms\nlater", "back\ns") if ends else ()
    for title in (*further, *(("after\npull s",) if _pulls(report) else ())):
        table.add_column(title, justify="right", no_wrap=True)
    for row in report["rows"]:
        later = (number(row["alarms_after_end"], "d"), number(row["recovery_s"], ".1f")) if ends else ()
        table.add_row(
            row["attack"],
            number(row["clean_error_median_m"], ".2f"),
            number(row["clean_error_p95_m"], ".2f"),
            number(row["mean_nis"], ".2f"),
            str(row["false_alarms"]),
            str(row["clean_epochs"]),
            "yes" if row["detected"] else "no",
            number(row["time_to_detect_s"], ".1f"),
            number(row["error_at_detection_m"]),
            number(row["max_error_m"]),
            *later,
            *((number(row["alarm_after_pull_s"], ".1f"),) if _pulls(report) else ()),
        )
    return table


def _pulls(report: dict[str, Any]) -> bool:
    """Whether an attack of a ``"recorded"`` report states when its pull begins, and somebody alarms then."""
    return any(row["alarm_after_pull_s"] is not None for row in report["rows"])


def _ends(report: dict[str, Any]) -> bool:
    """Whether an attack of a ``"recorded"`` report ends before the log."""
    return any(row["alarms_after_end"] is not None for row in report["rows"])


def recorded_figure(report: dict[str, Any], path: Path) -> None:
    """Bars of the largest error of each attack on a log, and the error at its alarm, beside that of the clean log."""
    rows = [row for row in report["rows"] if row["max_error_m"] is not None]
    if not rows:
        raise ValueError("the log has no reference within the attacks: there is no error to draw")
    figure = new_figure(8.0, 0.55 * len(rows) + 1.9, dpi=120, layout="constrained")
    axes = figure.add_subplot()
    most = max(row["max_error_m"] for row in rows)
    for place, row in enumerate(reversed(rows)):
        axes.barh(place, row["max_error_m"], color=LEARNED if row["detected"] else BASELINE, height=0.7)
        label = "never detected"
        if row["detected"]:
            label = f"detected after {row['time_to_detect_s']:.1f} s"
            if row["error_at_detection_m"] is not None:
                label += f", at {row['error_at_detection_m']:.1f} m"
                axes.plot(row["error_at_detection_m"], place, "|", color="black", markersize=16)
        inside = row["max_error_m"] > 0.55 * most
        axes.text(
            row["max_error_m"] + (-0.01 if inside else 0.01) * most, place, label, va="center", fontsize=9,
            ha="right" if inside else "left", color="white" if inside else "black",
        )
    clean = rows[0]["clean_error_p95_m"]
    if clean is not None:
        axes.axvline(clean, color=BOUND, linestyle="--", linewidth=1.2, label=f"95 % of the clean log, {clean:.2f} m")
        axes.legend(loc="upper right", fontsize=8, frameon=False, bbox_to_anchor=(1.0, 1.12))
    axes.set_yticks(range(len(rows)), [plain(row["attack"]) for row in reversed(rows)], fontsize=9)
    axes.set_xlabel("largest horizontal error, every fix used, m")
    axes.set_title(plain(f"{report['scenario']}, {report['detector']['name']}"), fontsize=10, loc="left", pad=16)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    files.write_figure(path, figure)


def attackers_figure(report: dict[str, Any], path: Path) -> None:
    """Bars of the undetected error of each attacker, with intervals, beside the optimum and the upper bound."""
    played = [row for row in report["rows"] if row["mean_undetected_error_m"] is not None]
    bounds = {row["attacker"]: row["exact_undetected_error_m"] for row in report["rows"]}
    figure = new_figure(8.0, 0.55 * len(played) + 1.9, dpi=120, layout="constrained")
    axes = figure.add_subplot()
    for place, row in enumerate(reversed(played)):
        mean, (low, high) = row["mean_undetected_error_m"], row["ci95_m"]
        colour = BASELINE if row["attacker"] in BASELINES else LEARNED
        axes.barh(place, mean, color=colour, height=0.7)
        axes.errorbar(mean, place, xerr=[[mean - low], [high - mean]], color="black", capsize=3, linewidth=1)
        fraction = "" if row["fraction_of_optimum"] is None else f", {row['fraction_of_optimum']:.3f} of the optimum"
        label = f"{mean:.1f} m{fraction}, detected {row['detection_probability']:.0%}"
        inside = mean > 0.55 * max(r["mean_undetected_error_m"] for r in played)
        axes.text(
            mean - 0.6 if inside else high + 0.6,
            place,
            label,
            va="center",
            ha="right" if inside else "left",
            color="white" if inside else "black",
            fontsize=9,
        )
    bound = bounds.get("upper-bound")
    if bound is not None:
        axes.axvline(bound, color=BOUND, linestyle="--", linewidth=1.2)
        axes.text(bound, len(played) - 0.4, "upper bound ", color=BOUND, ha="right", va="bottom", fontsize=9)
    labels = [f"{plain(row['attacker'])}\n({row['knowledge']})" for row in reversed(played)]
    axes.set_yticks(range(len(played)), labels, fontsize=9)
    axes.set_xlabel("mean undetected horizontal error, m (95 % interval)")
    title = f"{report['scenario']}, {report['fidelity']}, against {report['detector']['name']}"
    axes.set_title(plain(title), pad=16)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    files.write_figure(path, figure)
