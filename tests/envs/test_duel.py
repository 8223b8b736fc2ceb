"""The duel: PettingZoo's own tests, whole games, what they are worth, and bad input."""

import inspect
import re
import sys
import warnings
from dataclasses import fields as fields_of
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test
from pettingzoo.test.save_obs_test import test_save_obs as save_obs_test

from spoofgym import duel
from spoofgym.envs.config import DEFENDER_DETECTORS
from spoofgym.envs.duel import DuelParallelEnv
from spoofgym.envs.duel_config import DuelConfig, DuelDefenderConfig, DuelSpooferConfig
from spoofgym.envs.duel_game import DuelGame
from spoofgym.envs.duel_sides import DuelDefenderEnv, DuelSpooferEnv
from spoofgym.envs.spoofer_seat import DECISION_FIELDS
from spoofgym.streams import RunStreams

DRIVE, SKY = "foi-drive:horizon=22", "kujur-flight:horizon=12,onset=60"
DETECTORS = ("snapshot", "windowed:n=5,threshold=60")
SHORT: dict[str, Any] = {"scenario": DRIVE, "detectors": DETECTORS}
KINDS: dict[str, dict[str, Any]] = {
    "blind": {**SHORT, "knowledge": "blind"},
    "full": {**SHORT, "knowledge": "full", "frames": 2},
    "innovation": {**SHORT, "action": "innovation", "payoff": "beyond:3"},
    "strapdown": {**SHORT, "fidelity": "strapdown", "tracking_sigma": 1.0},
    "tight": {"scenario": SKY, "detectors": ("snapshot",), "knowledge": "full"},
}
ADVICE_FOR_LIKE_AGENTS = (
    "We recommend agents to be named in the format",
    "Action space for each agent probably should be gymnasium.spaces.box or gymnasium.spaces.discrete",
    "Agents have different (observation|action) space",
    "The class of action spaces is different between two agents",
    "Observations are different shapes",
)
"""What `api_test` warns of in every game of unlike roles: they have names instead of numbers, and unlike spaces."""
LANES, SEED = 3, 5


def trace(env: Any, seed: int | None) -> list[np.ndarray]:
    """All that a whole game shows and pays, by actions that are drawn."""
    seen, infos = env.reset(seed=seed)
    shown = [*seen.values()]
    for place, agent in enumerate(env.possible_agents):
        env.action_space(agent).seed(place)
    while env.agents:
        actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        seen, rewards, terminated, _, infos = env.step(actions)
        assert rewards["spoofer"] == -rewards["defender"]
        assert terminated["spoofer"] == terminated["defender"]
        shown += [*seen.values(), np.array([*rewards.values()]), np.array([infos["spoofer"]["error"]]), env.state()]
        assert env.state_space.contains(env.state())
    assert infos["spoofer"]["harm"] == infos["defender"]["harm"]
    return shown


@pytest.mark.parametrize("kind", KINDS)
def test_pettingzoo_finds_no_fault(kind: str) -> None:
    """Warnings are errors."""
    parallel_api_test(duel.parallel_env(**KINDS[kind]), num_cycles=30)
    parallel_seed_test(lambda: duel.parallel_env(**KINDS[kind]), num_cycles=5)
    save_obs_test(duel.env(**KINDS[kind]))
    with warnings.catch_warnings():
        for advice in ADVICE_FOR_LIKE_AGENTS:
            warnings.filterwarnings("ignore", advice, UserWarning)
        api_test(duel.env(**KINDS[kind]), num_cycles=30)


