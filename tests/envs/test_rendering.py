"""The render modes of every environment, single and native: what a frame shows, and what is missing is named."""

import re
import sys
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import spoofgym  # noqa: F401 - registers the environments
from spoofgym.envs.rendering import side_by_side
from spoofgym.envs.vector import DefenderVectorEnv, DuelVectorEnv, SpooferVectorEnv

pytest.importorskip("matplotlib")

DRIVE = "foi-drive:horizon=22"
GIVEN: dict[str, dict[str, Any]] = {
    "Spoofer": {"scenario": DRIVE, "on_alarm": "respond"},
    "Defender": {"scenario": DRIVE, "detectors": "snapshot", "attacks": "ramp:1", "clean": 0.0},
    "DuelSpoofer": {"scenario": DRIVE, "detectors": "snapshot", "clean": 0.0},
    "DuelDefender": {"scenario": DRIVE, "detectors": "snapshot", "spoofer": "ramp:1", "clean": 0.0},
}
LINE = re.compile(
    r" *(?P<epoch>\d+)/22 +offset +(?P<offset>[\d.]+) m  error +(?P<error>[\d.]+) m  "
    r"(?P<fate>used|not used|\d+ back|) *snapshot (?P<ratio>[\d.]+)(?P<said>| ALARM| NO FIX)"
)


def told(line: str) -> dict[str, str]:
    found = LINE.fullmatch(line)
    assert found is not None, line
    return found.groupdict()


@pytest.mark.parametrize("name", GIVEN)
def test_gymnasiums_checker_accepts_every_mode(name: str) -> None:
    """It makes the environment once more for each mode, and renders."""
    env = gym.make(f"spoofgym/{name}-v0", **GIVEN[name], render_mode="ansi")
    assert env.metadata["render_modes"] == ["human", "rgb_array", "ansi"]
    check_env(env.unwrapped)


@pytest.mark.parametrize("name", GIVEN)
def test_a_line_tells_its_epoch(name: str) -> None:
    env = gym.make(f"spoofgym/{name}-v0", **GIVEN[name], render_mode="ansi")
    env.reset(seed=1)
    assert told(env.render())["fate"] == ""
    env.action_space.seed(1)
    over, epochs, fates = False, 0, set()
    while not over:
        *_, over, _, info = env.step(env.action_space.sample())
        epochs += 1
        line = told(env.render())
        fates.add(line["fate"])
        simulation = env.unwrapped.game.simulation
        east, north, _ = simulation.offset[0]
        assert (line["epoch"], line["offset"]) == (str(epochs), f"{np.hypot(east, north):.1f}")
        assert line["error"] == f"{info['error']:.1f}"
        assert (line["said"] == " ALARM") == bool(simulation.alarm[0])
        if "used" in info:
            back = f"{info['backtrack']} back"
            assert line["fate"] == (back if info["backtrack"] else "used" if info["used"] else "not used")
    assert epochs == 22
    assert len(fates) > 1 or "Defender" not in name  # a random defender does several things


def test_a_fix_that_is_missing_is_told() -> None:
    env = gym.make("spoofgym/Defender-v0", scenario="foi-drive:horizon=60", detectors="snapshot", outage=1.0,
                   render_mode="ansi")  # fmt: skip
    env.reset(seed=0)
    lines = []
    for _ in range(60):
        env.step(np.array([0, 0]))
        lines.append(env.render())
    missing = [line.endswith("NO FIX") for line in lines]
    assert 0 < sum(missing) < 60
    # what is missing is told at its epoch, and that it was not used at the next one
    assert [" not used " in line for line in lines[1:]] == missing[:-1]


