"""The study of real attacks as a heat map: detectors by attacks, coloured by what they find."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from spoofgym import files
from spoofgym.arrays import Floats
from spoofgym.figures import new_figure
from spoofgym.studies.matrix_presentation import (
    CELL,
    LETTER_OF_NOTE,
    LETTER_OF_TITLE,
    LINE,
    MARGIN,
    heat,
    margins,
)
from spoofgym.studies.presentation import plain
from spoofgym.studies.real_attacks_presentation import detectors_of, is_quiet, percent

TITLE = "Games with an alarm (dark = all) and median time to it, s (number), at {share} % false alarms per epoch"
NOTE = (
    "Real attacks first, one game each; then the attacks that are injected into clean logs. Grey: the detector cannot "
    "watch the log, or has no threshold there. Real attack without a number: none, or too many false alarms before it."
)
GREY = "#d9d9d9"


def cells(report: Mapping[str, Any]) -> tuple[list[str], list[str], Floats, Floats]:
    """Detectors, columns (real attacks first, then by attack and log), shares found and delays, (D, C) each.

    NaN where a detector does not watch, or has no delay.
    """
    rows = sorted(report["rows"], key=lambda row: not row["real"])
    words = list(dict.fromkeys(row["attack"] for row in rows))
    pairs = list(dict.fromkeys((row["attack"], row["log"]) for row in rows))
    pairs.sort(key=lambda pair: words.index(pair[0]))
    real = {row["attack"] for row in rows if row["real"]}
    names = detectors_of(report["rows"])
    found, delay = np.full((2, len(names), len(pairs)), np.nan)
    for row in rows:
        place = names.index(row["detector"]), pairs.index((row["attack"], row["log"]))
        found[place] = row["found"] / row["games"]
        told = not row["real"] or is_quiet(row, report["false_alarm_probability"])
        if row["delay_s"] is not None and told:
            delay[place] = row["delay_s"]
    columns = [f"real, {log}" if word in real else f"{word}, {log}" for word, log in pairs]
    return names, columns, found, delay


def real_attacks_figure(report: Mapping[str, Any], path: Path) -> None:
    """Write the heat map.

    Raises:
        ValueError: the report has no rows to draw.
    """
    if not report["rows"]:
        raise ValueError("no log supports this false-alarm rate: there is nothing to draw")
    names, columns, found, delay = cells(report)
    labels = list(map(plain, names))
    left, below = margins(labels, list(map(plain, columns)))
    width = left + CELL[0] * len(columns) + MARGIN
    title = fill(TITLE.format(share=percent(report["false_alarm_probability"])), int(width / LETTER_OF_TITLE))
    note = fill(NOTE, int(width / LETTER_OF_NOTE))
    above, foot = (LINE * (text.count("\n") + 1) + MARGIN for text in (title, note))
    inside = CELL[1] * len(names)
    height = MARGIN + above + inside + below + foot
    figure = new_figure(width, height, dpi=150)
    figure.text(MARGIN / width, 1.0 - MARGIN / height, title, fontsize=11, va="top")
    figure.text(MARGIN / width, MARGIN / height, note, fontsize=8, va="bottom")
    place = (left / width, (foot + below) / height, CELL[0] * len(columns) / width, inside / height)
    axes = figure.add_axes(place)
    axes.set_facecolor(GREY)
    heat(axes, labels, columns, found, delay, "Blues", 1.0)
    files.write_figure(path, figure)
