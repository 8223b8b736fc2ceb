"""What the figures of both games have in common: a lane is recorded epoch by epoch and drawn into one figure."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from spoofgym.figures import can_draw, new_figure, pixels
from spoofgym.simulation import Simulation

STATISTICS = ("#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Colours of the statistics."""
ALARM, SAFE = "#c1121f", "#2b7a3d"
"""Colours of what is bad and what is good."""
LARGEST_LINEAR = 5.0
"""Statistics over their thresholds are drawn on a logarithmic scale where one exceeds this."""


class GameFigure(ABC):
    """Records one lane of a game and draws it.

    Raises:
        DependencyNotInstalled: matplotlib is missing.
    """

    def __init__(self, simulation: Simulation, lane: int) -> None:
        """Prepare to record a lane of a simulation."""
        require_matplotlib()
        self._figure = new_figure(9.6, 5.4, dpi=100)
        self._simulation, self._lane = simulation, lane
        self._names = list(simulation.detectors)
        self._rows: list[tuple[float, ...]] = []

    def restart(self) -> None:
        """Forget the last game and record epoch 0 of the new one."""
        self._rows = []
        self.record()

    @property
    def begun(self) -> bool:
        """Whether there is anything to draw."""
        return bool(self._rows)

    @abstractmethod
    def record(self) -> None:
        """Keep the present epoch."""

    def draw(self) -> NDArray[np.uint8]:
        """The figure so far, (540, 960, 3).

        Raises:
            RuntimeError: no game has begun.
        """
        if not self.begun:
            raise RuntimeError("no game has begun: call reset() first")
        self._figure.clear()
        self._draw(np.array(self._rows))
        return pixels(self._figure)

    @abstractmethod
    def _draw(self, rows: NDArray[np.float64]) -> None:
        """Draw all panels; rows are what was recorded, an epoch each."""

    def close(self) -> None:
        """Free what was drawn."""
        self._figure.clear()

    def _ratios(self) -> list[float]:
        """Each statistic of the lane over its threshold."""
        simulation, lane = self._simulation, self._lane
        return [float(simulation.epoch.statistics[n][lane] / d.threshold) for n, d in simulation.detectors.items()]

    def _headline(self, text: str, **options: Any) -> None:
        """Write a line above all panels."""
        self._figure.suptitle(text, fontsize=13, fontweight="bold", y=0.975, **options)


def require_matplotlib() -> None:
    """Refuse to go on without matplotlib.

    Raises:
        DependencyNotInstalled: it is missing.
    """
    if not can_draw():
        raise DependencyNotInstalled("rendering needs matplotlib: pip install 'spoofgym[render]'")


def scale_ratios(axes: Any, ratios: NDArray[np.float64], headroom: float, label: str | None = None) -> None:
    """Choose the scale of a panel of statistics over their thresholds, and mark the zone of alarms.

    Args:
        axes: of the panel.
        ratios: all that are drawn.
        headroom: factor of the largest one at which a logarithmic scale ends.
        label: of the line at the threshold.
    """
    largest = float(ratios.max(initial=0.0))
    if largest > LARGEST_LINEAR:
        axes.set_yscale("log")
        low, high = 0.01, headroom * largest
    else:
        low, high = 0.0, 1.45 * max(largest, 1.0)
    axes.axhspan(1.0, high, color=ALARM, alpha=0.08, linewidth=0)
    axes.axhline(1.0, color=ALARM, linestyle="--", linewidth=1, label=label)
    axes.set(ylabel="statistic / threshold", ylim=(low, high))
