"""Draws the pictures of the page "What the game is": two games, as ``render_mode="rgb_array"`` draws them.

python docs/images/make_pictures.py
"""

from __future__ import annotations

from pathlib import Path

import gymnasium as gym
import matplotlib.image

import spoofgym

HERE = Path(__file__).parent
assert spoofgym.__version__


def draw(name: str, env: gym.Env, seed: int, act: object) -> None:
    """Play one game and save its last picture."""
    observation, _ = env.reset(seed=seed)
    terminated = False
    while not terminated:
        observation, _, terminated, _, _ = env.step(act(observation))  # type: ignore[operator]
    matplotlib.image.imsave(HERE / name, env.render())
    env.close()


if __name__ == "__main__":
    draw(
        "spoofer-game.png",
        gym.make("spoofgym/Spoofer-v0", render_mode="rgb_array"),
        0,
        lambda _: [0.1, 0.0, 0.0],
    )
    draw(
        "defender-game.png",
        gym.make(
            "spoofgym/Defender-v0",
            scenario="foi-drive:horizon=120",
            detectors="snapshot",
            attacks="ramp:2,onset=50",
            clean=0.0,
            outage=0.0,
            multipath=0.0,
            render_mode="rgb_array",
        ),
        3,
        lambda observation: [1, 6] if observation[3] > 0.5 else [0, 0],
    )
