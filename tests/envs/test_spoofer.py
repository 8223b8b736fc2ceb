"""Spoofer-v0, the single environment: conventions of Gymnasium and SB3, rewards, ends, observations and bad input."""

import inspect
import itertools
import json
import re

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

import spoofgym  # noqa: F401 - registers the environment
from spoofgym.attacks.base import KNOWLEDGE
from spoofgym.detectors.chi_square import Windowed
from spoofgym.envs.config import ACTIONS
from spoofgym.envs.observation import spoofer_fields
from spoofgym.envs.spoofer import SpooferEnv
from spoofgym.envs.spoofer_seat import INNOVATION_UNIT
from spoofgym.navigation.family import FIDELITIES

ID = "spoofgym/Spoofer-v0"
PREFIXED_ID = f"spoofgym:{ID}"
SHORT = "liu-flight:horizon=12"
COMBINATIONS = [
    kind for kind in itertools.product(KNOWLEDGE, ACTIONS, FIDELITIES) if kind[:2] != ("blind", "innovation")
]
ZERO = np.zeros(3, dtype=np.float32)
SLOW = np.array([0.08, -0.08, 0.0], dtype=np.float32)
FAST = np.array([1.0, 1.0, 1.0], dtype=np.float32)


def play(env: gym.Env, action: np.ndarray, seed: int = 0) -> list[tuple]:
    """The reset and all steps of one game."""
    results = [env.reset(seed=seed)]
    over = False
    while not over:
        results.append(env.step(action))
        over = results[-1][2] or results[-1][3]
    return results


@pytest.mark.parametrize(("knowledge", "action", "fidelity"), COMBINATIONS)
def test_checkers_of_gymnasium_and_sb3(knowledge: str, action: str, fidelity: str) -> None:
    env = gym.make(ID, scenario=SHORT, knowledge=knowledge, action=action, fidelity=fidelity, render_mode="rgb_array")
    # warnings are errors; what is drawn does not depend on these arguments, and drawing takes longest
    check_env(env.unwrapped, skip_render_check=(knowledge, action, fidelity) != COMBINATIONS[0])
    try:
        from stable_baselines3.common.env_checker import check_env as check_env_sb3
    except ImportError:
        return
    check_env_sb3(env.unwrapped)
    env.close()


def test_blind_cannot_choose_innovations() -> None:
    with pytest.raises(ValueError, match="knowledge must be 'shadow' or 'full'"):
        gym.make(ID, knowledge="blind", action="innovation")


def test_spawned_worker_builds_by_prefixed_id() -> None:
    vector = gym.make_vec(
        PREFIXED_ID, 1, vectorization_mode="async", vector_kwargs={"context": "spawn"}, scenario=SHORT
    )
    try:
        observation, _ = vector.reset(seed=3)
        single = gym.make(ID, scenario=SHORT)
        np.testing.assert_array_equal(observation[0], single.reset(seed=3)[0])
        observation, *_ = vector.step(np.zeros((1, 3), dtype=np.float32))
        np.testing.assert_array_equal(observation[0], single.step(ZERO)[0])
    finally:
        vector.close()


def test_spec_round_trips_through_json() -> None:
    arguments = {"scenario": SHORT, "detector": ("snapshot", "windowed:n=5,threshold=40"), "knowledge": "full"}
    spec = gym.make(PREFIXED_ID, **arguments).spec
    again = gym.make(EnvSpec.from_json(spec.to_json()))
    json.loads(spec.to_json())
    assert again.spec.id == ID
    np.testing.assert_array_equal(again.reset(seed=1)[0], gym.make(ID, **arguments).reset(seed=1)[0])
    assert gym.spec(ID).max_episode_steps is None


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_undetected_game(fidelity: str) -> None:
    env = gym.make(ID, fidelity=fidelity)
    results = play(env, SLOW)
    start, steps = results[0][1]["error"], results[1:]
    assert len(steps) == 120
    assert [step[3] for step in steps] == [False] * 120
    assert [step[2] for step in steps] == [False] * 119 + [True]
    for _, reward, terminated, _, info in steps:
        assert reward == sum(info["reward_terms"].values())
        assert ("outcome" in info) is terminated
    final = steps[-1][4]
    assert final["outcome"] == "undetected"
    assert final["is_success"] is True
    assert final["epoch"] == 120
    assert 10.0 * sum(step[1] for step in steps) == pytest.approx(final["error"] - start, abs=1e-9)
    assert final["error"] > 10.0


