"""A copy of an environment in mid-game sees what the original sees, bit for bit, in this game and in the next ones."""

import copy
import multiprocessing
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import VectorEnv

import spoofgym  # noqa: F401 - registers the environments
from spoofgym.envs.vector import DefenderVectorEnv, SpooferVectorEnv

SPOOFER, DEFENDER = "spoofgym/Spoofer-v0", "spoofgym/Defender-v0"
COPY: dict[str, Callable[[Any], Any]] = {
    "deepcopy": copy.deepcopy,
    "pickle": lambda original: pickle.loads(pickle.dumps(original)),
}
DATA = Path(__file__).parents[3] / "shared" / "data"
WINDOWS = ("windowed:n=5,threshold=60", "relative-motion:k=5,preset=foi", "cusum:threshold=40")
RANGES = ("windowed:n=5,threshold=600", "separation-bank:n=10", "raim:p_fa=1e-6")
TUNED = "shadmehri-flight:self-tuning,onset=27"
DRIVE, FLIGHT, SKY = "foi-drive:horizon=22", "liu-flight:horizon=22,onset=300", "kujur-flight:horizon=42,onset=60"
BEFORE, AFTER = 12, 34
"""Steps before the copy is taken, and after it, where a game ends and the next one begins."""

Case = tuple[str, dict[str, Any]]
CASES: list[Case] = [
    (SPOOFER, {"scenario": FLIGHT, "detector": WINDOWS, "on_alarm": "respond", "knowledge": "full"}),
    (SPOOFER, {"scenario": FLIGHT, "frames": 3, "tracking_sigma": 1.0, "tracking_time": 4.0, "action": "innovation"}),
    (SPOOFER, {"scenario": FLIGHT, "fidelity": "strapdown", "on_alarm": "respond", "response": "px4-auto"}),
    (SPOOFER, {"scenario": SKY, "detector": RANGES, "on_alarm": "respond", "knowledge": "full"}),
    (SPOOFER, {"scenario": SKY, "fidelity": "strapdown", "on_alarm": "respond", "response": "exclude-satellites"}),
    (SPOOFER, {"scenario": "song-robot:horizon=22", "on_alarm": "respond", "detector": "windowed:n=5,threshold=60"}),
    (SPOOFER, {"scenario": TUNED, "on_alarm": "respond", "detector": "snapshot:threshold=50"}),
    (SPOOFER, {"scenario": TUNED, "fidelity": "strapdown", "on_alarm": "respond", "detector": "snapshot:threshold=50"}),
    (DEFENDER, {"scenario": DRIVE, "detectors": WINDOWS}),
    (DEFENDER, {"scenario": DRIVE, "detectors": WINDOWS, "attacks": "held-out", "fidelity": "strapdown"}),
    (DEFENDER, {"scenario": SKY, "detectors": RANGES}),
    (DEFENDER, {"scenario": SKY, "detectors": RANGES, "fidelity": "strapdown"}),
]


def label(case: Case) -> str:
    return " ".join([case[0].removeprefix("spoofgym/"), *(f"{key}={value}" for key, value in case[1].items())])


def vector(case: Case, threads: int, mode: str) -> VectorEnv:
    kind = SpooferVectorEnv if case[0] == SPOOFER else DefenderVectorEnv
    return kind(3, threads=threads, autoreset_mode=mode, **case[1])


def draw_actions(env: Any, steps: int) -> list[Any]:
    """Small offsets, or decisions of which every other one is to use."""
    env.action_space.seed(1)
    drawn = [env.action_space.sample() for _ in range(steps)]
    if drawn[0].dtype.kind == "f":
        return [(0.1 * action).astype(np.float32) for action in drawn]
    return [action if step % 4 == 0 else 0 * action for step, action in enumerate(drawn)]


def play(env: Any, actions: list[Any]) -> list[Any]:
    """What each step gives, with the statistics of the detectors; a single environment begins anew after an end."""
    trace: list[Any] = []
    for action in actions:
        result = env.step(action)
        statistics = env.unwrapped.game.simulation.epoch.statistics
        trace.append((*result, {name: np.array(values) for name, values in statistics.items()}))
        if not isinstance(env, VectorEnv) and (result[2] or result[3]):
            trace.append(env.reset())
    return trace


def check_copies(env: Any, actions: list[Any]) -> None:
    """Copies of an environment that has been reset; they are played before the original is."""
    play(env, actions[:BEFORE])
    traces = {}
    for how, make_copy in COPY.items():
        other = make_copy(env)
        traces[how] = play(other, actions[BEFORE:])
        other.close()
    expected = play(env, actions[BEFORE:])
    env.close()
    assert any(np.any(step[2]) for step in expected if len(step) > 2), "no game ended: nothing is said about the next"
    for how, trace in traces.items():
        assert len(trace) == len(expected)
        for step, (one, two) in enumerate(zip(trace, expected, strict=True)):
            assert data_equivalence(one, two, exact=True), f"{how}, step {step}: {one} instead of {two}"


