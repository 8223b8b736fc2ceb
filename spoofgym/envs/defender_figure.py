"""One figure of the defender's game: the error, what was done with the fixes, and the statistics."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spoofgym.envs.game_figure import ALARM, SAFE, STATISTICS, GameFigure, scale_ratios
from spoofgym.geodesy import horizontal

if TYPE_CHECKING:
    from spoofgym.envs.defender_game import DefenderGame
    from spoofgym.envs.duel_game import DuelGame

ERROR, SIGMA, OFFSET = "#0072b2", "#56b4e9", "#d55e00"
BANDS = (("attack", OFFSET, 0.18), ("multipath", "#e69f00", 0.25), ("outage", "0.5", 0.25))


class DefenderFigure(GameFigure):
    """Records one lane of a game with a defender and draws it.

    Raises:
        DependencyNotInstalled: matplotlib is missing.
    """

    def __init__(self, game: DefenderGame | DuelGame, lane: int) -> None:
        """Prepare to record a lane of ``game``."""
        super().__init__(game.simulation, lane)
        self._game = game

    def restart(self) -> None:
        """Forget the last game and record epoch 0 of the new one."""
        self._decided: list[tuple[bool, int]] = []
        super().restart()

    def record(self) -> None:
        """Keep the present epoch and what was decided on the one before."""
        game, lane, epoch = self._game, self._lane, self._simulation.epoch
        assert epoch.available is not None
        assert epoch.view is not None
        if self._rows:
            self._decided.append((bool(game.excluding[lane]), int(game.simulation.navigator.backtracked[lane])))
        covariance = epoch.view.position_covariance[lane]
        self._rows.append(
            (
                epoch.time[lane],
                game.error[lane],
                float(horizontal(game.simulation.offset[lane])),
                float(np.sqrt(covariance[0, 0] + covariance[1, 1])),
                float(game.attacked[lane]),
                float(game.confounders.multipath[lane, epoch.index[lane]]),
                float(not epoch.available[lane]),
                *self._ratios(),
            )
        )

    def _draw(self, rows: NDArray[np.float64]) -> None:
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
        self._headline(f"Epoch {len(rows) - 1} of {horizon}: error {rows[-1, 1]:.1f} m, mean so far {mean:.2f} m")

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
                color=ALARM if excluded else SAFE,
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
        scale_ratios(axes, rows[:, 7:], 20.0)
        for n, name in enumerate(self._names):
            axes.plot(rows[:, 0], rows[:, 7 + n], color=STATISTICS[n % len(STATISTICS)], label=name, linewidth=1.3)
        axes.set(xlabel="time, s")
        axes.legend(loc="upper left", frameon=False, fontsize=9, ncols=4)