@pytest.mark.parametrize(("forfeit", "share"), [(1.0, 0.0), (0.25, 0.75), (0.0, 1.0)])
def test_detected_game_takes_back_what_was_gained(forfeit: float, share: float) -> None:
    results = play(gym.make(ID, forfeit=forfeit), FAST)
    final = results[-1][4]
    assert len(results) < 20
    assert results[-1][2]
    assert final["alarm"]
    assert final["outcome"] == "detected"
    assert final["is_success"] is False
    growth = final["error"] - results[0][1]["error"]
    assert 10.0 * sum(step[1] for step in results[1:]) == pytest.approx(share * growth, abs=1e-9)
    for _, reward, _, _, info in results[1:]:
        assert reward == sum(info["reward_terms"].values())


def test_zero_action_lasts_the_whole_game_and_sends_nothing() -> None:
    env = gym.make(ID)
    results = play(env, ZERO, seed=5)
    assert len(results) == 121
    assert not env.unwrapped.game.simulation.offset.any()
    assert results[-1][4]["outcome"] == "undetected"


def test_user_limit_truncates() -> None:
    results = play(gym.make(ID, max_episode_steps=7), ZERO)
    assert len(results) == 8
    assert results[-1][2:4] == (False, True)
    assert "outcome" not in results[-1][4]


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"colour": "red"}, TypeError, "'colour'.*scenario, detector, knowledge, action, fidelity"),
        ({"scenario": "moon"}, ValueError, "'moon'.*liu-flight"),
        ({"detector": "nose"}, ValueError, "'nose'.*snapshot.*windowed"),
        ({"knowledge": "some"}, ValueError, "knowledge must be one of blind, shadow, full, got 'some'"),
        ({"action": "jump"}, ValueError, "action must be one of rate, innovation, got 'jump'"),
        ({"fidelity": "real"}, ValueError, "'real'.*linear, strapdown"),
        ({"on_alarm": "cry"}, ValueError, "on_alarm must be one of end, respond, got 'cry'"),
        ({"on_alarm": "respond", "response": "cry"}, ValueError, "'cry'.*exclude"),
        ({"render_mode": "cinema"}, ValueError, "render_mode must be one of human, rgb_array, ansi, got 'cinema'"),
        ({"forfeit": -1.0}, ValueError, "forfeit"),
        ({"forfeit": float("inf")}, ValueError, "forfeit"),
        ({"forfeit": float("nan")}, ValueError, "forfeit"),
        ({"tracking_sigma": -1.0}, ValueError, "tracking_sigma"),
        ({"tracking_sigma": float("nan")}, ValueError, "tracking_sigma"),
        ({"threads": 0}, ValueError, "threads"),
        ({"scenario": "liu-flight:onset=1050"}, ValueError, "does not fit the trajectory"),
        ({"detector": ("snapshot", "snapshot")}, ValueError, "once"),
    ],
)
def test_bad_arguments(arguments: dict, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        SpooferEnv(**arguments)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.array([0.0, np.nan, 0.0]), "not finite"),
        (np.array([0.0, 0.0, np.inf]), "not finite"),
        (np.zeros(2), "shape"),
        (np.zeros((1, 3)), "shape"),
        (0.5, "shape"),
    ],
)
def test_bad_action_leaves_the_game_as_it_was(action: np.ndarray, message: str) -> None:
    env, other = SpooferEnv(), SpooferEnv()
    env.reset(seed=2)
    other.reset(seed=2)
    with pytest.raises(ValueError, match=message):
        env.step(action)
    np.testing.assert_array_equal(env.step(SLOW)[0], other.step(SLOW)[0])


def test_step_before_reset_and_after_the_end() -> None:
    env = SpooferEnv(scenario=SHORT)
    with pytest.raises(RuntimeError, match="reset"):
        env.step(ZERO)
    play(env, ZERO)
    with pytest.raises(RuntimeError, match="reset"):
        env.step(ZERO)
    env.reset()
    env.step(ZERO)


