"""One figure of the defender's game: the error, what was done with the fixes, and the statistics."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

if TYPE_CHECKING:
    from spoofgym.envs.defender_game import DefenderGame

ERROR, SIGMA, OFFSET = "#0072b2", "#56b4e9", "#d55e00"
STATISTICS = ("#009e73", "#cc79a7", "#e69f00", "#56b4e9")
ALARM = "#c1121f"
BANDS = (("attack", OFFSET, 0.18), ("multipath", "#e69f00", 0.25), ("outage", "0.5", 0.25))
LARGEST_LINEAR = 5.0
"""Statistics over their thresholds are drawn on a logarithmic scale where one exceeds this."""


class DefenderFigure:
    """Records lane 0 of a game and draws it.

    Raises:
        DependencyNotInstalled: matplotlib is missing.
    """

    def __init__(self, game: DefenderGame) -> None:
        """Prepare to record ``game``."""
        try:
            from matplotlib.backends.backend_agg import FigureCanvasAgg
            from matplotlib.figure import Figure
        except ImportError as error:
            raise DependencyNotInstalled("rendering needs matplotlib: pip install 'spoofgym[render]'") from error
        self._game = game
        self._figure = Figure(figsize=(9.6, 5.4), dpi=100)
        self._canvas = FigureCanvasAgg(self._figure)
        self._names = list(game.simulation.detectors)
        self.restart()

    def restart(self) -> None:
        """Forget the last game and record epoch 0 of the new one."""
        self._rows: list[tuple[float, ...]] = []
        self._decided: list[tuple[bool, int]] = []
        self.record()

    def record(self) -> None:
        """Keep the present epoch and what was decided on the one before."""
        game, epoch = self._game, self._game.simulation.epoch
        assert epoch.available is not None
        assert epoch.view is not None
        if self._rows:
            self._decided.append((bool(game.seat.excluding[0]), int(game.simulation.navigator.backtracked[0])))
        covariance = epoch.view.position_covariance[0]
        ratios = [float(epoch.statistics[n][0] / d.threshold) for n, d in game.simulation.detectors.items()]
        self._rows.append(
            (
                epoch.time[0],
                game.error[0],
                float(np.hypot(*game.simulation.offset[0, :2])),
                float(np.sqrt(covariance[0, 0] + covariance[1, 1])),
                float(game.attacked[0]),
                float(game.confounders.multipath[0, epoch.index[0]]),
                float(not epoch.available[0]),
                *ratios,
            )
        )

    def draw(self) -> NDArray[np.uint8]:
        """The figure so far, (540, 960, 3)."""
        rows = np.array(self._rows)
        self._figure.clear()
        upper = self._figure.add_axes((0.08, 0.52, 0.895, 0.34))
        middle = self._figure.add_axes((0.08, 0.405, 0.895, 0.065), sharex=upper)
        lower = self._figure.add_axes((0.08, 0.105, 0.895, 0.255), sharex=upper)
        self._draw_error(upper, rows)
        self._draw_decisions(middle, rows)
        self._draw_statistics(lower, rows)
        upper.tick_params(labelbottom=False)
        middle.tick_params(labelbottom=False)
        mean = float(rows[1:, 1].mean()) if len(rows) > 1 else float(rows[0, 1])
        horizon = self._game.scenario.timeline.num_epochs
        self._figure.suptitle(
            f"Epoch {len(rows) - 1} of {horizon}: error {rows[-1, 1]:.1f} m, mean so far {mean:.2f} m",
            fontsize=13,
            fontweight="bold",
            y=0.975,
        )
        self._canvas.draw()
        return np.asarray(self._canvas.buffer_rgba())[:, :, :3].copy()

    def close(self) -> None:
        """Free what was drawn."""
        self._figure.clear()

    def _draw_error(self, axes: Any, rows: NDArray[np.float64]) -> None:
        time, timeline = rows[:, 0], self._game.scenario.timeline
        for place, (label, colour, alpha) in enumerate(BANDS):
            inside = rows[:, 4 + place] > 0
            axes.fill_between(
                time, 0, 1, where=inside, step="pre", transform=axes.get_xaxis_transform(), color=colour, alpha=alpha,
                linewidth=0, label=label if inside.any() else None,
            )
        # the error of a step belongs to the epoch before it
        axes.plot(time[:-1], rows[1:, 1], color=ERROR, linewidth=2, label="error of the estimate")
        axes.plot(time, rows[:, 3], color=SIGMA, linewidth=1, linestyle="--", label="sigma that the filter predicts")
        axes.plot(time, rows[:, 2], color=OFFSET, linewidth=1, linestyle=":", label="offset of the fix")
        top = max(5.0, float(rows[:, 1].max()), 1.2 * float(rows[:, 3].max()))
        axes.set(xlim=(timeline.start, timeline.end), ylim=(0, 1.45 * top), ylabel="horizontal, m")
        axes.set_title("Navigation error")
        axes.legend(loc="upper left", frameon=False, fontsize=9, ncols=3)

    def _draw_decisions(self, axes: Any, rows: NDArray[np.float64]) -> None:
        interval = self._game.scenario.timeline.interval
        heights = itertools.cycle((0.75, 0.25))  # one after the other may lie close together
        for place, (excluded, depth) in enumerate(self._decided):
            axes.axvspan(
                rows[place, 0] - 0.5 * interval,
                rows[place, 0] + 0.5 * interval,
                color=ALARM if excluded else "#2b7a3d",
                alpha=0.75 if excluded else 0.35,
                linewidth=0,
            )
            if depth:
                begin, end, height = rows[place, 0], rows[max(place - depth, 0), 0], next(heights)
                axes.annotate("", (end, height), (begin, height), arrowprops={"arrowstyle": "->", "color": "black"})
                axes.text(end - interval, height, f"{depth} back", va="center", ha="right", fontsize=8)
        axes.set(yticks=[], ylim=(0, 1))
        axes.set_title("Fixes: green used, red excluded", fontsize=9, pad=3)

    def _draw_statistics(self, axes: Any, rows: NDArray[np.float64]) -> None:
        largest = float(rows[:, 7:].max(initial=0.0))
        if largest > LARGEST_LINEAR:
            axes.set_yscale("log")
            low, high = 0.01, 20.0 * largest
        else:
            low, high = 0.0, 1.45 * max(largest, 1.0)
        axes.axhspan(1.0, high, color=ALARM, alpha=0.08, linewidth=0)
        axes.axhline(1.0, color=ALARM, linestyle="--", linewidth=1)
        for n, name in enumerate(self._names):
            axes.plot(rows[:, 0], rows[:, 7 + n], color=STATISTICS[n % len(STATISTICS)], label=name, linewidth=1.3)
        axes.set(xlabel="time, s", ylabel="statistic / threshold", ylim=(low, high))
        axes.legend(loc="upper left", frameon=False, fontsize=9, ncols=4)
