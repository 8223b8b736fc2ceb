"""A window on the screen that shows pictures, by pygame, which is an optional dependency."""

from __future__ import annotations

import os
import time
from typing import Any

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

LARGEST = (1600, 900)
"""Width and height that a window has at most, pixels: larger pictures are drawn smaller."""


class Window:
    """Shows one picture after the other at a steady pace.

    The window opens with the first picture. pygame has one window in a process, so two environments share it. Whoever
    closes it stops the show and not the game: later pictures are not shown.

    Raises:
        DependencyNotInstalled: pygame is missing.
    """

    def __init__(self, title: str, pictures_per_second: float) -> None:
        """Prepare a window; nothing is opened yet."""
        require_pygame()
        self._title, self._interval = title, 1.0 / pictures_per_second
        self._next = 0.0
        self._shut = False

    def show(self, picture: NDArray[np.uint8]) -> None:
        """Show a picture, (H, W, 3), and wait until it was seen as long as the pace demands.

        Raises:
            RuntimeError: there is no screen on which a window can be opened.
        """
        import pygame

        if self._shut:
            return
        surface = pygame.surfarray.make_surface(picture.swapaxes(0, 1))
        width, height = surface.get_size()
        factor = min(1.0, LARGEST[0] / width, LARGEST[1] / height)
        if factor < 1.0:
            surface = pygame.transform.smoothscale(surface, (int(factor * width), int(factor * height)))
        self._screen(surface.get_size()).blit(surface, (0, 0))
        pygame.display.flip()
        if any(event.type == pygame.QUIT for event in pygame.event.get()):
            self.close()
            self._shut = True
        time.sleep(max(0.0, self._next - time.monotonic()))
        self._next = time.monotonic() + self._interval

    def _screen(self, size: tuple[int, int]) -> Any:
        """The window's surface; the window is opened where it is not open, or has another size."""
        import pygame

        screen = pygame.display.get_surface() if pygame.display.get_init() else None
        if screen is None or screen.get_size() != size:
            try:
                pygame.display.init()
                screen = pygame.display.set_mode(size)
            except pygame.error as error:
                raise RuntimeError(
                    f"render_mode 'human' cannot open a window ({error}): without a screen use 'rgb_array' or 'ansi'"
                ) from error
            pygame.display.set_caption(self._title)
        return screen

    def close(self) -> None:
        """Close the window, if it is open."""
        import pygame

        if pygame.display.get_init():
            pygame.display.quit()


def require_pygame() -> None:
    """Refuse to go on without pygame.

    Raises:
        DependencyNotInstalled: it is missing.
    """
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # it greets on stdout otherwise
    try:
        import pygame  # noqa: F401
    except ImportError as error:
        raise DependencyNotInstalled("render_mode 'human' needs pygame: pip install 'spoofgym[render]'") from error
