"""The vehicle in the three views of a game: what info tells of it, what is paid for it, and what is refused."""

import gymnasium as gym
import numpy as np
import pytest

from spoofgym import duel
from spoofgym.envs.duel_config import DuelConfig
from spoofgym.envs.payoffs import make_payoff
from spoofgym.envs.vector import SpooferVectorEnv
from spoofgym.evaluation.duels import play_cell
from spoofgym.scenarios import make_scenario
from spoofgym.studies.duel_bound import loss_of

DRIVE = "foi-drive:horizon=16,guidance=first-order:1/axes=horizontal"
QUIET = "snapshot:threshold=1000"
EAST = np.array([1.0, 0.3, 0.0], dtype=np.float32)
SPOOFER = {"scenario": DRIVE, "detector": QUIET}


def spoofed_game(env, action=EAST):
    """The infos, rewards and observations of one game."""
    observation, info = env.reset(seed=3)
    infos, rewards, observations, over = [info], [], [observation], False
    while not over:
        observation, reward, over, _, info = env.step(action)
        infos.append(info)
        rewards.append(reward)
        observations.append(observation)
    return infos, np.array(rewards), np.array(observations)


def spoofer(**arguments):
    return gym.make("spoofgym:spoofgym/Spoofer-v0", **{**SPOOFER, **arguments})


def test_the_spoofer_s_view_tells_the_deviation_and_changes_nothing_else() -> None:
    plain = spoofed_game(spoofer(scenario="foi-drive:horizon=16"))
    infos, rewards, observations = spoofed_game(spoofer())
    assert "deviation" not in plain[0][-1]
    assert infos[0]["deviation"] == 0.0
    assert infos[-1]["deviation"] > 1.0
    assert [info["error"] for info in infos] == [info["error"] for info in plain[0]]
    assert np.array_equal(rewards, plain[1])
    assert np.array_equal(observations, plain[2])


def test_all_views_tell_the_same_deviation() -> None:
    """The same play: a constant action of the spoofer, nobody excludes."""
    single, _, _ = spoofed_game(spoofer())
    game = {"scenario": DRIVE, "detectors": QUIET, "clean": 0.0, "outage": 0.0, "multipath": 0.0}
    both = duel.parallel_env(**game)
    both.reset(seed=3)
    alone = gym.make("spoofgym:spoofgym/DuelSpoofer-v0", defender="always-use", **game)
    alone.reset(seed=3)
    lanes = SpooferVectorEnv(2, **SPOOFER)
    lanes.reset(seed=3)
    for info in single[1:]:
        _, _, _, _, infos = both.step({"spoofer": EAST, "defender": np.array([0, 0])})
        assert infos["spoofer"]["deviation"] == infos["defender"]["deviation"] == info["deviation"]
        assert alone.step(EAST)[4]["deviation"] == info["deviation"]
        assert lanes.step(np.stack([EAST, -EAST]))[4]["deviation"][0] == info["deviation"]


def test_the_defender_s_view_tells_it() -> None:
    env = gym.make("spoofgym:spoofgym/Defender-v0", scenario=DRIVE, detectors=QUIET, attacks="ramp:2", clean=0.0)
    _, info = env.reset(seed=1)
    assert info["deviation"] == 0.0
    for _ in range(16):
        info = env.step(np.array([0, 0]))[4]
    assert info["deviation"] > 1.0


@pytest.mark.parametrize("objective", ["deviation", "target:-20/5"])
def test_the_return_is_the_objective_at_the_end(objective: str) -> None:
    env = spoofer(objective=objective)
    infos, rewards, _ = spoofed_game(env)
    steering = env.unwrapped.game.simulation.steering
    place = steering.deviation[0, :2]
    expected = infos[-1]["deviation"]
    if objective.startswith("target"):
        expected = np.hypot(20.0, 5.0) - np.hypot(*(place - [-20.0, 5.0]))
    assert np.hypot(*place) == pytest.approx(infos[-1]["deviation"])
    assert 10.0 * rewards.sum() == pytest.approx(expected, abs=1e-9)
    assert place[0] < -1.0, "the vehicle goes where the fixes did not"


def test_an_alarm_takes_the_objective_back() -> None:
    infos, rewards, _ = spoofed_game(spoofer(objective="deviation", detector="snapshot:threshold=60"))
    assert infos[-1]["outcome"] == "detected"
    assert infos[-1]["deviation"] > 0.0
    assert rewards.sum() == pytest.approx(0.0, abs=1e-12)


