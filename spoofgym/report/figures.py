"""What a page can show: each kind of figure is a data class, and a file of ``assets/`` draws it.

A figure is given to the page as plain values (`content`), so that names and numbers are data there and never HTML.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, ClassVar

SIGNIFICANT = 6
"""Digits of the numbers in a page."""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """What all figures have.

    Attributes:
        type: which function of the page draws it.
        title: above it.
        summary: what it shows, in plain sentences; it stands below the figure, and a screen reader reads it instead.
    """

    type: ClassVar[str]
    title: str
    summary: str

    def content(self) -> dict[str, Any]:
        """Plain values for the page; title and summary are written as text."""
        values = {item.name: plain(getattr(self, item.name)) for item in fields(self)}
        return {"type": self.type, **{name: value for name, value in values.items() if name != "summary"}}


@dataclass(frozen=True)
class Bar:
    """A bar or a point with an interval.

    Attributes:
        label: whose.
        value: its length; None = nothing was measured.
        low: of the interval; None = there is none.
        high: of the interval.
        group: what it belongs to; groups have colours and marks.
        note: written behind the value.
    """

    label: str
    value: float | None
    low: float | None = None
    high: float | None = None
    group: str = ""
    note: str = ""


@dataclass(frozen=True)
class Mark:
    """A line across bars: an optimum or a bound."""

    label: str
    value: float


@dataclass(frozen=True, kw_only=True)
class Bars(Figure):
    """Horizontal bars with intervals, and lines for optima and bounds.

    Attributes:
        unit: of the values, with what they are.
        bars: from the top.
        marks: lines across all bars.
        logarithmic: whether the axis is; points are then drawn instead of bars.
    """

    type: ClassVar[str] = "bars"
    unit: str
    bars: Sequence[Bar]
    marks: Sequence[Mark] = ()
    logarithmic: bool = False


@dataclass(frozen=True)
class Layer:
    """A figure of every pair of a matrix.

    Attributes:
        name: what it is, with its unit.
        values: a list for each row; None = nothing was measured.
        low: of the intervals, as the values; None = there are none.
        high: of the intervals.
        logarithmic: whether colours follow the logarithm.
        most: value of the strongest colour; None = the largest.
    """

    name: str
    values: Sequence[Sequence[float | None]]
    low: Sequence[Sequence[float | None]] | None = None
    high: Sequence[Sequence[float | None]] | None = None
    logarithmic: bool = False
    most: float | None = None


@dataclass(frozen=True, kw_only=True)
class Matrix(Figure):
    """A table of pairs whose rows and columns can be sorted.

    Attributes:
        corner: what rows and columns are.
        rows: names.
        columns: names.
        layers: figures of all pairs, of which the reader chooses one.
        row_weights: of each row, by layer; None = there are none.
        column_weights: of each column, by layer.
        weighted: what a weight is.
        frames: whether the layers are moments, one after the other, instead of different figures.
    """

    type: ClassVar[str] = "matrix"
    corner: str
    rows: Sequence[str]
    columns: Sequence[str]
    layers: Sequence[Layer]
    row_weights: Sequence[Sequence[float | None]] | None = None
    column_weights: Sequence[Sequence[float | None]] | None = None
    weighted: str = ""
    frames: bool = False


@dataclass(frozen=True)
class Curve:
    """A detector's curve for an attack.

    Attributes:
        name: of the detector.
        choice: of the attack.
        x: false-alarm probabilities.
        y: detection probabilities.
        low: of the interval of y.
        high: of the interval of y.
    """

    name: str
    choice: str
    x: Sequence[float]
    y: Sequence[float]
    low: Sequence[float]
    high: Sequence[float]


@dataclass(frozen=True, kw_only=True)
class Curves(Figure):
    """ROC and DET curves side by side; the reader chooses the attack.

    Attributes:
        curves: of all attacks and detectors.
        chosen: the attack that is shown first.
    """

    type: ClassVar[str] = "curves"
    curves: Sequence[Curve]
    chosen: str


@dataclass(frozen=True)
class Line:
    """A line with an interval around it.

    Attributes:
        name: of the line.
        y: by the x of the figure; None = nothing is known.
        low: of the interval; None = there is none.
        high: of the interval.
        faint: whether it is one of several of which another line is the mean.
    """

    name: str
    y: Sequence[float | None]
    low: Sequence[float | None] | None = None
    high: Sequence[float | None] | None = None
    faint: bool = False


@dataclass(frozen=True, kw_only=True)
class Lines(Figure):
    """Lines over a common axis, drawn by uPlot.

    Attributes:
        x_label: of the axis.
        y_label: with the unit.
        x: increasing.
        lines: in order.
        whole: whether only whole numbers of x are marked.
    """

    type: ClassVar[str] = "lines"
    x_label: str
    y_label: str
    x: Sequence[float]
    lines: Sequence[Line]
    whole: bool = False


@dataclass(frozen=True, kw_only=True)
class Diagram:
    """A Stanford diagram: error, protection level and alert limit of epochs.

    Attributes:
        name: of whose protection level it is.
        choice: of what was played.
        alert_limit: m.
        edges: of the cells, m.
        cells: (error cell, level cell, epochs) where there are any.
        regions: name and epochs of each region.
    """

    name: str
    choice: str
    alert_limit: float
    edges: Sequence[float]
    cells: Sequence[tuple[int, int, int]]
    regions: Sequence[tuple[str, int]]


@dataclass(frozen=True, kw_only=True)
class Stanford(Figure):
    """Stanford diagrams side by side; the reader chooses what was played.

    Attributes:
        diagrams: of all that was played.
        chosen: what is shown first.
    """

    type: ClassVar[str] = "stanford"
    diagrams: Sequence[Diagram]
    chosen: str


@dataclass(frozen=True, kw_only=True)
class TableFigure(Figure):
    """A table whose rows can be sorted.

    Attributes:
        columns: their names.
        rows: a value for each column: text, number, truth value or None.
    """

    type: ClassVar[str] = "table"
    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]


@dataclass(frozen=True, kw_only=True)
class GameFigure(Figure):
    """A played game: ground track, error, innovation, statistics and decisions on one time axis.

    Attributes:
        game: as `GameTrace.to_json` gives it.
    """

    type: ClassVar[str] = "game"
    game: dict[str, Any]


@dataclass(frozen=True)
class Section:
    """A part of the page, made of one source.

    Attributes:
        title: above it.
        facts: what was played, by name.
        figures: in order.
    """

    title: str
    facts: Sequence[tuple[str, str]]
    figures: Sequence[Figure] = field(default=())


def plain(value: Any) -> Any:
    """Values as JSON has them: data classes as objects, numbers rounded, what is not finite as null."""
    if is_dataclass(value) and not isinstance(value, type):
        return {item.name: plain(getattr(value, item.name)) for item in fields(value)}
    if isinstance(value, dict):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    if isinstance(value, float):
        if not math.isfinite(value):
            return None
        return float(f"{value:.{SIGNIFICANT}g}") if abs(value) < 10 ** (SIGNIFICANT - 1) else round(value, 3)
    return value
