"""Figures without a display: the one place where Matplotlib is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def new_figure(**options: Any) -> Figure:
    """An empty figure that needs no display.

    Args:
        options: of `matplotlib.figure.Figure`.

    Raises:
        ImportError: matplotlib is missing; the message names the extra to install.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ImportError("the figure needs matplotlib: pip install 'spoofgym[report]'") from error
    figure = Figure(**options)
    FigureCanvasAgg(figure)
    return figure
