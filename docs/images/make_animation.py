"""Draws docs/images/game.gif, the animation of the README: one attack on one drive, with a defender and without.

    python docs/images/make_animation.py

Both games have the same seed, so both meet the same noise. The map keeps to the true car, at one scale and without
magnification. Needs `spoofgym[render]`.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from spoofgym.evaluation.game_recording import play_game
from spoofgym.evaluation.game_trace import BACKTRACK, ONSET, GameTrace
from spoofgym.figures import new_figure, pixels

SCENARIO, ATTACK, SEED = "foi-drive", "exponential:0.2,time=30,onset=70,direction=180", 0
DETECTOR, RESPONSE = "snapshot", "snapshot > exclude-and-backtrack:50"
FIRST, LAST = 40, 138
"""Epochs that are shown, one a second."""
MILLISECONDS, HOLD = 90, 3000
"""How long an epoch and the last picture are shown."""
WIDTH, HEIGHT = 340.0, 250.0
"""What the map shows, m."""
ROAD, SPOOFED, BELIEVING, DEFENDED, ALARM = "#dedad2", "#e69f00", "#d55e00", "#0072b2", "#c1121f"
INK, FAINT, GROUND, WHITE = "#222222", "#8a8a8a", "#f7f6f3", "#ffffff"


def main() -> None:
    """Play both games, draw every epoch, write the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(__file__).with_name("game.gif"))
    parser.add_argument("--every", type=int, default=1, help="draw every n-th epoch (default: 1)")
    arguments = parser.parse_args()
    believing = play_game(SCENARIO, ATTACK, (DETECTOR,), None, SEED)
    defended = play_game(SCENARIO, ATTACK, (DETECTOR,), RESPONSE, SEED)
    figure = new_figure(8.4, 4.2, dpi=100, facecolor="white")
    pictures = []
    for epoch in range(FIRST, LAST + 1, arguments.every):
        figure.clear()
        draw(figure, believing, defended, epoch)
        pictures.append(Image.fromarray(pixels(figure)))
    write(pictures, arguments.out)
    print(f"{arguments.out}: {len(pictures)} pictures, {arguments.out.stat().st_size / 1000:.0f} kB")


def write(pictures: list[Image.Image], path: Path) -> None:
    """Write an animated GIF whose pictures share one palette: a small file, and colours that do not flicker."""
    colours = Image.new("P", (1, 1))
    colours.putpalette(palette())
    flat = [picture.quantize(palette=colours, dither=Image.Dither.NONE) for picture in pictures]
    times = [MILLISECONDS] * (len(flat) - 1) + [HOLD]
    flat[0].save(path, save_all=True, append_images=flat[1:], duration=times, loop=0, optimize=True, disposal=1)


def palette() -> list[int]:
    """Red, green and blue of all colours that are drawn, each plain and mixed with what lies beneath it."""
    over = [ROAD, SPOOFED, BELIEVING, DEFENDED, ALARM, INK, FAINT]
    pairs = [(colour, ground) for colour in over for ground in (WHITE, GROUND)]
    mixed = {_mix(*pair, share) for pair in pairs for share in (0.0, 0.25, 0.5, 0.75, 1.0)}
    mixed |= {_mix(ALARM, WHITE, 0.12)} | {_mix(colour, ROAD, 0.5) for colour in (SPOOFED, BELIEVING, DEFENDED, INK)}
    return [value for colour in sorted(mixed) for value in colour]


def _mix(colour: str, ground: str, share: float) -> tuple[int, int, int]:
    red, green, blue = (
        round(share * above + (1 - share) * below)
        for above, below in zip(bytes.fromhex(colour[1:]), bytes.fromhex(ground[1:]), strict=True)
    )
    return red, green, blue


def draw(figure: Any, believing: GameTrace, defended: GameTrace, epoch: int) -> None:
    """One picture: the map on the left, error and statistic on the right, and what happens above them."""
    text, colour = said(believing, defended, epoch)
    figure.text(0.02, 0.935, text, fontsize=13, fontweight="bold", color=colour, va="center")
    draw_map(figure.add_axes((0.02, 0.03, 0.55, 0.84)), believing, defended, epoch)
    draw_errors(figure.add_axes((0.655, 0.5, 0.33, 0.37)), believing, defended, epoch)
    draw_statistic(figure.add_axes((0.655, 0.12, 0.33, 0.24)), defended, epoch)


def moments(defended: GameTrace) -> tuple[int, int]:
    """The epochs of the onset and of the backtrack."""
    first = {kind: next(e.epoch for e in defended.events if e.kind == kind) for kind in (ONSET, BACKTRACK)}
    return first[ONSET], first[BACKTRACK]


def error(trace: GameTrace) -> np.ndarray:
    """Horizontal error of the real-time output, m."""
    return np.hypot(*(trace.estimated - trace.true)[:, :2].T)