@pytest.mark.parametrize("kind", [SpooferVectorEnv, DefenderVectorEnv])
@pytest.mark.parametrize("mode", ["ansi", "rgb_array"])
def test_frames_of_lanes_are_those_of_single_environments(kind: type, mode: str) -> None:
    """Through the start of the next games, too; lanes that are not shown have no frame."""
    name = kind.__name__.removesuffix("VectorEnv")
    given = {**GIVEN[name], "scenario": "foi-drive:horizon=3"}
    vector = kind(3, render_mode=mode, render_lanes=2, **given)
    singles = [gym.make(f"spoofgym/{name}-v0", render_mode=mode, **given) for _ in range(2)]
    vector.reset(seed=5)
    for lane, env in enumerate(singles):
        env.reset(seed=5 + lane)
    vector.action_space.seed(0)
    for step in range(6):
        if step in (0, 3, 5):
            frames = vector.render()
            assert len(frames) == 3
            assert frames[2] is None
            for frame, env in zip(frames, singles, strict=False):
                np.testing.assert_array_equal(frame, env.render())
        actions = vector.action_space.sample()
        vector.step(actions)
        for lane, env in enumerate(singles):
            env.reset() if step == 3 else env.step(actions[lane])  # the vector environment resets in its next step
    vector.close()


def test_many_lanes_show_the_first_and_a_few_show_all() -> None:
    for lanes, shown in ((9, 9), (10, 1)):
        vector = SpooferVectorEnv(lanes, scenario=DRIVE, render_mode="ansi")
        vector.reset(seed=0)
        frames = vector.render()
        assert [frame is not None for frame in frames] == [lane < shown for lane in range(lanes)]


def test_a_batch_of_duels_has_frames() -> None:
    vector = DuelVectorEnv(2, scenario=DRIVE, detectors="snapshot", render_mode="ansi", autoreset_mode="SameStep")
    vector.reset(seed=0)
    for step in range(1, 24):
        vector.step(vector.action_space.sample())
        assert [told(frame)["epoch"] for frame in vector.render()] == [str(step % 22)] * 2


def test_the_duel_in_its_forms_has_frames() -> None:
    duel = pytest.importorskip("spoofgym.duel")
    given = {"scenario": DRIVE, "detectors": "snapshot", "clean": 0.0}
    forms: list[Callable[..., Any]] = [duel.parallel_env, duel.env]
    for form in forms:
        env = form(**given, render_mode="ansi")
        env.reset(seed=0)
        if form is duel.env:
            env.step(np.ones(3, dtype=np.float32))
            env.step(np.array([1, 0]))
        else:
            env.step({"spoofer": np.ones(3, dtype=np.float32), "defender": np.array([1, 0])})
        line = told(env.render())
        assert (line["epoch"], line["fate"]) == ("1", "not used")
        assert float(line["offset"]) > 0
        env.close()


def test_no_render_mode_shows_nothing_and_a_picture_needs_a_game() -> None:
    for env in (gym.make("spoofgym/Spoofer-v0").unwrapped, SpooferVectorEnv(2)):
        env.reset()
        assert env.render() is None
    with pytest.raises(RuntimeError, match=r"call reset\(\) first"):
        gym.make("spoofgym/Spoofer-v0", render_mode="rgb_array").unwrapped.render()


def test_a_grid_holds_every_picture() -> None:
    pictures = [np.full((2, 3, 3), shade, dtype=np.uint8) for shade in (10, 20, 30)]
    expected = np.block([[pictures[0][..., 0], pictures[1][..., 0]], [pictures[2][..., 0], np.full((2, 3), 255)]])
    np.testing.assert_array_equal(side_by_side(pictures), np.repeat(expected[..., None], 3, axis=2))
    np.testing.assert_array_equal(side_by_side(pictures[:1]), pictures[0])


@pytest.mark.parametrize(
    ("package", "mode"), [("matplotlib", "rgb_array"), ("matplotlib", "human"), ("pygame", "human")]
)
def test_a_missing_package_names_the_extra(package: str, mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [package, *(name for name in sys.modules if name.startswith(f"{package}."))]:
        monkeypatch.setitem(sys.modules, name, None)
    gym.make("spoofgym/Spoofer-v0", scenario="liu-flight:horizon=2", render_mode="ansi").reset()
    said = rf"{package}: pip install 'spoofgym\[render\]'"
    with pytest.raises(gym.error.DependencyNotInstalled, match=said):
        gym.make("spoofgym/Spoofer-v0", render_mode=mode)
    with pytest.raises(gym.error.DependencyNotInstalled, match=said):
        SpooferVectorEnv(2, render_mode=mode)
