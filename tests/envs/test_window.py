"""The render mode "human": a window of pygame, here of a video driver without a screen."""

import os
import subprocess
import sys
from collections.abc import Iterator

import gymnasium as gym
import numpy as np
import pytest

import spoofgym  # noqa: F401 - registers the environments
from spoofgym.envs.rendering import side_by_side
from spoofgym.envs.vector import SpooferVectorEnv
from spoofgym.envs.window import LARGEST, Window

pytest.importorskip("matplotlib")
pygame = pytest.importorskip("pygame")

SHORT = "liu-flight:horizon=4"
ACTION = np.array([0.2, -0.1, 0.0], dtype=np.float32)


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    yield
    pygame.display.quit()


def seen() -> np.ndarray:
    """What the window shows, (H, W, 3)."""
    return pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)


def test_the_window_shows_the_figure_of_every_epoch() -> None:
    env = gym.make("spoofgym/Spoofer-v0", scenario=SHORT, render_mode="human")
    drawn = gym.make("spoofgym/Spoofer-v0", scenario=SHORT, render_mode="rgb_array")
    for one in (env, drawn):
        one.reset(seed=0)
    assert pygame.display.get_caption()[0] == "spoofgym"
    for _ in range(3):
        np.testing.assert_array_equal(seen(), drawn.render())
        for one in (env, drawn):
            one.step(ACTION)
    assert env.render() is None
    env.close()
    assert not pygame.display.get_init()
    env.close()


def test_lanes_stand_side_by_side() -> None:
    given = {"scenario": SHORT, "autoreset_mode": "SameStep"}
    vector = SpooferVectorEnv(3, render_mode="human", **given)
    drawn = SpooferVectorEnv(3, render_mode="rgb_array", **given)
    expected = []
    for one in (vector, drawn):
        one.reset(seed=0)
        one.step(np.tile(ACTION, (3, 1)))
        expected = one.render() or ()
    assert vector.render() is None
    grid = side_by_side(list(expected))
    shrunk = pygame.transform.smoothscale(pygame.surfarray.make_surface(grid.swapaxes(0, 1)), (1600, 900))
    np.testing.assert_array_equal(seen(), pygame.surfarray.array3d(shrunk).swapaxes(0, 1))
    vector.close()


def test_a_window_that_is_closed_stays_closed_and_the_game_goes_on() -> None:
    env = gym.make("spoofgym/Spoofer-v0", scenario=SHORT, render_mode="human")
    env.reset(seed=0)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    env.step(ACTION)
    assert not pygame.display.get_init()
    *_, info = env.step(ACTION)
    assert info["epoch"] == 2
    assert not pygame.display.get_init()
    env.close()


def test_a_picture_keeps_its_shape_in_a_window_of_limited_size() -> None:
    window = Window("spoofgym", 1000.0)
    window.show(np.zeros((400, 4000, 3), dtype=np.uint8))
    assert pygame.display.get_surface().get_size() == (LARGEST[0], 160)
    window.show(np.zeros((100, 50, 3), dtype=np.uint8))
    assert pygame.display.get_surface().get_size() == (50, 100)
    window.close()


def test_without_a_screen_the_other_modes_are_named() -> None:
    """In a program of its own: the driver is chosen once in a process."""
    code = (
        "import gymnasium, spoofgym\n"
        f"env = gymnasium.make('spoofgym/Spoofer-v0', scenario={SHORT!r}, render_mode='human')\n"
        "env.reset()"
    )
    environment = {**os.environ, "SDL_VIDEODRIVER": "nowhere"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, env=environment)
    last = done.stderr.splitlines()[-1]
    assert last.startswith("RuntimeError: render_mode 'human' cannot open a window (")
    assert last.endswith("without a screen use 'rgb_array' or 'ansi'")
    assert done.stdout == ""