@pytest.mark.parametrize("kind", KINDS)
def test_equal_seeds_play_equal_games_to_their_ends(kind: str) -> None:
    """PettingZoo's test of seeds looks at the first step only."""
    first, second = duel.parallel_env(**KINDS[kind]), duel.parallel_env(**KINDS[kind])
    for seed in (SEED, None):  # the second game goes on with the stream of the first
        one, two = trace(first, seed), trace(second, seed)
        assert len(one) == len(two)
        for a, b in zip(one, two, strict=True):
            np.testing.assert_array_equal(a, b)
    other = trace(second, SEED + 1)
    assert any((a != b).any() for a, b in zip(one, other, strict=True))


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_lanes_are_duels_of_their_own(mode: str) -> None:
    kind = KINDS["full"]
    vector = duel.vector_env(LANES, autoreset_mode=mode, **kind)
    singles = [duel.parallel_env(**kind) for _ in range(LANES)]
    seen, _ = vector.reset(seed=SEED)
    games = [env.reset(seed=SEED + lane) for lane, env in enumerate(singles)]
    vector.action_space.seed(1)
    ended = 0
    for _ in range(50):
        for lane, (own, _) in enumerate(games):
            for agent in ("spoofer", "defender"):
                np.testing.assert_array_equal(seen[agent][lane], own[agent])
        actions = vector.action_space.sample()
        seen, rewards, terminated, truncated, info = vector.step(actions)
        assert not truncated.any()
        for lane, env in enumerate(singles):
            if not env.agents:  # NEXT_STEP: this step has begun the lane's new game
                games[lane] = env.reset()
                assert (rewards[lane], terminated[lane]) == (0.0, False)
                continue
            own, paid, over, _, told = env.step({agent: actions[agent][lane] for agent in env.agents})
            assert (rewards[lane], terminated[lane]) == (paid["spoofer"], over["defender"])
            final = info["final_info"] if over["spoofer"] and mode == "SameStep" else info
            for agent, values in told.items():
                for name in {"error", "harm", "spoofer"} & set(values):
                    assert final[agent][name][lane] == values[name]
            games[lane] = own, told
            if over["spoofer"] and mode == "SameStep":
                for agent in ("spoofer", "defender"):
                    np.testing.assert_array_equal(info["final_obs"][lane][agent], own[agent])
                games[lane] = env.reset()
            ended += over["spoofer"]
    assert ended == 2 * LANES


@pytest.mark.parametrize(
    ("payoff", "worth"),
    [
        ("error", lambda error: np.minimum(error, 200.0)),
        ("error:3", lambda error: np.minimum(error, 3.0)),
        ("beyond:3", lambda error: error > 3.0),
    ],
)
def test_harm_is_the_mean_worth_of_the_errors(payoff: str, worth: Any) -> None:
    """Of those after each of the K decisions, by the errors that infos tell; clean games count."""
    env = duel.vector_env(8, autoreset_mode="Disabled", **SHORT, payoff=payoff)
    env.reset(seed=SEED)
    errors, paid = [], np.zeros(8)
    for _ in range(22):
        actions = {"spoofer": np.full((8, 3), 0.5), "defender": np.zeros((8, 2), dtype=int)}
        _, reward, terminated, _, info = env.step(actions)
        errors.append(info["spoofer"]["error"])
        paid += reward
    assert terminated.all()
    expected = worth(np.array(errors)).mean(axis=0)
    np.testing.assert_allclose(info["spoofer"]["harm"], expected, rtol=1e-12)
    np.testing.assert_allclose(paid, expected, rtol=1e-12)
    assert {"agent", "none"} == set(info["defender"]["spoofer"])


def test_a_filter_that_diverges_is_worth_the_largest_payoff_to_the_end() -> None:
    env = DuelParallelEnv(scenario="foi-drive:horizon=22", detectors="snapshot", fidelity="strapdown", clean=0.0)
    env.reset(seed=SEED)
    for _ in range(3):
        env.step({"spoofer": np.zeros(3), "defender": np.array([0, 0])})
    before = env.game.harm.total[0]
    env.game.simulation.navigator.diverged[:] = True
    _, rewards, terminated, _, infos = env.step({"spoofer": np.zeros(3), "defender": np.array([0, 0])})
    assert terminated["spoofer"]
    assert infos["defender"]["outcome"] == "diverged"
    assert rewards["spoofer"] == pytest.approx(200.0 * 19 / 22)
    assert infos["spoofer"]["harm"] == pytest.approx(before + 200.0 * 19 / 22)


