"""The matrix of detectors and attacks on the terminal, as a heat map, and its ROC and DET curves."""

from __future__ import annotations

from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text
from scipy import stats

from spoofgym import files
from spoofgym.arrays import Floats
from spoofgym.figures import new_figure
from spoofgym.studies.presentation import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ENSEMBLE = "ensemble"
COLUMNS = 12
"""Attacks side by side on the terminal."""
CELL = (0.40, 0.27)
"""Width and height of a cell of the heat maps, inches: three digits of 9 pt, which a page shows at 8 to 11 pixels."""
LETTER, LETTER_OF_TITLE, LETTER_OF_NOTE = 0.076, 0.088, 0.064
"""Mean widths of a letter of 9, 11 and 8 pt, inches, on the safe side."""
LINE, MARGIN, LEAST_WIDTH, ANGLE = 0.19, 0.12, 4.5, 50.0
"""Height of a line of a title, space around things, and least width of the figure, inches; of column names, degrees."""
CURVES_DRAWN = 6
LEAST_ALARMS = 10
"""Clean games with an alarm that a point must stand on to be drawn: its share is then known within a factor of 2."""
LUMA = np.array([0.299, 0.587, 0.114])
"""Share of red, green and blue in the brightness of a colour (ITU-R BT.601)."""
GREY = "#c8c8c8"
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
DET_TICKS = (0.001, 0.005, 0.01, 0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 0.999)


def short_names(report: dict[str, Any]) -> dict[str, str]:
    """Names without the ARL₀ that all have in common; ensembles by a letter where there are several."""
    names = {item["name"]: _without_arl0(item["name"], report["arl0"]) for item in report["detectors"]}
    ensembles = [name for name, short in names.items() if short.startswith(ENSEMBLE)]
    for letter, name in zip("ABCDEFGHIJKLMNOPQRSTUVWXYZ", ensembles, strict=False):
        names[name] = ENSEMBLE if len(ensembles) == 1 else f"{ENSEMBLE} {letter}"
    return names


def ensemble_notes(report: dict[str, Any]) -> list[str]:
    """A line for each ensemble: what it is made of."""
    notes = []
    for name, short in short_names(report).items():
        if short.startswith(ENSEMBLE):
            notes.append(f"{short}: {_without_arl0(name, report['arl0']).partition(':')[2].replace('+', ' + ')}")
    return notes


def _without_arl0(name: str, arl0: float | None) -> str:
    """The shortest specification that means the same at this ARL₀."""
    if arl0 is None:
        return name
    name = name.replace(f":arl0={arl0:g},", ":").replace(f":arl0={arl0:g}/", ":")
    for mark in (f",arl0={arl0:g}", f":arl0={arl0:g}", f"/arl0={arl0:g}"):
        name = name.replace(mark, "")
    return name


def common_rate(report: dict[str, Any]) -> str:
    """The false-alarm rate that all detectors of a matrix have."""
    if report["arl0"] is None:
        return f"a false-alarm probability of {report['false_alarm_probability']:g} per epoch of clean games"
    return f"ARL₀ {report['arl0']:g} epochs"


def values(report: dict[str, Any], key: str) -> tuple[list[str], list[str], Floats]:
    """Detectors, attacks, and a figure of each pair, (D, A); NaN where there is none."""
    detectors = [item["name"] for item in report["detectors"]]
    attacks = list(dict.fromkeys(row["attack"] for row in report["rows"]))
    table = np.full((len(detectors), len(attacks)), np.nan)
    for row in report["rows"]:
        if row[key] is not None:
            table[detectors.index(row["detector"]), attacks.index(row["attack"])] = row[key]
    return detectors, attacks, table


