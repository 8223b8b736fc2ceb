"""One figure of the spoofer's game: the ground track, the error, and the statistics against their thresholds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

if TYPE_CHECKING:
    from spoofgym.envs.spoofer_game import SpooferGame

TRUE, ESTIMATED, SPOOFED = "#4d4d4d", "#0072b2", "#d55e00"
SHARE_OF_TRACK = 0.15
"""Largest deviation in the ground track, as a share of its extent: deviations are magnified to it where they are smaller."""
ROUND_FACTORS = np.array([1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000])


class SpooferFigure:
    """Records lane 0 of a game and draws it.

    Raises:
        DependencyNotInstalled: matplotlib is missing.
    """

    def __init__(self, game: SpooferGame) -> None:
        """Prepare to record ``game``."""
        try:
            from matplotlib.backends.backend_agg import FigureCanvasAgg
            from matplotlib.figure import Figure
        except ImportError as error:
            raise DependencyNotInstalled("rendering needs matplotlib: pip install 'spoofgym[render]'") from error
        self._game = game
        self._figure = Figure(figsize=(9.6, 5.4), dpi=100, layout="constrained")
        self._canvas = FigureCanvasAgg(self._figure)
        self._track = game.scenario.track()
        self.restart()

    def restart(self) -> None:
        """Forget the last game and record epoch 0 of the new one."""
        self._rows: list[tuple[float, ...]] = []
        self.record()

    def record(self) -> None:
        """Keep the present epoch: time, error E and N, offset E and N, and each statistic over its threshold."""
        simulation = self._game.simulation
        error, offset = simulation.error[0], simulation.offset[0]
        ratios = [float(simulation.epoch.statistics[n][0] / d.threshold) for n, d in simulation.detectors.items()]
        self._rows.append((simulation.epoch.time[0], error[0], error[1], offset[0], offset[1], *ratios))

    def draw(self) -> NDArray[np.uint8]:
        """The figure so far, (540, 960, 3)."""
        rows = np.array(self._rows)
        self._figure.clear()
        grid = self._figure.add_gridspec(2, 2, width_ratios=(1.0, 1.25))
        self._draw_track(self._figure.add_subplot(grid[:, 0]), rows)
        self._draw_error(self._figure.add_subplot(grid[0, 1]), rows)
        self._draw_statistics(self._figure.add_subplot(grid[1, 1]), rows)
        self._canvas.draw()
        return np.asarray(self._canvas.buffer_rgba())[:, :, :3].copy()

    def close(self) -> None:
        """Free what was drawn."""
        self._figure.clear()

    def _draw_track(self, axes: Any, rows: NDArray[np.float64]) -> None:
        track = self._track[: len(rows), :2]
        extent = max(float(np.ptp(self._track[:, :2], axis=0).max()), 1.0)
        largest = max(float(np.abs(rows[:, 1:5]).max()), 1e-3)
        factor = int(ROUND_FACTORS[np.searchsorted(ROUND_FACTORS, SHARE_OF_TRACK * extent / largest, side="right") - 1])
        factor = max(factor, 1)
        lines = ((np.zeros_like(track), "true", TRUE), (rows[:, 3:5], "spoofed", SPOOFED), (rows[:, 1:3], "estimated", ESTIMATED))
        for deviation, label, colour in lines:
            east, north = ((track + factor * deviation) / 1000.0).T
            axes.plot(east, north, color=colour, label=label, linewidth=2 if label != "true" else 1.5)
            axes.plot(east[-1], north[-1], "o", color=colour, markersize=6)
        centre = (self._track[:, :2].min(axis=0) + self._track[:, :2].max(axis=0)) / 2000.0
        half = 0.65 * extent / 1000.0
        axes.set(xlim=(centre[0] - half, centre[0] + half), ylim=(centre[1] - half, centre[1] + half), aspect="equal")
        axes.set(xlabel="east, km", ylabel="north, km")
        axes.set_title("Ground track" + (f", deviations drawn x {factor}" if factor > 1 else ""))
        axes.legend(loc="best", frameon=False)

    def _draw_error(self, axes: Any, rows: NDArray[np.float64]) -> None:
        time = rows[:, 0] - rows[0, 0]
        axes.plot(time, np.hypot(rows[:, 3], rows[:, 4]), color=SPOOFED, label="spoofed offset")
        axes.plot(time, np.hypot(rows[:, 1], rows[:, 2]), color=ESTIMATED, label="error of the estimate", linewidth=2)
        axes.set(xlim=(0, self._duration()), ylabel="horizontal, m", title="Navigation error")
        axes.set_ylim(bottom=0)
        axes.legend(loc="upper left", frameon=False)

    def _draw_statistics(self, axes: Any, rows: NDArray[np.float64]) -> None:
        time = rows[:, 0] - rows[0, 0]
        for column, name in enumerate(self._game.simulation.detectors, start=5):
            axes.plot(time, rows[:, column], label=name, linewidth=1.5)
            alarms = rows[:, column] > 1
            axes.plot(time[alarms], rows[alarms, column], "rv", markersize=8)
        axes.axhline(1.0, color="red", linestyle="--", linewidth=1, label="alarm")
        axes.set(xlim=(0, self._duration()), xlabel="time since the last clean fix, s", ylabel="over threshold")
        axes.set_ylim(0, max(1.15, 1.05 * float(rows[:, 5:].max(initial=0.0))))
        axes.set_title("Test statistic over its threshold")
        axes.legend(loc="upper left", frameon=False, ncols=2)

    def _duration(self) -> float:
        timeline = self._game.scenario.timeline
        return timeline.end - timeline.start
