"""The Stanford diagram: how error, protection level and alert limit stand to each other, epoch by epoch."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spoofgym import files, validation
from spoofgym.arrays import Flags, Floats, Runs
from spoofgym.figures import new_figure

NOMINAL, MISLEADING, HAZARDOUS, UNAVAILABLE = range(4)
NAMES = ("nominal", "misleading", "hazardously misleading", "unavailable")
COLOURS = ("#ffffff", "#fbe3c0", "#f3b8ae", "#e6e6e6")
"""Of the four regions, in the order of `NAMES`."""
COLOUR_MAP = "viridis_r"
"""Of the cells: epochs where there are few are bright, like the regions about them."""
CELLS_TO_LIMIT = 40
"""Cells of the diagram from zero to the alert limit."""
REACH = 1.5
"""The diagram ends at so many alert limits; what lies beyond is counted in its last cells."""


@dataclass(frozen=True)
class StanfordDiagram:
    """Counts of epochs over error and protection level.

    Attributes:
        alert_limit: m.
        edges: of the cells, the same on both axes, (B + 1,), m; the alert limit is one of them.
        counts: by error and protection level, (B, B); the last row and the last column reach to infinity.
        regions: epochs in each region, in the order of `NAMES`, (4,); exact, while cells on the diagonal hold two.
        unavailable_misleading: epochs of the unavailable ones whose error is beyond the protection level, too.
    """

    alert_limit: float
    edges: Floats
    counts: Runs
    regions: Runs
    unavailable_misleading: int


def region(error: Floats, protection_level: Floats, alert_limit: float) -> Runs:
    """The region of each epoch, one of four, of the shape of ``error``.

    nominal: |e| <= PL <= AL; misleading: PL < |e| <= AL; hazardously misleading: PL <= AL < |e|; unavailable: AL < PL.
    """
    size = np.abs(error)
    available = np.where(size > alert_limit, HAZARDOUS, np.where(size > protection_level, MISLEADING, NOMINAL))
    return np.where(protection_level > alert_limit, UNAVAILABLE, available).astype(np.int64)


def stanford_diagram(
    error: Floats, protection_level: Floats, alert_limit: float, alarm: Flags | None = None
) -> StanfordDiagram:
    """Count epochs.

    Args:
        error: of the position, signed or not, any shape, m.
        protection_level: of the same shape, m; infinite where there is none.
        alert_limit: m.
        alarm: of the same shape; epochs with one are left out, for nobody is misled.

    Raises:
        ValueError: a shape or a value does not fit.
    """
    error, protection_level = checked("stanford", error, protection_level, alert_limit)
    alarmed = np.zeros(error.shape, dtype=np.bool_) if alarm is None else np.asarray(alarm, dtype=np.bool_)
    if alarmed.shape != error.shape:
        raise ValueError(f"stanford: alarm must have the shape {error.shape}, got {alarmed.shape}")
    used = ~alarmed
    size, level = np.abs(error[used]), protection_level[used]
    edges = float(alert_limit) / CELLS_TO_LIMIT * np.arange(round(REACH * CELLS_TO_LIMIT) + 1, dtype=np.float64)
    edges[CELLS_TO_LIMIT] = alert_limit
    counts = np.zeros((len(edges) - 1, len(edges) - 1), dtype=np.int64)
    np.add.at(counts, (_cell(size, edges), _cell(level, edges)), 1)
    regions = region(size, level, alert_limit)
    return StanfordDiagram(
        alert_limit=float(alert_limit),
        edges=edges,
        counts=counts,
        regions=np.bincount(regions, minlength=len(NAMES)).astype(np.int64),
        unavailable_misleading=int(np.count_nonzero((regions == UNAVAILABLE) & (size > level))),
    )


def checked(owner: str, error: Floats, protection_level: Floats, alert_limit: float) -> tuple[Floats, Floats]:
    """Error and protection level as arrays.

    Raises:
        ValueError: a shape or a value does not fit.
    """
    validation.above(owner, "alert_limit", alert_limit)
    error, level = np.asarray(error, dtype=np.float64), np.asarray(protection_level, dtype=np.float64)
    if error.shape != level.shape or error.size == 0:
        raise ValueError(
            f"{owner}: error and protection_level must have one shape and hold something, got {error.shape} and "
            f"{level.shape}"
        )
    if not np.all(np.isfinite(error)):
        raise ValueError(f"{owner}: error must be finite, got {error[~np.isfinite(error)][0]!r}")
    if not np.all(level >= 0.0):
        raise ValueError(f"{owner}: protection_level must be 0 or more, got {level[~(level >= 0.0)][0]!r}")
    return error, level


def _cell(values: Floats, edges: Floats) -> Runs:
    """The cell whose upper edge is the first that is not exceeded: a value on the alert limit is not beyond it."""
    return np.clip(np.searchsorted(edges, values, side="left") - 1, 0, len(edges) - 2)


def draw(diagram: StanfordDiagram, path: Path, title: str = "") -> None:
    """Write the picture to a file: PNG, SVG or PDF by its ending.

    Args:
        diagram: from `stanford_diagram`.
        path: of the file.
        title: above the picture.

    Raises:
        ImportError: matplotlib is missing.
    """
    draw_side_by_side({title: diagram}, path)


def draw_side_by_side(diagrams: dict[str, StanfordDiagram], path: Path, heading: str = "") -> None:
    """Write one picture of several diagrams, which share the colours of their cells.

    Args:
        diagrams: by their titles, from left to right.
        path: of the file.
        heading: above all.

    Raises:
        ImportError: matplotlib is missing.
        ValueError: there is no diagram.
    """
    if not diagrams:
        raise ValueError("stanford: there must be a diagram to draw, got none")
    path = Path(path)
    figure = new_figure(1.2 + 6.0 * len(diagrams), 6.0, dpi=150, layout="constrained")
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm

    most = max(2, max(int(diagram.counts.max()) for diagram in diagrams.values()))
    norm = LogNorm(1, most)
    panels = figure.subplots(1, len(diagrams), squeeze=False)[0]
    for axes, (title, diagram) in zip(panels, diagrams.items(), strict=True):
        _panel(axes, diagram, norm)
        axes.set_title(title)
    if heading:
        figure.suptitle(heading)
    figure.colorbar(ScalarMappable(norm, COLOUR_MAP), ax=list(panels), label="epochs", shrink=0.85, pad=0.02)
    files.write_figure(path, figure)


def _panel(axes: Any, diagram: StanfordDiagram, norm: Any) -> None:
    """Draw one diagram on the axes of a figure."""
    from matplotlib.patches import Patch

    limit, end = diagram.alert_limit, float(diagram.edges[-1])
    for corners, colour in zip(_corners(limit, end), COLOURS, strict=True):
        axes.fill(*corners.T, color=colour, linewidth=0.0, zorder=0)
    axes.pcolormesh(
        diagram.edges,
        diagram.edges,
        np.ma.masked_equal(diagram.counts.T, 0),
        norm=norm,
        cmap=COLOUR_MAP,
        zorder=1,
    )
    axes.plot([0.0, end], [0.0, end], color="black", linewidth=0.8, zorder=2)
    axes.axhline(limit, color="black", linestyle="--", linewidth=0.8, zorder=2)
    axes.plot([limit, limit], [0.0, limit], color="black", linestyle="--", linewidth=0.8, zorder=2)
    patches = [Patch(facecolor=colour, edgecolor="0.4", linewidth=0.6) for colour in COLOURS]
    # below the diagram: epochs may lie anywhere within it
    axes.legend(
        patches, _labels(diagram), loc="upper center", bbox_to_anchor=(0.5, -0.11), frameon=False, fontsize=8, ncols=2
    )
    axes.set(xlim=(0.0, end), ylim=(0.0, end), aspect="equal")
    axes.set(xlabel="error, m (last column: and beyond)", ylabel="protection level, m (last row: and beyond)")
    axes.text(1.01 * end, limit, "alert\nlimit", fontsize=8, va="center")


def _corners(limit: float, end: float) -> list[NDArray[np.float64]]:
    """The outline of each region, in the order of `NAMES`."""
    return [
        np.array([(0.0, 0.0), (limit, limit), (0.0, limit)]),
        np.array([(0.0, 0.0), (limit, 0.0), (limit, limit)]),
        np.array([(limit, 0.0), (end, 0.0), (end, limit), (limit, limit)]),
        np.array([(0.0, limit), (end, limit), (end, end), (0.0, end)]),
    ]


def _labels(diagram: StanfordDiagram) -> list[str]:
    """Name, count and share of each region."""
    total = max(int(diagram.regions.sum()), 1)
    labels = [
        f"{name}: {count} ({100.0 * count / total:.3g} %)"
        for name, count in zip(NAMES, diagram.regions.tolist(), strict=True)
    ]
    labels[UNAVAILABLE] += f", {diagram.unavailable_misleading} of them misleading"
    return labels