def said(believing: GameTrace, defended: GameTrace, epoch: int) -> tuple[str, str]:
    """What happens at an epoch, and its colour."""
    onset, alarm = moments(defended)
    if epoch < onset:
        return "A drive with inertial sensors and GNSS", INK
    if epoch < alarm:
        return "A spoofer pulls the GNSS position away, slowly", BELIEVING
    if epoch < alarm + 8:
        depth = int(defended.backtracked[alarm])
        return f"ALARM: {depth} s are recomputed without GNSS", ALARM
    if epoch < LAST - 5:
        return "The defender drives on inertial sensors alone", DEFENDED
    lost, kept = error(believing)[epoch], error(defended)[epoch]
    return f"{lost:.0f} m off without a defender, {kept:.0f} m with one", DEFENDED


def draw_map(axes: Any, believing: GameTrace, defended: GameTrace, epoch: int) -> None:
    """The ground around the true car, to scale, north up."""
    east, north, _ = believing.true[epoch]
    past = slice(max(epoch - 60, 0), epoch + 1)
    axes.plot(*believing.true[:, :2].T, color=ROAD, linewidth=11, solid_capstyle="round", zorder=1)
    axes.plot(*believing.spoofed[past, :2].T, ".", color=SPOOFED, markersize=7, zorder=2)
    axes.plot(east, north, "o", color="none", markersize=17, markeredgecolor=INK, markeredgewidth=1.5, zorder=4)
    axes.plot([], [], "o", color="none", markeredgecolor=INK, label="true car", markersize=9)
    axes.plot([], [], ".", color=SPOOFED, label="GNSS fixes", markersize=9)
    for trace, colour, label, width in (
        (believing, BELIEVING, "navigation that believes GNSS", 5.0),
        (defended, DEFENDED, "navigation with a defender", 2.0),
    ):
        axes.plot(*trace.estimated[past, :2].T, color=colour, linewidth=width, zorder=3)
        axes.plot(*trace.estimated[epoch, :2], "o", color=colour, markersize=7 + width, zorder=5)
        axes.plot([], [], "o-", color=colour, label=label)
    axes.set(xlim=(east - 0.62 * WIDTH, east + 0.38 * WIDTH), ylim=(north - 0.64 * HEIGHT, north + 0.36 * HEIGHT))
    axes.set(aspect="equal", xticks=[], yticks=[], facecolor=GROUND)
    axes.spines[:].set_visible(False)
    draw_scale(axes)
    axes.legend(loc="upper left", fontsize=9, frameon=False, handletextpad=0.5, borderaxespad=0.6)


def draw_scale(axes: Any) -> None:
    """A bar of 50 m in the upper right corner, and north."""
    right, top, share = 0.96, 0.92, 50.0 / WIDTH
    place = {"transform": axes.transAxes, "color": INK}
    axes.plot([right - share, right], [top, top], linewidth=2, **place)
    axes.text(right - share / 2, top + 0.02, "50 m", ha="center", va="bottom", fontsize=9, **place)
    axes.text(right, 0.05, "N ↑", ha="right", va="bottom", fontsize=10, **place)


def draw_errors(axes: Any, believing: GameTrace, defended: GameTrace, epoch: int) -> None:
    """The error of both solutions since the beginning."""
    seen = slice(FIRST, epoch + 1)
    for trace, colour, width in ((believing, BELIEVING, 4.0), (defended, DEFENDED, 1.8)):
        axes.plot(np.arange(FIRST, epoch + 1), error(trace)[seen], color=colour, linewidth=width)
    axes.set(xlim=(FIRST, LAST), ylim=(0, 1.1 * float(error(believing)[: LAST + 1].max())), xticklabels=[])
    plain(axes, "position error, m")


def draw_statistic(axes: Any, defended: GameTrace, epoch: int) -> None:
    """The statistic of the detector over its threshold, until the alarm."""
    _, alarm = moments(defended)
    statistic = defended.statistics[0]
    shown = np.arange(FIRST, min(epoch, alarm) + 1)
    axes.axhspan(1.0, 1.6, color=ALARM, alpha=0.12, linewidth=0)
    ratio = np.minimum(statistic.values / statistic.threshold, 1.4)
    axes.plot(shown, ratio[shown], color=INK, linewidth=1.3)
    if epoch >= alarm:
        axes.plot(alarm, ratio[alarm], "X", color=ALARM, markersize=9)
    axes.set(xlim=(FIRST, LAST), ylim=(0, 1.6), xlabel="time, s")
    plain(axes, "test statistic / threshold")


def plain(axes: Any, title: str) -> None:
    """A panel without a frame, its title above its left edge."""
    axes.set_title(title, fontsize=10, loc="left", color=INK)
    axes.tick_params(labelsize=8, colors=FAINT, length=2)
    axes.xaxis.label.set(size=9, color=FAINT)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(FAINT)


if __name__ == "__main__":
    main()
