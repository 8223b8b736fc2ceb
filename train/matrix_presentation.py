"""The matrix of detectors and attacks on the terminal, as a heat map, and its ROC and DET curves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from rich.console import Group
from rich.table import Table
from rich.text import Text
from scipy import stats

from spoofgym.arrays import Floats

ENSEMBLE = "ensemble"
COLUMNS = 12
"""Attacks side by side on the terminal."""
CURVES_DRAWN = 6
GREY = "#c8c8c8"
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
DET_TICKS = (0.001, 0.01, 0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 0.999)


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


def _without_arl0(name: str, arl0: float) -> str:
    """The shortest specification that means the same at this ARL₀."""
    for mark in (f",arl0={arl0:g}", f":arl0={arl0:g}", f"/arl0={arl0:g}"):
        name = name.replace(mark, "")
    return name


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
    parts.append(Text("\n".join(ensemble_notes(report))))
    parts.append(
        Text(
            f"{report['scenario']}, {report['fidelity']}, ARL₀ {report['arl0']:g} epochs, {report['episodes']} games "
            "of each attack; intervals, delays and errors at the alarm stand in the JSON."
        )
    )
    return Group(*parts)


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
    """Two heat maps, one below the other: detection probability, and mean undetected error."""
    names = short_names(report)
    detectors, attacks, detected = values(report, "detection_probability")
    _, _, error = values(report, "mean_undetected_error_m")
    width, height = 3.6 + 0.52 * len(attacks), 2.2 + 0.34 * len(detectors)
    figure = Figure(figsize=(width, 2 * height), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    above, below = figure.subplots(2, 1)
    labels = [names[name] for name in detectors]
    _heat(above, labels, attacks, detected, 100.0 * detected, "Blues", 1.0)
    above.set_title(
        f"{report['scenario']}: games with an alarm, %, at ARL₀ = {report['arl0']:g} epochs", loc="left", fontsize=11
    )
    _heat(below, labels, attacks, np.log10(np.maximum(error, 0.1)), error, "Oranges", None)
    below.set_title("mean undetected error, m (0 where an alarm came)", loc="left", fontsize=11)
    figure.supxlabel("\n".join(ensemble_notes(report)), fontsize=8, ha="left", x=0.01)
    figure.savefig(path)


def _heat(
    axes: Axes, rows: list[str], columns: list[str], colour: Floats, text: Floats, palette: str, most: float | None
) -> None:
    """One heat map: coloured by ``colour``, each cell written with ``text``."""
    top = most if most is not None else max(float(np.nanmax(colour)), 1.0)
    bottom = 0.0 if most is not None else -1.0
    axes.imshow(colour, cmap=colormaps[palette], vmin=bottom, vmax=top, aspect="auto")
    for i, j in np.ndindex(text.shape):
        if np.isfinite(text[i, j]):
            dark = (colour[i, j] - bottom) > 0.6 * (top - bottom)
            ink = "white" if dark else "black"
            axes.text(j, i, _figure(float(text[i, j])), ha="center", va="center", fontsize=7.5, color=ink)
    axes.set_xticks(range(len(columns)), columns, rotation=40, ha="right", rotation_mode="anchor", fontsize=8)
    axes.set_yticks(range(len(rows)), rows, fontsize=8)
    axes.tick_params(length=0)
    for side in axes.spines.values():
        side.set_visible(False)


def _figure(value: float) -> str:
    """Two digits that say something."""
    return f"{value:.0f}" if value >= 9.95 or value == 0.0 else f"{value:.1f}"


def curves_figure(report: dict[str, Any], attack: str, path: Path) -> None:
    """ROC and DET of every detector against one attack; the best few with their 95 % intervals, the others in grey.

    Raises:
        ValueError: the report has no curves of this attack.
    """
    curves = [curve for curve in report["curves"] if curve["attack"] == attack and curve["points"]]
    if not curves:
        valid = ", ".join(dict.fromkeys(curve["attack"] for curve in report["curves"]))
        raise ValueError(f"no curves of attack {attack!r}; there are: {valid}")
    names = short_names(report)
    curves.sort(key=_area, reverse=True)
    coloured = curves[:CURVES_DRAWN]
    coloured += [curve for curve in curves[CURVES_DRAWN:] if names[curve["detector"]] == "snapshot"]
    figure = Figure(figsize=(11.5, 5.2), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
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
    roc.set_title(f"ROC, {attack}, {report['scenario']}", loc="left", fontsize=11)
    roc.legend(fontsize=7.5, loc="upper left", framealpha=0.9)
    ticks = stats.norm.ppf(DET_TICKS)
    det.set_xticks(ticks, [f"{100 * p:g}" for p in DET_TICKS])
    det.set_yticks(ticks, [f"{100 * p:g}" for p in DET_TICKS])
    det.set_xlim(ticks[0], ticks[4])
    det.set_ylim(ticks[0], ticks[-1])
    det.set_xlabel("games with a false alarm, %")
    det.set_ylabel("games with the attack missed, %")
    det.set_title("DET; bands: 95 % intervals", loc="left", fontsize=11)
    for axes in (roc, det):
        axes.grid(color="#e6e6e6", linewidth=0.6)
    figure.savefig(path)


def _area(curve: dict[str, Any]) -> float:
    """Mean detection over the logarithm of the false alarms: what the curves are ordered by."""
    return float(np.mean([point["detection_probability"] for point in curve["points"]]))


def _draw(roc: Axes, det: Axes, curve: dict[str, Any], colour: str, label: str | None, order: int) -> None:
    points = curve["points"]
    false_alarm = np.array([point["false_alarm_probability"] for point in points])
    found = np.array([point["detection_probability"] for point in points])
    low, high = np.array([point["detection_ci95"] for point in points]).T
    roc.plot(false_alarm, found, color=colour, linewidth=1.4 if label else 0.8, label=label, zorder=order)
    edge = 1e-4
    x, missed = stats.norm.ppf(false_alarm), stats.norm.ppf(np.clip(1.0 - found, edge, 1.0 - edge))
    det.plot(x, missed, color=colour, linewidth=1.4 if label else 0.8, zorder=order)
    if label:
        roc.fill_between(false_alarm, low, high, color=colour, alpha=0.15, linewidth=0, zorder=order)
        bounds = [stats.norm.ppf(np.clip(1.0 - bound, edge, 1.0 - edge)) for bound in (high, low)]
        det.fill_between(x, bounds[0], bounds[1], color=colour, alpha=0.15, linewidth=0, zorder=order)
