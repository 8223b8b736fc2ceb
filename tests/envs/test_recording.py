"""Real recordings by the wrappers of Gymnasium and Stable-Baselines3, read back frame by frame."""

import subprocess
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import RecordVideo

import spoofgym  # noqa: F401 - registers the environments
from spoofgym.envs.vector import DefenderVectorEnv

pytest.importorskip("matplotlib")
pytest.importorskip("moviepy")
imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")

GIVEN: dict[str, Any] = {
    **{"scenario": "foi-drive:horizon=3", "detectors": "snapshot", "attacks": "ramp:1"},
    "render_mode": "rgb_array",
}
ID = "spoofgym/Defender-v0"
USE = np.array([0, 0])
CODING = 6.0
"""Mean difference of a coded frame from its picture, of 255. An empty page differs by more."""


def frames(folder: Path, height: int, width: int) -> np.ndarray:
    """All frames of the only video in a folder, (F, H, W, 3)."""
    (path,) = folder.glob("*.mp4")
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", str(path)]
    command += ["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    raw = subprocess.run(command, capture_output=True, check=True).stdout
    return np.frombuffer(raw, dtype=np.uint8).reshape(-1, height, width, 3)


def distance(frame: np.ndarray, picture: np.ndarray) -> float:
    return float(np.abs(frame.astype(float) - picture).mean())


def assert_shows(frame: np.ndarray, picture: np.ndarray) -> None:
    assert frame.shape == picture.shape
    assert distance(frame, picture) < CODING < distance(np.full_like(frame, 255), picture)


def test_gymnasium_records_a_game(tmp_path: Path) -> None:
    env = RecordVideo(gym.make(ID, **GIVEN), str(tmp_path / "videos"), episode_trigger=lambda episode: episode == 0)
    env.reset(seed=0)
    first = env.unwrapped.render()
    for _ in range(3):
        env.step(USE)
    last = env.unwrapped.render()
    env.close()
    shown = frames(tmp_path / "videos", 540, 960)
    assert len(shown) == 4
    assert_shows(shown[0], first)
    assert_shows(shown[-1], last)
    assert distance(shown[0], first) < distance(shown[0], last)
    assert distance(shown[-1], last) < distance(shown[-1], first)


@pytest.mark.parametrize(("lanes", "first_only", "shown_lanes"), [(2, False, 2), (20, True, 1)])
def test_gymnasium_records_lanes_and_the_first_of_many(
    lanes: int, first_only: bool, shown_lanes: int, tmp_path: Path
) -> None:
    vector_wrappers = pytest.importorskip("gymnasium.wrappers.vector")
    vector = DefenderVectorEnv(lanes, **GIVEN)
    options = {"record_first_only": first_only, "video_aspect_ratio": (32, 9), "episode_trigger": lambda k: k == 0}
    env = vector_wrappers.RecordVideo(vector, str(tmp_path / "videos"), **options)
    env.reset(seed=0)
    pictures = vector.render()
    for _ in range(4):
        env.step(np.tile(USE, (lanes, 1)))
    env.close()
    shown = frames(tmp_path / "videos", 540, 960 * shown_lanes)
    for lane in range(shown_lanes):
        assert_shows(shown[0][:, 960 * lane : 960 * (lane + 1)], pictures[lane])


def test_stable_baselines3_records_lanes(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.vec_env import VecVideoRecorder

    from spoofgym.envs.sb3 import SB3VecEnv

    adapted = SB3VecEnv(DefenderVectorEnv(12, autoreset_mode="SameStep", render_lanes=2, **GIVEN))
    env = VecVideoRecorder(adapted, str(tmp_path / "videos"), lambda step: step == 0, video_length=1)
    env.seed(0)
    env.reset()
    pictures = adapted.vector_env.render()
    assert adapted.env_method("render", indices=[3]) == [None]
    for _ in range(2):
        env.step(np.tile(USE, (12, 1)))
    env.close()
    shown = frames(tmp_path / "videos", 1080, 960)
    assert len(shown) == 2
    assert_shows(shown[0], np.concatenate(pictures[:2]))
    assert env.frames_per_sec == 10
