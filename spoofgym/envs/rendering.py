"""The render modes: what an environment shows of its lanes, as pictures, in a window, or as lines of text."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from spoofgym import validation
from spoofgym.arrays import Runs
from spoofgym.envs.epoch_line import epoch_line
from spoofgym.envs.game_figure import GameFigure, require_matplotlib
from spoofgym.envs.window import Window, require_pygame

HUMAN, PICTURE, TEXT = MODES = ("human", "rgb_array", "ansi")
FRAMES_PER_SECOND = 10
METADATA: dict[str, Any] = {"render_modes": list(MODES), "render_fps": FRAMES_PER_SECOND}
"""Of every environment."""
MOST_BY_DEFAULT = 9
"""A vector environment of so many lanes draws all of them, a larger one its lane 0."""
MOST_LANES = 100
"""Drawing takes a tenth of a second per lane."""

Frame: TypeAlias = NDArray[np.uint8] | str
"""A picture, (H, W, 3), or a line."""
FigureType: TypeAlias = Callable[[Any, int], GameFigure]
"""Makes the figure of one lane of a game."""


class Rendering:
    """Shows some lanes of a game in a render mode; without a mode it does nothing."""

    def __init__(self, mode: str | None, game: Any, figure: FigureType, lanes: int = 1) -> None:
        """Prepare to show a game.

        Args:
            mode: one of MODES, or None.
            game: whose lanes are shown.
            figure: of one lane.
            lanes: how many are shown, the first ones.
        """
        self.mode, self._game, self._lanes = mode, game, 0 if mode is None else lanes
        drawn = self._lanes if mode in (HUMAN, PICTURE) else 0
        self._figures = [figure(game, lane) for lane in range(drawn)]
        self._window = Window("spoofgym", FRAMES_PER_SECOND) if mode == HUMAN else None

    def restart(self, lanes: Runs) -> None:
        """New games have begun in some lanes: forget their last ones, and note their epoch 0."""
        begun = set(lanes.tolist())
        for lane, figure in enumerate(self._figures):
            if lane in begun:
                figure.restart()
        self._show()

    def record(self, restarted: Runs | None = None) -> None:
        """Note the new epoch of every lane; in ``restarted`` lanes it is epoch 0 of a new game."""
        begun = set() if restarted is None or not self._figures else set(restarted.tolist())
        for lane, figure in enumerate(self._figures):
            if lane in begun:
                figure.restart()
            else:
                figure.record()
        self._show()

    def _show(self) -> None:
        if self._window is not None and all(figure.begun for figure in self._figures):
            self._window.show(side_by_side([figure.draw() for figure in self._figures]))

    def frames(self) -> list[Frame] | None:
        """A frame of each lane that is shown; None without a mode, and where a window shows them."""
        if self.mode == TEXT:
            return [epoch_line(self._game, lane) for lane in range(self._lanes)]
        if self.mode == PICTURE:
            return [figure.draw() for figure in self._figures]
        return None

    def only_frame(self) -> Frame | None:
        """The frame of lane 0."""
        frames = self.frames()
        return None if frames is None else frames[0]

    def close(self) -> None:
        """Free the figures and close the window."""
        for figure in self._figures:
            figure.close()
        if self._window is not None:
            self._window.close()


def check_render_mode(owner: str, mode: object) -> str | None:
    """The render mode, if it is one and what it needs is installed.

    Raises:
        ValueError: there is no such mode.
        DependencyNotInstalled: matplotlib or pygame is missing.
    """
    if mode is None:
        return None
    name = validation.one_of(owner, "render_mode", mode, MODES)
    if name in (HUMAN, PICTURE):
        require_matplotlib()
    if name == HUMAN:
        require_pygame()
    return name


def check_render_lanes(owner: str, lanes: object, num_envs: int, mode: str | None) -> int:
    """How many lanes of a vector environment are shown.

    Args:
        owner: of the argument.
        lanes: as it was given; None = all of a few lanes, the first of many.
        num_envs: lanes of the environment.
        mode: the render mode.

    Raises:
        ValueError: it is out of range, or there is no render mode.
    """
    if lanes is None:
        return num_envs if num_envs <= MOST_BY_DEFAULT else 1
    if mode is None:
        raise ValueError(f"{owner}: render_lanes has an effect with a render_mode only; give one of {', '.join(MODES)}")
    return validation.whole(owner, "render_lanes", lanes, 1, min(num_envs, MOST_LANES))


def side_by_side(pictures: list[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Pictures of one size, (H, W, 3), in a grid, row by row; places that are left over are white."""
    columns = int(np.ceil(np.sqrt(len(pictures))))
    rows = -(-len(pictures) // columns)
    height, width, _ = pictures[0].shape
    grid = np.full((rows * height, columns * width, 3), 255, dtype=np.uint8)
    for place, picture in enumerate(pictures):
        row, column = divmod(place, columns)
        grid[row * height : (row + 1) * height, column * width : (column + 1) * width] = picture
    return grid