def test_lanes_are_paid_as_single_games() -> None:
    """A game that begins within a step of the vector environment begins on its path, and is paid from there."""
    lanes = SpooferVectorEnv(3, objective="deviation", **{**SPOOFER, "scenario": DRIVE.replace("16", "5")})
    _, rewards, _ = spoofed_game(spoofer(scenario=DRIVE.replace("16", "5"), objective="deviation"))
    lanes.reset(seed=3)
    paid = [lanes.step(np.stack([EAST] * 3)) for _ in range(7)]
    assert [step[1][0] for step in paid[:5]] == rewards.tolist()
    assert (paid[5][1] == 0.0).all()
    assert not paid[5][4]["deviation"].any()
    assert paid[6][1][0] * 10.0 == pytest.approx(paid[6][4]["deviation"][0])


@pytest.mark.parametrize(("payoff", "worth"), [("deviation", 0), ("deviation:0.7", 1), ("target:-9/0", 2)])
def test_a_duel_s_harm_is_the_mean_over_its_epochs(payoff: str, worth: int) -> None:
    game = {"scenario": DRIVE, "detectors": QUIET, "clean": 0.0, "outage": 0.0, "multipath": 0.0}
    env = gym.make("spoofgym:spoofgym/DuelSpoofer-v0", payoff=payoff, defender="always-use", **game)
    env.reset(seed=3)
    found, paid, over = [], 0.0, False
    while not over:
        _, reward, over, _, info = env.step(EAST)
        east, north = env.unwrapped.game.simulation.steering.deviation[0, :2]
        distance = float(np.hypot(east, north))
        found.append((distance, min(distance, 0.7), 9.0 - float(np.hypot(east + 9.0, north)))[worth])
        paid += reward
    assert info["harm"] == pytest.approx(np.mean(found), abs=1e-12)
    assert paid == pytest.approx(info["harm"], abs=1e-12)


def test_a_cell_of_a_matrix_takes_the_payoff() -> None:
    config = DuelConfig(scenario=DRIVE, detectors=QUIET, payoff="deviation", clean=0.5)
    pulled, nobody = (play_cell(config, attack, "always-use", 40, 0) for attack in ("ramp:2", "none"))
    assert pulled.mean > 2.0 * nobody.mean


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("deviaton", "unknown payoff 'deviaton': did you mean 'deviation'"),
        ("deviation:-1", "cap must be"),
        ("target", "needs EAST/NORTH in m, e.g. target:10/-5, got ''"),
        ("target:5", "needs EAST/NORTH"),
        ("target:5/north", "needs EAST/NORTH"),
        ("target:1/2/3", "needs EAST/NORTH"),
        ("target:nan/1", "east must be"),
        ("target:0/0", "must lie beside the path"),
    ],
)
def test_payoffs_that_are_spelled_wrongly(text: str, told: str) -> None:
    with pytest.raises(ValueError, match=told) as caught:
        make_payoff(text, make_scenario(DRIVE))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["deviation", "target:1/2"])
def test_a_vehicle_that_keeps_its_path_has_no_deviation_to_pay_for(name: str) -> None:
    told = "has none: add guidance=first-order:2 to the scenario"
    with pytest.raises(ValueError, match=told):
        make_payoff(name, make_scenario("foi-drive"))
    with pytest.raises(ValueError, match=f"objective: objective {name!r} is of a vehicle.*{told}"):
        spoofer(scenario="foi-drive", objective=name)
    with pytest.raises(ValueError, match="the bound is of errors"):
        loss_of(name, make_scenario(DRIVE))


def test_an_unknown_objective_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown objective 'errors': did you mean 'error'"):
        spoofer(objective="errors")


def test_a_line_of_text_tells_it() -> None:
    env = spoofer(render_mode="ansi")
    infos, _, _ = spoofed_game(env)
    assert f"off path {infos[-1]['deviation']:5.1f} m" in env.render()
    assert "off path" not in play_line("foi-drive:horizon=16")


def play_line(scenario: str) -> str:
    """The line of the first epoch."""
    env = spoofer(scenario=scenario, render_mode="ansi")
    env.reset(seed=3)
    return str(env.render())