def test_in_a_clean_game_the_spoofer_does_nothing_and_sees_nothing_of_that() -> None:
    config = DuelConfig(**SHORT, clean=1.0, knowledge="shadow")
    games = [DuelGame(config, 2, streams=RunStreams.from_seed(SEED, 2)) for _ in range(2)]
    for game in games:
        game.reset(np.arange(2))
    for _ in range(10):
        for game, rate in zip(games, (0.0, 0.7), strict=True):
            game.step({"spoofer": np.full((2, 3), rate), "defender": np.zeros((2, 2), dtype=int)})
    np.testing.assert_array_equal(games[0].simulation.error, games[1].simulation.error)
    assert not games[1].simulation.attacked.any()
    seen = games[1].observation()["spoofer"]
    assert seen[0, 0] > 0.5  # the offset that it means to send


def test_a_spoofer_that_knows_all_sees_what_was_decided() -> None:
    env = duel.parallel_env(**SHORT, knowledge="full", outage=0.0)
    names = [field.name for field in env.game.seats["spoofer"].fields]
    used, back = (names.index(field.name) for field in DECISION_FIELDS)
    seen, _ = env.reset(seed=SEED)
    assert (seen["spoofer"][used], seen["spoofer"][back]) == (0.0, 0.0)
    for decision, told in (((0, 0), (1.0, 0.0)), ((0, 0), (1.0, 0.0)), ((0, 0), (1.0, 0.0)), ((1, 1), (0.0, 3 / 23))):
        seen, *_ = env.step({"spoofer": np.zeros(3), "defender": np.array(decision)})
        np.testing.assert_allclose(seen["spoofer"][[used, back]], told, rtol=1e-6)
    assert "last fix used" not in [field.name for field in duel.parallel_env(**SHORT).game.seats["spoofer"].fields]


def test_pettingzoo_makes_it_by_its_id() -> None:
    pettingzoo = pytest.importorskip("pettingzoo", minversion="1.27")
    made = pettingzoo.make("parallel", duel.ID, **SHORT)
    one, two = trace(made, SEED), trace(duel.parallel_env(**SHORT), SEED)
    assert all((a == b).all() for a, b in zip(one, two, strict=True))
    cycle = pettingzoo.make("aec", duel.ID, **SHORT)
    cycle.reset(seed=SEED)
    assert cycle.agent_selection == "spoofer"