def matrix_tables(report: dict[str, Any]) -> Group:
    """A ``"matrix"`` report for the terminal: percent detected and mean undetected error, attacks by number."""
    names = short_names(report)
    detectors, attacks, _ = values(report, "detection_probability")
    parts: list[Table | Text] = []
    panels = (
        ("games with an alarm, %", "detection_probability", 100.0),
        ("mean undetected error, m", "mean_undetected_error_m", 1.0),
    )
    for title, key, scale in panels:
        figures = scale * values(report, key)[2]
        for first in range(0, len(attacks), COLUMNS):
            columns = range(first, min(first + COLUMNS, len(attacks)))
            parts.append(_block(title, [names[name] for name in detectors], columns, figures))
    parts.append(Text("\n".join(f"{place:>3} {attack}" for place, attack in enumerate(attacks))))
    if report["learned"]:
        parts.append(learned_table(report))
    parts.append(Text("\n".join(ensemble_notes(report))))
    parts.append(
        Text(
            f"{report['scenario']}, {report['fidelity']}, {common_rate(report)}, {report['episodes']} games "
            "of each attack; intervals, delays and errors at the alarm stand in the JSON."
        )
    )
    parts += [Text(f"left out: {line}") for line in report.get("left_out", ())]
    return Group(*parts)


def learned_table(report: dict[str, Any]) -> Table:
    """Learned spoofers by what they were trained against: the mean over their seeds, and the range in brackets."""
    names = short_names(report)
    ensembles = [name for name, short in names.items() if short.startswith(ENSEMBLE)]
    table = Table(box=None, padding=(0, 1, 0, 0))
    heads = ("seeds", "undetected error, m", "detected by it, %", "best other attack, m")
    table.add_column("\ntrained against", no_wrap=True)
    for name in (*heads, *(f"by {names[name]}, %" for name in ensembles)):
        table.add_column(f"\n{name}", justify="right")
    for row in report["learned"]:
        error = f"{row['mean_undetected_error_m']:.1f}"
        if len(row["policies"]) > 1:
            error += f" [{row['least_m']:.1f}, {row['most_m']:.1f}]"
        detected = [_percent(row["detection"][name]) for name in (row["trained_against"], *ensembles)]
        other = f"{row['best_other_m']:.1f} ({row['best_other_attack']})"
        own = names[row["trained_against"]]
        table.add_row(own, str(len(row["policies"])), error, detected[0], other, *detected[1:])
    return table


def _percent(shares: list[float]) -> str:
    mean = f"{100.0 * np.mean(shares):.1f}"
    return mean if len(shares) == 1 else f"{mean} [{100.0 * min(shares):.1f}, {100.0 * max(shares):.1f}]"


def _block(title: str, rows: list[str], columns: range, figures: Floats) -> Table:
    """Some columns of a figure, (D, A)."""
    table = Table(box=None, padding=(0, 1, 0, 0))
    table.add_column(f"\n{title}", no_wrap=True)
    for place in columns:
        table.add_column(f"\n{place}", justify="right", no_wrap=True, min_width=3)
    for name, line in zip(rows, figures, strict=True):
        table.add_row(name, *(_figure(float(line[place])) for place in columns))
    return table


def matrix_figure(report: dict[str, Any], path: Path) -> None:
    """Two heat maps, one below the other: detection probability, and mean undetected error.

    Sizes are in inches and follow from the texts, so that cells keep theirs whatever the number of rows and columns.
    """
    names = short_names(report)
    detectors, attacks, detected = values(report, "detection_probability")
    _, _, error = values(report, "mean_undetected_error_m")
    labels = [plain(names[name]) for name in detectors]
    left, below = margins(labels, list(map(plain, attacks)))
    width = max(left + CELL[0] * len(attacks) + MARGIN, LEAST_WIDTH)
    titles = [
        f"{plain(report['scenario'])}: games with an alarm, %, at {common_rate(report)} "
        "(none: clean games, false alarms)",
        "Mean undetected error, m; 0 where an alarm came (none: the clean error of navigation)",
    ]
    above = [fill(title, int(width / LETTER_OF_TITLE)) for title in titles]
    notes = "\n".join(fill(note, int(width / LETTER_OF_NOTE)) for note in ensemble_notes(report))
    rooms = [LINE * (text.count("\n") + 1) + MARGIN for text in above]
    cells = CELL[1] * len(detectors)
    foot = LINE * (notes.count("\n") + 1) if notes else 0.0
    height = sum(rooms) + 2 * (cells + below) + foot + MARGIN
    figure = new_figure(width, height, dpi=150)
    top = height - MARGIN
    shown = (
        (detected, 100.0 * detected, "Blues", 1.0),
        (np.log10(np.maximum(error, 0.1)), error, "Oranges", None),
    )
    for title, room, (colour, text, palette, most) in zip(above, rooms, shown, strict=True):
        figure.text(MARGIN / width, top / height, title, fontsize=11, va="top")
        bottom = top - room - cells
        place = (left / width, bottom / height, CELL[0] * len(attacks) / width, cells / height)
        heat(figure.add_axes(place), labels, attacks, colour, text, palette, most)
        top = bottom - below
    figure.text(MARGIN / width, MARGIN / height, notes, fontsize=8, va="bottom")
    files.write_figure(path, figure)


