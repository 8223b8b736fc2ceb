"""Draws Stanford diagrams."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spoofgym import files
from spoofgym.evaluation.stanford import NAMES, UNAVAILABLE, StanfordDiagram
from spoofgym.figures import new_figure

COLOURS = ("#ffffff", "#fbe3c0", "#f3b8ae", "#e6e6e6")
"""Of the four regions, in the order of `NAMES`."""
COLOUR_MAP = "viridis_r"
"""Of the cells: epochs where there are few are bright, like the regions about them."""


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
