"""Figures of matplotlib, which is an optional dependency, without a window or a global state."""

from __future__ import annotations

import importlib.util
from typing import Any

MISSING = "a figure needs matplotlib: pip install 'spoofgym[report]'"


def can_draw() -> bool:
    """Whether matplotlib is installed."""
    return importlib.util.find_spec("matplotlib") is not None


def new_figure(width: float, height: float, **options: Any) -> Any:
    """An empty figure with a canvas for files and pixels.

    Args:
        width: inches.
        height: inches.
        options: of ``matplotlib.figure.Figure``.

    Raises:
        ImportError: matplotlib is missing.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ImportError(MISSING) from error
    figure = Figure(figsize=(width, height), **options)
    FigureCanvasAgg(figure)
    return figure