def margins(rows: list[str], columns: list[str]) -> tuple[float, float]:
    """Left of the cells and below them, inches: the labels of the rows, and those of the columns at their angle."""
    lengths = [LETTER * len(name) for name in columns]
    slope = np.radians(ANGLE)
    leftwards = max(length * np.cos(slope) - CELL[0] * (place + 0.5) for place, length in enumerate(lengths))
    return (
        max(LETTER * max(map(len, rows)), leftwards) + MARGIN,
        max(lengths) * np.sin(slope) + 2 * MARGIN,
    )


def heat(
    axes: Axes, rows: list[str], columns: list[str], colour: Floats, text: Floats, palette: str, most: float | None
) -> None:
    """One heat map: coloured by ``colour``, each cell written with ``text``."""
    from matplotlib import colormaps

    top = most if most is not None else max(float(np.nanmax(colour)), 1.0)
    bottom = 0.0 if most is not None else -1.0
    axes.imshow(colour, cmap=colormaps[palette], vmin=bottom, vmax=top, aspect="auto")
    brightness = colormaps[palette]((colour - bottom) / (top - bottom))[..., :3] @ LUMA
    for i, j in np.ndindex(text.shape):
        if np.isfinite(text[i, j]):
            ink = "white" if brightness[i, j] < 0.45 else "black"
            axes.text(j, i, _figure(float(text[i, j])), ha="center", va="center", fontsize=9, color=ink)
    names = list(map(plain, columns))
    axes.set_xticks(range(len(names)), names, rotation=ANGLE, ha="right", rotation_mode="anchor", fontsize=9)
    axes.set_yticks(range(len(rows)), list(map(plain, rows)), fontsize=9)
    axes.set_xticks(np.arange(0.5, len(columns) - 1), minor=True)
    axes.set_yticks(np.arange(0.5, len(rows) - 1), minor=True)
    axes.grid(which="minor", color="white", linewidth=0.8)
    axes.tick_params(which="both", length=0)
    for side in axes.spines.values():
        side.set_visible(False)


def _figure(value: float) -> str:
    """Two digits that say something."""
    return f"{value:.0f}" if value >= 9.95 or value == 0.0 else f"{value:.1f}"


def drawn_curves(report: dict[str, Any], attack: str) -> list[dict[str, Any]]:
    """The curves of an attack, of the points that `LEAST_ALARMS` clean games or more stand behind.

    Raises:
        ValueError: the report has no curves of this attack, or none with such a point.
    """
    names = list(dict.fromkeys(curve["attack"] for curve in report["curves"]))
    if attack not in names:
        raise ValueError(f"no curves of attack {attack!r}; there are: {', '.join(names)}")
    least = (LEAST_ALARMS - 0.5) / report["episodes"]
    curves = []
    for curve in report["curves"]:
        points = [point for point in curve["points"] if point["false_alarm_probability"] > least]
        if curve["attack"] == attack and points:
            curves.append({**curve, "points": points})
    if not curves:
        raise ValueError(
            f"no curve of attack {attack!r} has a point with {LEAST_ALARMS} clean alarms in {report['episodes']} "
            "games: raise --episodes"
        )
    return curves