@pytest.mark.parametrize("case", CASES, ids=label)
def test_single_environments(case: Case) -> None:
    env = gym.make(case[0], **case[1])
    env.reset(seed=3)
    check_copies(env, draw_actions(env, BEFORE + AFTER))


@pytest.mark.parametrize(("threads", "mode"), [(1, "SameStep"), (2, "NextStep")])
@pytest.mark.parametrize("case", CASES, ids=label)
def test_vector_environments(case: Case, threads: int, mode: str) -> None:
    env = vector(case, threads, mode)
    env.reset(seed=3)
    check_copies(env, draw_actions(env, BEFORE + AFTER))


@pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data, real logs for tests, is absent")
@pytest.mark.parametrize(
    ("name", "log", "detectors"),
    [
        (SPOOFER, "car-loop,horizon=44", WINDOWS[::2]),
        (DEFENDER, "car-loop,horizon=44", WINDOWS[::2]),
        pytest.param(DEFENDER, "car-phone-raw,horizon=42,coupling=tight", RANGES[::2], marks=pytest.mark.slow),
    ],
)
def test_games_on_a_log(name: str, log: str, detectors: tuple[str, ...]) -> None:
    spoofers = {"detector": detectors, "on_alarm": "respond", "knowledge": "blind"}
    given = spoofers if name == SPOOFER else {"detectors": detectors}
    env = gym.make(name, scenario=f"recorded:{DATA}/{log}", fidelity="strapdown", **given)
    env.reset(seed=3)
    check_copies(env, draw_actions(env, BEFORE + AFTER))


def test_sb3_adapter() -> None:
    pytest.importorskip("stable_baselines3")
    from spoofgym.envs.sb3 import SB3VecEnv

    env = SB3VecEnv(vector(CASES[0], 1, "SameStep"))
    env.seed(3)
    env.reset()
    actions = draw_actions(env, 3 * (BEFORE + AFTER))
    batches = [np.stack(actions[3 * k : 3 * k + 3]) for k in range(BEFORE + AFTER)]
    for batch in batches[:BEFORE]:
        env.step(batch)
    copies = {how: make_copy(env) for how, make_copy in COPY.items()}
    traces = {how: [other.step(batch) for batch in batches[BEFORE:]] for how, other in copies.items()}
    expected = [env.step(batch) for batch in batches[BEFORE:]]
    assert any(done.any() for _, _, done, _ in expected)
    for how, trace in traces.items():
        assert data_equivalence(trace, expected, exact=True), how


def test_a_game_that_is_drawn() -> None:
    env = gym.make(SPOOFER, scenario=FLIGHT, render_mode="rgb_array", on_alarm="respond")
    env.reset(seed=3)
    actions = draw_actions(env, 6)
    play(env, actions[:3])
    env.render()
    copies = [make_copy(env) for make_copy in COPY.values()]
    for one in (*copies, env):
        play(one, actions[3:])
    for other in copies:
        np.testing.assert_array_equal(other.render(), env.render())
        other.close()
    env.close()


@pytest.mark.parametrize(("name", "given"), [(SPOOFER, {}), (DEFENDER, {"detectors": WINDOWS})])
def test_a_pickled_environment_is_the_environment(name: str, given: dict[str, Any]) -> None:
    """As Gymnasium tests its own environments, before the first game and after it."""
    env = gym.make(name, **given)
    for seed in (5, None):
        other = pickle.loads(pickle.dumps(env))
        assert other.spec == env.spec
        assert data_equivalence(env.reset(seed=seed), other.reset(seed=seed), exact=True)
        action = env.action_space.sample()
        assert data_equivalence(env.step(action), other.step(action), exact=True)
        other.close()
    env.close()


def test_a_game_goes_on_in_another_process() -> None:
    """A new interpreter, which imports all anew and has the environment from a pickle alone."""
    env = gym.make(DEFENDER, scenario=DRIVE, detectors=WINDOWS)
    env.reset(seed=3)
    actions = draw_actions(env, BEFORE + AFTER)
    play(env, actions[:BEFORE])
    here, there = multiprocessing.get_context("spawn").Pipe()
    worker = multiprocessing.get_context("spawn").Process(target=_play_there, args=(there, env, actions[BEFORE:]))
    worker.start()
    there.close()
    trace = here.recv()
    worker.join()
    assert worker.exitcode == 0
    assert data_equivalence(trace, play(env, actions[BEFORE:]), exact=True)


def _play_there(pipe: Any, env: Any, actions: list[Any]) -> None:
    pipe.send(play(env, actions))
