"""Figures of matplotlib, which is an optional dependency, without a window or a global state."""

from __future__ import annotations

import importlib.util
from typing import Any

import numpy as np
from numpy.typing import NDArray

MISSING = "a figure needs matplotlib: pip install 'spoofgym[render]'"


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


def pixels(figure: Any) -> NDArray[np.uint8]:
    """A figure drawn, (H, W, 3), red, green and blue.

    A copy of a figure has lost its canvas, so that it is given a new one.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[:, :, :3].copy()
