"""One figure of the spoofer's game: the ground track, the error, and the statistics against their thresholds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spoofgym.envs.game_figure import ALARM, SAFE, STATISTICS, GameFigure, scale_ratios
from spoofgym.geodesy import horizontal

if TYPE_CHECKING:
    from spoofgym.envs.spoofer_game import SpooferGame

TRUE, ESTIMATED, SPOOFED = "#4d4d4d", "#0072b2", "#d55e00"
SHARE_OF_TRACK = 0.2
"""Largest deviation in the ground track, as a share of its extent: smaller deviations are magnified up to it."""
LEAST_DEVIATION = 30.0
"""Deviations are not magnified as if they were smaller than this, m: noise stays small in the drawing."""
LARGEST_IN_METRES = 1000.0
"""Frames of the ground track that are wider than this are labelled in km, m."""
ROUND_FACTORS = np.array([1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000])


class SpooferFigure(GameFigure):
    """Records one lane of the spoofer's game and draws it.

    Raises:
        DependencyNotInstalled: matplotlib is missing.
    """

    def __init__(self, game: SpooferGame, lane: int) -> None:
        """Prepare to record a lane of ``game``."""
        super().__init__(game.simulation, lane)
        self._track = game.scenario.track()
        self._timeline = game.scenario.timeline

    def record(self) -> None:
        """Keep the present epoch: time, error E and N, offset E and N, and each statistic over its threshold."""
        simulation, lane = self._simulation, self._lane
        error, offset = simulation.error[lane], simulation.offset[lane]
        self._rows.append((simulation.epoch.time[lane], error[0], error[1], offset[0], offset[1], *self._ratios()))

    def _draw(self, rows: NDArray[np.float64]) -> None:
        # fixed places: a layout engine would move the panels from frame to frame
        upper = self._figure.add_axes((0.53, 0.555, 0.445, 0.315))
        self._draw_track(self._figure.add_axes((0.075, 0.235, 0.36, 0.635)), rows)
        self._draw_error(upper, rows)
        self._draw_statistics(self._figure.add_axes((0.53, 0.105, 0.445, 0.335), sharex=upper), rows)
        upper.tick_params(labelbottom=False)
        self._draw_headline(rows)

    def _draw_headline(self, rows: NDArray[np.float64]) -> None:
        epoch, horizon = len(rows) - 1, self._timeline.num_epochs
        alarms = rows[1:, 5:] > 1  # epoch 0 is clean and does not count
        if alarms.any():
            first = int(np.argmax(alarms.any(axis=1)))
            who = " and ".join(name for name, alarm in zip(self._names, alarms[first], strict=True) if alarm)
            verdict, colour = f"DETECTED at epoch {first + 1} by {who}", ALARM
        else:
            verdict, colour = "undetected to the end" if epoch == horizon else "not detected so far", SAFE
        error = float(horizontal(rows[-1, 1:3]))
        text = f"Epoch {epoch} of {horizon}: navigation error {error:.1f} m, {verdict}"
        self._headline(text, color=colour)

    def _draw_track(self, axes: Any, rows: NDArray[np.float64]) -> None:
        whole = self._track[:, :2]
        extent = max(float(np.ptp(whole, axis=0).max()), 1.0)
        largest = max(float(np.abs(rows[:, 1:5]).max()), LEAST_DEVIATION)
        place = int(np.searchsorted(ROUND_FACTORS, SHARE_OF_TRACK * extent / largest, side="right"))
        factor = int(ROUND_FACTORS[max(place - 1, 0)])
        lines = (
            (np.zeros((len(rows), 2)), "true", TRUE, 1.5),
            (rows[:, 3:5], "told by the spoofed fixes", SPOOFED, 2.0),
            (rows[:, 1:3], "estimated by the filter", ESTIMATED, 2.0),
        )
        centre = (whole.min(axis=0) + whole.max(axis=0)) / 2.0
        farthest = max(float(np.abs(whole[: len(rows)] + factor * part - centre).max()) for part, *_ in lines)
        half = max(0.8 * extent, 1.1 * farthest)
        unit, metres = ("m", 1.0) if 2.0 * half <= LARGEST_IN_METRES else ("km", 1000.0)
        axes.plot(*(whole / metres).T, color="0.8", linewidth=1, linestyle=":", label="true, still to come")
        for deviation, label, colour, width in lines:
            east, north = ((whole[: len(rows)] + factor * deviation) / metres).T
            axes.plot(east, north, color=colour, label=label, linewidth=width)
            axes.plot(east[-1], north[-1], "o", color=colour, markersize=6)
        (west, south), (east, north) = (centre - half) / metres, (centre + half) / metres
        axes.set(xlim=(west, east), ylim=(south, north), aspect="equal")
        axes.set(xlabel=f"east, {unit}", ylabel=f"north, {unit}")
        axes.set_title("Ground track" + (f", deviations × {factor}" if factor > 1 else ""))
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.15), frameon=False, fontsize=9, ncols=2)

    def _draw_error(self, axes: Any, rows: NDArray[np.float64]) -> None:
        time = rows[:, 0] - rows[0, 0]
        offset, error = horizontal(rows[:, 3:5]), horizontal(rows[:, 1:3])
        for values, label, colour in (
            (offset, "offset of the spoofed fix", SPOOFED),
            (error, "error of the estimate", ESTIMATED),
        ):
            axes.plot(time, values, color=colour, label=label, linewidth=2)
            axes.plot(time[-1], values[-1], "o", color=colour, markersize=5, clip_on=False, zorder=3)
        axes.set(xlim=(0, self._timeline.end - self._timeline.start), ylabel="horizontal, m", title="Navigation error")
        axes.set_ylim(0, 1.35 * max(float(offset.max()), float(error.max()), 5.0))
        axes.legend(loc="upper left", frameon=False, fontsize=9, ncols=2)

    def _draw_statistics(self, axes: Any, rows: NDArray[np.float64]) -> None:
        time = rows[:, 0] - rows[0, 0]
        scale_ratios(axes, rows[:, 5:], 8.0, "threshold")
        for n, name in enumerate(self._names):
            ratio, colour = rows[:, 5 + n], STATISTICS[n % len(STATISTICS)]
            axes.plot(time, ratio, color=colour, label=name, linewidth=1.5)
            axes.plot(time[-1], ratio[-1], "o", color=colour, markersize=5, clip_on=False, zorder=3)
            alarms = 1 + np.flatnonzero(ratio[1:] > 1)[:1]
            axes.plot(time[alarms], ratio[alarms], "X", color=ALARM, markersize=11, clip_on=False, zorder=4)
        axes.set(xlabel="time since the last clean fix, s")
        axes.set_title(
            "Detector: alarm in the red zone" if len(self._names) < 2 else "Detectors: alarm in the red zone"
        )
        axes.legend(loc="upper left", frameon=False, fontsize=9, ncols=3)
