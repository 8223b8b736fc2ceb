"""The figure of the spoofer's game."""

import itertools
import re

import gymnasium as gym
import numpy as np
import pytest

import spoofgym  # noqa: F401 - registers the environment
from spoofgym.envs.spoofer import SpooferEnv

pytest.importorskip("matplotlib")

ACTION = np.array([0.2, -0.1, 0.0], dtype=np.float32)
FAST = np.ones(3, dtype=np.float32)


def headline(env: SpooferEnv) -> str:
    return env._rendering._figures[0]._figure.get_suptitle()


def test_frames_change_from_step_to_step() -> None:
    env = gym.make("spoofgym/Spoofer-v0", render_mode="rgb_array")
    env.reset(seed=0)
    frames = [env.render()]
    for _ in range(2):
        env.step(ACTION)
        frames.append(env.render())
    for frame in frames:
        assert frame.dtype == np.uint8
        assert frame.shape == (540, 960, 3)
    for before, after in itertools.pairwise(frames):
        assert (before != after).any()
        assert not np.shares_memory(before, after)
    env.reset(seed=0)
    np.testing.assert_array_equal(env.render(), frames[0])
    env.close()
    env.close()


@pytest.mark.parametrize(
    ("arguments", "action", "verdict"),
    [
        ({"scenario": "liu-flight:horizon=4"}, 0 * FAST, "Epoch 4 of 4: .* undetected to the end"),
        ({}, FAST, r"Epoch \d+ of 120: .* DETECTED at epoch \d+ by snapshot"),
        (
            {"scenario": "liu-flight:horizon=30", "on_alarm": "respond", "detector": ("snapshot", "windowed")},
            FAST,
            r"Epoch 30 of 30: .* DETECTED at epoch \d by (snapshot|windowed)",
        ),
    ],
    ids=["undetected", "detected", "respond"],
)
def test_headline_tells_how_the_game_ended(arguments: dict, action: np.ndarray, verdict: str) -> None:
    env = SpooferEnv(render_mode="rgb_array", **arguments)
    env.reset(seed=1)
    env.render()
    assert "not detected so far" in headline(env)
    over = False
    while not over:
        _, _, over, _, info = env.step(action)
    env.render()
    assert re.search(verdict, headline(env))
    assert f"error {info['error']:.1f} m" in headline(env)


@pytest.mark.parametrize(
    ("scenario", "unit", "metres"), [("song-robot:horizon=60", "m", 1.0), ("liu-flight:horizon=60", "km", 1000.0)]
)
def test_the_track_is_readable_and_within_its_frame(scenario: str, unit: str, metres: float) -> None:
    """A court is drawn in metres, a flight in kilometres, and an offset beyond the court widens the frame."""
    env = SpooferEnv(render_mode="rgb_array", scenario=scenario, on_alarm="respond")
    env.reset(seed=0)
    env.render()
    for _ in range(60):
        env.step(FAST)
    env.render()
    track = env._rendering._figures[0]._figure.axes[1]
    assert (track.get_xlabel(), track.get_ylabel()) == (f"east, {unit}", f"north, {unit}")
    (west, east), (south, north) = track.get_xlim(), track.get_ylim()
    for line in track.get_lines():
        assert np.all((line.get_xdata() > west) & (line.get_xdata() < east))
        assert np.all((line.get_ydata() > south) & (line.get_ydata() < north))
    still_to_come = track.get_lines()[0].get_xydata()
    np.testing.assert_allclose(metres * still_to_come, env.game.scenario.track()[:, :2], atol=1e-9)
    env.close()