def test_action_is_clipped() -> None:
    env, other = SpooferEnv(), SpooferEnv()
    env.reset(seed=2)
    other.reset(seed=2)
    np.testing.assert_array_equal(env.step(7.0 * FAST)[0], other.step(FAST)[0])


def test_table_of_the_page_is_that_of_the_fields() -> None:
    page = inspect.getdoc(SpooferEnv)
    rows = re.findall(r"^\| (\d+) \| (.+?) \| (.+?) \| (.+?) \| (.+?) \| (.+?) \|$", page, flags=re.MULTILINE)
    fields = spoofer_fields("shadow", 3, ("snapshot",))
    expected = [
        (str(i), field.name, *(("0", "1") if field.scale == 0 else ("-1", "1")), field.unit,
         "not squashed" if field.scale == 0 else f"{field.scale:g}")
        for i, field in enumerate(fields)
    ]  # fmt: skip
    assert rows == expected
    for knowledge, count in (("blind", 8), ("shadow", 20), ("full", 25)):
        space = gym.make(ID, knowledge=knowledge).observation_space
        assert space.shape == (count,)
        assert str(count) in page
    for section in (
        "Description", "Action Space", "Observation Space", "Rewards", "Starting State", "Episode End", "Information",
        "Arguments", "Vectorized environment", "Version History",
    ):  # fmt: skip
        assert f"## {section}\n" in page
    arguments = re.findall(r"^\| `(\w+)` \| `(.+?)` \|", page, flags=re.MULTILINE)
    config = SpooferEnv().config
    for name, default in arguments:
        assert default.strip('"') == str(getattr(config, name, None))
    assert {name for name, _ in arguments} == {*vars(config), "render_mode"}


def test_names_of_full_knowledge() -> None:
    fields = SpooferEnv(knowledge="full", detector=("snapshot", "windowed")).game.fields
    assert [field.name for field in fields[20:]] == [
        "whitened innovation, last, east",
        "whitened innovation, last, north",
        "whitened innovation, last, up",
        "statistic of snapshot over its threshold",
        "threshold of snapshot",
        "statistic of windowed over its threshold",
        "threshold of windowed",
    ]


@pytest.mark.parametrize("tracking_sigma", [0.0, 2.0])
def test_knowledge_is_nested_and_changes_nothing_else(tracking_sigma: float) -> None:
    games = [play(SpooferEnv(knowledge=kind, tracking_sigma=tracking_sigma), SLOW, seed=4) for kind in KNOWLEDGE]
    for blind, shadow, full in zip(*games, strict=True):
        np.testing.assert_array_equal(blind[0], shadow[0][:8])
        np.testing.assert_array_equal(shadow[0], full[0][:20])
        assert blind[1:] == shadow[1:] == full[1:]


def test_observation_holds_what_its_fields_say() -> None:
    env = SpooferEnv(knowledge="full")
    env.reset(seed=1)
    for _ in range(5):
        observation = env.step(FAST / 8)[0].astype(float)
    simulation, fields = env.game.simulation, env.game.fields
    scale = np.array([field.scale for field in fields])
    quantity = scale * observation / (1 - np.abs(observation))
    np.testing.assert_allclose(quantity[0:3], 5 * 4.0 / 8, rtol=1e-5)
    assert observation[3] == pytest.approx(5 / 120)
    np.testing.assert_allclose(quantity[4:7], simulation.scenario.velocity()[5], rtol=1e-5, atol=1e-4)
    assert quantity[7] == 0
    np.testing.assert_allclose(quantity[20:23], simulation.epoch.innovation.whitened[0], rtol=1e-4, atol=1e-5)
    assert quantity[23] == pytest.approx(simulation.epoch.innovation.nis[0] / 25.9, rel=1e-4)
    assert quantity[24] == pytest.approx(25.9, rel=1e-4)