def curves_figure(report: dict[str, Any], attack: str, path: Path) -> None:
    """ROC and DET of every detector against one attack; the best few with their 95 % intervals, the others in grey.

    Raises:
        ValueError: the report has no curves of this attack, or none with enough clean alarms.
    """
    curves = drawn_curves(report, attack)
    names = short_names(report)
    curves.sort(key=_area, reverse=True)
    coloured = curves[:CURVES_DRAWN]
    coloured += [curve for curve in curves[CURVES_DRAWN:] if names[curve["detector"]] == "snapshot"]
    figure = new_figure(11.5, 5.2, dpi=120, layout="constrained")
    roc, det = figure.subplots(1, 2)
    for curve in curves:
        if curve not in coloured:
            _draw(roc, det, curve, GREY, None, 0)
    for place, curve in enumerate(coloured):
        colour = COLOURS[place] if place < len(COLOURS) else "black"
        _draw(roc, det, curve, colour, names[curve["detector"]], 2)
    roc.set_xscale("log")
    roc.set_xlabel("games with a false alarm")
    roc.set_ylabel("games with the attack detected")
    roc.set_title(plain(f"ROC, {attack}, {report['scenario']}"), loc="left", fontsize=11)
    roc.legend(fontsize=7.5, loc="upper left", framealpha=0.9)
    ticks = stats.norm.ppf(DET_TICKS)
    det.set_xticks(ticks, [f"{100 * p:g}" for p in DET_TICKS])
    det.set_yticks(ticks, [f"{100 * p:g}" for p in DET_TICKS])
    least = min(point["false_alarm_probability"] for curve in curves for point in curve["points"])
    det.set_xlim(stats.norm.ppf(least), ticks[DET_TICKS.index(0.5)])
    det.set_ylim(ticks[0], ticks[-1])
    det.set_xlabel("games with a false alarm, %")
    det.set_ylabel("games with the attack missed, %")
    det.set_title("DET; bands and bars: 95 % intervals", loc="left", fontsize=11)
    for axes in (roc, det):
        axes.grid(color="#e6e6e6", linewidth=0.6)
    files.write_figure(path, figure)


def _area(curve: dict[str, Any]) -> float:
    """Mean detection over the logarithm of the false alarms: what the curves are ordered by."""
    return float(np.mean([point["detection_probability"] for point in curve["points"]]))


def _draw(roc: Axes, det: Axes, curve: dict[str, Any], colour: str, label: str | None, order: int) -> None:
    points = curve["points"]
    false_alarm = np.array([point["false_alarm_probability"] for point in points])
    found = np.array([point["detection_probability"] for point in points])
    low, high = np.array([point["detection_ci95"] for point in points]).T
    label = None if label is None else plain(label)
    roc.plot(false_alarm, found, color=colour, linewidth=1.4 if label else 0.8, label=label, zorder=order)
    edge = 1e-4
    x, missed = stats.norm.ppf(false_alarm), stats.norm.ppf(np.clip(1.0 - found, edge, 1.0 - edge))
    det.plot(x, missed, color=colour, linewidth=1.4 if label else 0.8, zorder=order)
    if label:
        bars = np.array([point["false_alarm_ci95"] for point in points]).T
        roc.hlines(found, *bars, color=colour, alpha=0.4, linewidth=0.8, zorder=order)
        det.hlines(missed, *stats.norm.ppf(bars), color=colour, alpha=0.4, linewidth=0.8, zorder=order)
        roc.fill_between(false_alarm, low, high, color=colour, alpha=0.15, linewidth=0, zorder=order)
        bounds = [stats.norm.ppf(np.clip(1.0 - bound, edge, 1.0 - edge)) for bound in (high, low)]
        det.fill_between(x, bounds[0], bounds[1], color=colour, alpha=0.15, linewidth=0, zorder=order)