def test_a_picture_is_drawn() -> None:
    env = duel.parallel_env(**SHORT, render_mode="rgb_array")
    env.reset(seed=SEED)
    env.step({"spoofer": np.ones(3), "defender": np.array([1, 1])})
    picture = env.render()
    assert picture.shape == (540, 960, 3)
    assert picture.std() > 10
    env.close()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"payoff": "most"}, "unknown payoff 'most'"),
        ({"payoff": "beyond"}, "limit"),
        ({"payoff": "error:-1"}, "cap must be"),
        ({"clean": 2.0}, "duel: clean must be"),
        ({"knowledge": "all"}, "duel: knowledge must be"),
        ({"scenario": "moon"}, "duel: scenario: unknown scenario 'moon'"),
        ({"detectors": ("snapshot", "snapshot")}, "duel: detectors: each detector can be given once only"),
        ({"detectors": "raim"}, "detector 'raim' needs"),
        ({"scenario": SKY, "action": "innovation"}, "use action='rate'"),
        ({"render_mode": "cinema"}, "duel: render_mode must be one of human, rgb_array, ansi"),
    ],
)
def test_bad_arguments_are_refused_by_name(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        duel.parallel_env(**{**SHORT, **arguments})


def test_an_unknown_argument_is_refused() -> None:
    with pytest.raises(TypeError, match=r"unknown argument 'attacks'; valid arguments: scenario, detectors, "):
        duel.parallel_env(attacks="ramp")


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        ({"spoofer": np.zeros(3)}, "a step needs the actions of spoofer and defender, got those of spoofer"),
        ({}, "got those of nobody"),
        ({"spoofer": np.zeros(2), "defender": np.zeros(2)}, "the action of the spoofer must have shape (3,)"),
        ({"spoofer": np.full(3, np.nan), "defender": np.zeros(2)}, "is not finite"),
        ({"spoofer": np.zeros(3), "defender": np.array([0, 99])}, "must be whole numbers"),
    ],
)
def test_bad_actions_are_refused_and_nothing_is_played(actions: dict[str, Any], message: str) -> None:
    env = duel.parallel_env(**SHORT)
    env.reset(seed=SEED)
    with pytest.raises(ValueError, match=re.escape(message)):
        env.step(actions)
    assert env.game.index[0] == 0


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (None, "duel: a step needs a dictionary of actions by agent, got None"),
        ({"spoofer": np.zeros((2, 3))}, "a step needs the actions of spoofer and defender, got those of spoofer"),
        ({"spoofer": np.zeros((2, 4)), "defender": np.zeros((2, 2))}, "the actions of the spoofer must have shape"),
        ({"spoofer": np.full((2, 3), np.nan), "defender": np.zeros((2, 2))}, "action of the spoofer in lane 0 is not"),
        ({"spoofer": np.zeros((2, 3)), "defender": [[0, 0], [0, 99]]}, "action of the defender in lane 1 must be"),
        ({"spoofer": np.zeros((2, 3)), "defender": None}, "the defender's seat is filled from outside"),
    ],
)
def test_bad_actions_of_many_lanes_name_whose_they_are(actions: Any, message: str) -> None:
    env = duel.vector_env(2, **SHORT)
    env.reset(seed=SEED)
    with pytest.raises(ValueError, match=re.escape(message)):
        env.step(actions)
    assert (env.game.index == 0).all()


def test_a_game_that_is_over_is_over() -> None:
    env = duel.parallel_env(**SHORT)
    with pytest.raises(RuntimeError, match="call reset"):
        env.step({})


def test_without_pettingzoo_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("spoofgym.envs.duel", "spoofgym.duel"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    monkeypatch.setitem(sys.modules, "pettingzoo", None)
    with pytest.raises(gym.error.DependencyNotInstalled, match=r"spoofgym\[multiagent\]"):
        import spoofgym.duel  # noqa: F401
    assert gym.make("spoofgym/DuelSpoofer-v0", scenario=DRIVE, detectors="snapshot")


def test_pages_name_every_argument_with_its_default() -> None:
    def defaults(kind: type) -> dict[str, Any]:
        return {item.name: item.default for item in fields_of(kind)}

    page = inspect.getdoc(DuelParallelEnv)
    assert page is not None
    rows = dict(re.findall(r"^\| `(\w+)` \| (.+?) \|", page[page.index("## Arguments") :], flags=re.MULTILINE))
    written = {name: repr(value).replace("'", '"') for name, value in defaults(DuelConfig).items()}
    written |= {"detectors": "as Defender-v0", "render_mode": "None"}
    assert {name: value.strip("`") for name, value in rows.items()} == written
    assert DuelConfig().detectors == DEFENDER_DETECTORS
    sides = ((DuelSpooferConfig, DuelSpooferEnv, "defender"), (DuelDefenderConfig, DuelDefenderEnv, "spoofer"))
    for kind, env, own in sides:
        assert set(defaults(kind)) - set(defaults(DuelConfig)) == {own}
        assert f'| `{own}` | `"{defaults(kind)[own]}"` |' in str(inspect.getdoc(env))
    for field in DECISION_FIELDS:
        scale = f"{field.scale:g}" if field.scale else "not squashed"
        assert f"| {field.name} | {field.unit} | {scale} |" in page