def test_tracking_error_changes_what_is_sent_and_seen_but_not_how_it_is_scored() -> None:
    deaf = "snapshot:threshold=1000"  # so that no alarm of the rough one ends the comparison
    exact, rough = SpooferEnv(detector=deaf), SpooferEnv(detector=deaf, tracking_sigma=0.5)
    exact.reset(seed=6)
    rough.reset(seed=6)
    errors = []
    for _ in range(100):
        seen, told = exact.step(SLOW)[0], rough.step(SLOW)[0]
        np.testing.assert_array_equal(told[:4], seen[:4])  # what it means to send
        assert told[7] == pytest.approx(0.5 / 1.5)
        assert (told[4:7] != seen[4:7]).any()
        errors.append(rough.game.simulation.offset[0] - rough.game.seat.offset[0])
        np.testing.assert_array_equal(rough.game.simulation.offset[0] - errors[-1], rough.game.seat.offset[0])
    assert np.std(errors) == pytest.approx(0.5, rel=0.15)  # 300 normals: 3.7 sigma
    steps = play(rough, SLOW, seed=6)
    start, final = steps[0][1]["error"], steps[-1][4]
    truth = np.hypot(*rough.game.simulation.error[0, :2])  # estimate minus truth: no tracking error in it
    assert final["error"] == pytest.approx(truth, abs=1e-12)
    assert 10.0 * sum(step[1] for step in steps[1:]) == pytest.approx(final["error"] - start, abs=1e-9)


def test_innovation_action_provokes_the_wanted_mean() -> None:
    env = SpooferEnv(action="innovation", detector="snapshot:threshold=1000", knowledge="full")
    clean = SpooferEnv(knowledge="full")
    env.reset(seed=8)
    clean.reset(seed=8)
    wanted = np.array([0.5, -0.25, 0.1])
    for _ in range(60):
        env.step(wanted)
        clean.step(ZERO)
        # on the same noise the linear fidelity's innovation differs by its mean, exactly
        spoofed, unspoofed = (game.simulation.epoch.innovation.whitened[0] for game in (env.game, clean.game))
        np.testing.assert_allclose(spoofed - unspoofed, INNOVATION_UNIT * wanted, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(env.game.seat.shadow.whitened[0], INNOVATION_UNIT * wanted, rtol=1e-9, atol=1e-9)


def test_shadow_follows_the_filter_exactly_in_expectation() -> None:
    env, clean = SpooferEnv(scenario=SHORT), SpooferEnv(scenario=SHORT)
    env.reset(seed=8)
    clean.reset(seed=8)
    for _ in range(12):
        coming = env.game.seat.shadow.coming[0].copy()
        env.step(SLOW)
        clean.step(ZERO)
        change = env.game.simulation.epoch.innovation.whitened - clean.game.simulation.epoch.innovation.whitened
        np.testing.assert_allclose(env.game.seat.shadow.whitened, change, atol=1e-9)
        assert (coming != change[0]).any()  # the offset was not held
    # the last fix is used in both
    np.testing.assert_allclose(
        env.game.seat.shadow.position_error, env.game.simulation.error - clean.game.simulation.error, atol=1e-9
    )


def test_responding_goes_on_after_an_alarm() -> None:
    env = gym.make(ID, on_alarm="respond")
    results = play(env, FAST)
    assert len(results) == 121
    assert sum(step[4]["alarm"] for step in results[1:]) > 100
    final = results[-1][4]
    assert final["outcome"] == "detected"
    assert all(step[4]["reward_terms"]["forfeit"] == 0 for step in results[1:])
    assert final["error"] < 100  # the INS coasts; with every fix used the error passes 300 m
    assert 10.0 * sum(step[1] for step in results[1:]) == pytest.approx(final["error"] - results[0][1]["error"])
    used = play(gym.make(ID, on_alarm="respond", response="always-use"), FAST)
    assert used[-1][4]["error"] > 300


def test_detector_object_is_not_shared_between_environments() -> None:
    detector = Windowed(5, threshold=60.0)
    env, other = (SpooferEnv(detector=detector, knowledge="full") for _ in range(2))
    alone = SpooferEnv(detector="windowed:n=5,threshold=60", knowledge="full")
    env.reset(seed=1)
    alone.reset(seed=1)
    other.reset(seed=2)
    for _ in range(8):
        other.step(FAST / 4)
        np.testing.assert_array_equal(env.step(SLOW)[0], alone.step(SLOW)[0])


def test_attackers_on_one_seed_meet_the_same_noise_in_later_games_too() -> None:
    env, other = SpooferEnv(), SpooferEnv()
    play(env, FAST, seed=3)
    play(other, ZERO, seed=3)
    assert env.reset()[1] == other.reset()[1]
